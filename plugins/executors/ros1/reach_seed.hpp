#pragma once

#include <optional>
#include <string>

#include <Eigen/Core>

#include <sidestep/robot/robot_model.hpp>

#include "options.hpp"

namespace sidestep::ros1_executor {

/// A link that is to be somewhere.
struct Reach {
  int link = 0;
  Transform T_world_target = Transform::Identity();
  bool turns = true;  ///< Whether its rotation counts.
};

/// From where a search for a posture that reaches begins: of the posture that the robot has and
/// those that its profile names, the one that comes nearest once its base, if it has one, stands
/// and is turned as suits best. Such a search finds what is near; from afar, it ends anywhere. What
/// is in the way is not asked. The base stays in `keep_in` where there is a posture for which it
/// can. Within the joints' limits. Pure; allocates. [any]
[[nodiscard]] Eigen::VectorXd reach_seed(const RobotModel& robot, const Reach& reach,
                                         const std::optional<OdometryOptions>& base,
                                         const std::optional<KeepInBox>& keep_in,
                                         const Eigen::VectorXd& q_now);

}  // namespace sidestep::ros1_executor
