#pragma once

#include <optional>

#include <sidestep/core/time.hpp>
#include <sidestep/planning/executor.hpp>
#include <sidestep/trajectory/motion_limits.hpp>
#include <sidestep/trajectory/trajectory.hpp>

namespace sidestep::ros1_executor {

/// What the robot has been told to do: a trajectory, whose time 0 is at a stamp of the run's clock.
/// Kept once it has ended, for the robot is still held there. One thread at a time.
class ToldMotion {
 public:
  void set(Trajectory trajectory, Stamp start);
  /// It was told nothing, or nothing but to hold.
  void clear() { trajectory_ = {}; }

  [[nodiscard]] bool is_empty() const noexcept { return trajectory_.size() == 0; }
  [[nodiscard]] const Trajectory& trajectory() const noexcept { return trajectory_; }
  [[nodiscard]] Stamp start() const noexcept { return start_; }
  [[nodiscard]] double since_start_s(Stamp now) const noexcept {
    return 1e-9 * static_cast<double>(now.ns - start_.ns);
  }
  /// Until it ends; also before it starts.
  [[nodiscard]] bool is_under_way(Stamp now) const {
    return !is_empty() && since_start_s(now) < trajectory_.duration_s();
  }
  /// Where the robot is told to be at a time: its ends, at rest, beyond them. Nothing where it is
  /// empty.
  [[nodiscard]] std::optional<RobotState> at(Stamp now) const;

 private:
  Trajectory trajectory_;
  Stamp start_;
};

/// How the robot comes to rest from `now` on. Where it was measured within `tolerance` of what it
/// was told (every joint, m or rad), or is not measured: along that path, or straight on from
/// there. Else straight on from what it does. Empty where nothing is known to stop from, and where
/// a joint that moves may not be slowed down. [any]; allocates.
[[nodiscard]] Trajectory stopping(const ToldMotion& told,
                                  const std::optional<Executor::Measured>& measured,
                                  double tolerance, const MotionLimits& limits, Stamp now);

}  // namespace sidestep::ros1_executor
