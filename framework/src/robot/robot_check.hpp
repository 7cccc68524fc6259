#pragma once

#include <vector>

#include <sidestep/robot/kinematic_tree.hpp>

namespace sidestep::detail {

/// Whether a description and its tree joints fit together; names the first part that does not.
[[nodiscard]] Result<void> check_robot(const RobotDescription& description,
                                       const std::vector<TreeJoint>& tree_joints);

}  // namespace sidestep::detail
