#pragma once

#include <span>
#include <vector>

#include <sidestep/core/error.hpp>
#include <sidestep/robot/robot_model.hpp>
#include <sidestep/trajectory/trajectory.hpp>

#include "options.hpp"

namespace sidestep::ros1_executor {

/// Where a head is to pan, for its camera to see where the base is going to be. [any]
class Gaze {
 public:
  /// Fails with kConfig where the robot lacks a joint of the base.
  [[nodiscard]] static Result<Gaze> create(const RobotDescription& robot,
                                           const OdometryOptions& base, const LookOptions& look);

  /// The pan joint's position at each of `times_s`, ascending, which count from `from_s` of the
  /// plan: towards where the base is `ahead_s` later, or straight ahead where that is here; from
  /// `pan_rad` on, no faster than its speed, within its limits.
  [[nodiscard]] std::vector<double> pans(const Trajectory& plan, double from_s,
                                         std::span<const double> times_s, double pan_rad) const;

 private:
  Gaze(const LookOptions& look, int x, int y, int yaw) : look_(look), x_(x), y_(y), yaw_(yaw) {}
  [[nodiscard]] double wanted(const Trajectory& plan, double at_s) const;

  LookOptions look_;
  int x_;
  int y_;
  int yaw_;
};

}  // namespace sidestep::ros1_executor
