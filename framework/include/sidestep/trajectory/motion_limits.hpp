#pragma once

#include <optional>
#include <span>
#include <string>
#include <vector>

#include <sidestep/robot/robot_model.hpp>

namespace sidestep {

/// How fast each joint may move and how fast its speed may change, in m or rad per s and s^2;
/// infinity where there is no limit. Plain data.
struct MotionLimits {
  std::vector<double> velocity;
  std::vector<double> acceleration;
  std::vector<std::string> names;  ///< Of the joints, for messages; may be empty.
  /// How fast joints may lose speed where the robot is to stop (braking.hpp), no less than
  /// `acceleration`, which motions keep; empty: that.
  std::vector<double> braking = {};
  /// Motions along paths on which this base rolls let it roll, and are no faster along its wheels
  /// than along x.
  std::optional<RollingBase> rolling = {};

  /// By what joints lose speed in stops. [any]
  [[nodiscard]] const std::vector<double>& while_stopping() const noexcept {
    return braking.empty() ? acceleration : braking;
  }

  /// For messages: by name where there is one, else by number.
  [[nodiscard]] std::string joint_name(std::size_t joint) const {
    return joint < names.size() ? "joint '" + names[joint] + "'" : "joint " + std::to_string(joint);
  }
};

/// The part of a robot's limits that a motion may use.
struct LimitShares {
  double speed_fraction = 1.0;         ///< Of the velocity limits, (0, 1].
  double acceleration_fraction = 1.0;  ///< Of the acceleration and braking limits, (0, 1].
  /// What counts as the acceleration limit of a joint that has none: that which reaches the
  /// joint's velocity limit in this time.
  double assumed_ramp_s = 0.5;
};

/// The limits of a robot's joints times their shares. [any]; allocates.
[[nodiscard]] MotionLimits motion_limits(const RobotDescription& robot, const LimitShares& shares);

/// Names of the joints whose acceleration limit is not known.
[[nodiscard]] std::vector<std::string> joints_of_unknown_acceleration(
    const RobotDescription& robot);

/// The least time in which each joint by itself can move from rest at `q_from` to rest at `q_to`:
/// per joint a trapezoid of speed, D / V + V / A, or a triangle, 2 sqrt(D / A), where the way is
/// too short to reach V; the slowest joint's. Infinite where a limit is zero or not a number.
[[nodiscard]] double least_time_s(const MotionLimits& limits, std::span<const double> q_from,
                                  std::span<const double> q_to) noexcept;

}  // namespace sidestep
