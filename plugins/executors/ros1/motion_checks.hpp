#pragma once

#include <optional>
#include <string>
#include <utility>

#include <sidestep/core/error.hpp>
#include <sidestep/core/format.hpp>
#include <sidestep/core/log.hpp>
#include <sidestep/robot/robot_model.hpp>
#include <sidestep/trajectory/trajectory.hpp>

#include "robot_link.hpp"
#include "ros1_executor.hpp"

/// What a motion must pass before the robot is told to make it, beside check_motion(). Failures are
/// kInvalidArgument, with what to do about it.
namespace sidestep::ros1_executor {

inline constexpr const char* kWhere = "executor ros1";  ///< Of errors.

/// The robot is not told what it was to be told.
[[nodiscard]] inline tl::unexpected<Error> refuse(std::string why, std::string hint = {}) {
  return fail(ErrorCode::kInvalidArgument, std::move(why), kWhere, std::move(hint));
}

/// A number for people, to four digits.
[[nodiscard]] inline std::string figure(double value) { return format("%.4g", value); }

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
