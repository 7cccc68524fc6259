#pragma once

#include <string>

#include <sidestep/core/error.hpp>
#include <sidestep/robot/robot_model.hpp>
#include <sidestep/trajectory/trajectory.hpp>

namespace sidestep::ros1_executor {

/// Of one joint over a whole trajectory, its cubics' own extremes included.
struct JointExtent {
  double lowest = 0.0;
  double highest = 0.0;
  double fastest = 0.0;       ///< Absolute velocity.
  double fastest_at_s = 0.0;  ///< Where the stretch begins in which that is.
};

/// `trajectory` is sound and not empty. [any]
[[nodiscard]] JointExtent extent_of(const Trajectory& trajectory, int joint);

/// Whether a trajectory is one of the robot's, within its velocity limits times
/// 1 + `velocity_tolerance`. Fails with kInvalidArgument, naming the joint. [any]
[[nodiscard]] Result<void> check_motion(const Trajectory& trajectory, const RobotDescription& robot,
                                        double velocity_tolerance);

}  // namespace sidestep::ros1_executor
