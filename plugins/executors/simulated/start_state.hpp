#pragma once

#include <Eigen/Core>

#include <sidestep/core/error.hpp>
#include <sidestep/core/node.hpp>
#include <sidestep/robot/robot_model.hpp>

namespace sidestep::simulated {

/// The configuration that a map of joint names to positions gives, joints left out at 0. Fails with
/// kConfig for an unknown joint, or one outside its limits.
[[nodiscard]] Result<Eigen::VectorXd> read_start(const Node& start, const RobotDescription& robot);

}  // namespace sidestep::simulated
