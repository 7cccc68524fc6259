#pragma once

#include <optional>
#include <string>

#include <sidestep/core/error.hpp>
#include <sidestep/core/log.hpp>
#include <sidestep/robot/robot_model.hpp>
#include <sidestep/trajectory/trajectory.hpp>

#include "options.hpp"
#include "robot_link.hpp"

/// What a motion must pass before the robot is told to make it, beside check_motion(). Failures are
/// kInvalidArgument, with what to do about it.
namespace sidestep::ros1_executor {

/// Whether at `from_s` of it every joint is within `tolerance` (m or rad) of where the robot will
/// be then, `expected`; nothing: that is not known. [any]
[[nodiscard]] Result<void> check_start(const Trajectory& trajectory, double from_s,
                                       const std::optional<RobotState>& expected,
                                       const RobotDescription& robot, double tolerance);

/// Whether it leaves the base within `options.keep_in`, if there is one. [any]
[[nodiscard]] Result<void> check_box(const Trajectory& trajectory, const RobotDescription& robot,
                                     const Options& options);

/// Mode `confirm`: a robot that stands is not moved without an operator's yes to what is shown. One
/// thread at a time.
class Confirmation {
 public:
  /// `log` outlives this.
  Confirmation(const Options& options, Log& log)
      : is_asked_(options.mode == "confirm"), topic_(options.confirm_topic), log_(log) {}

  /// In other modes, and where the robot `moves` already, nobody is asked. Fails until the yes to
  /// what proposed() last showed is there, and proposes the motion.
  [[nodiscard]] Result<void> check(const Trajectory& trajectory, bool moves, RobotLink& link);
  /// What was shown waits no more.
  void drop() { proposed_ = {}; }
  /// What waits for a yes; empty: nothing.
  [[nodiscard]] const Trajectory& proposed() const noexcept { return proposed_; }

 private:
  bool is_asked_;
  std::string topic_;
  Log& log_;
  Trajectory proposed_;
};

}  // namespace sidestep::ros1_executor
