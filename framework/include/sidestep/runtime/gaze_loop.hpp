#pragma once

#include <memory>
#include <optional>
#include <string>
#include <vector>

#include <sidestep/core/log.hpp>
#include <sidestep/planning/executor.hpp>
#include <sidestep/planning/gaze.hpp>
#include <sidestep/runtime/replanner.hpp>
#include <sidestep/runtime/snapshot_slot.hpp>
#include <sidestep/trajectory/robot_motion.hpp>

namespace sidestep {

class HeadGuard;

/// Has a gaze say, ten times a second, where a robot's head turns. One that throws, fails or says
/// what is not a number leaves the head as it is, and is named in the log, again only after it did
/// well. Plans have the head at rest: it is not turned where it would come near to the rest of the
/// robot, as that is and goes on, and goes to rest in time where that comes near to it. A motion
/// that leaves no time for that must not begin. [planning]
class GazeLoop {
 public:
  struct Parts {
    std::shared_ptr<const RobotModel> robot;
    Gaze& gaze;
    Executor& executor;
    RobotMotion& motion;
    SnapshotSlot& slot;
    Log& log;
    std::string gaze_name;  ///< For messages: kind and name, as the next.
    std::string executor_name;
  };
  /// Fails with kUnsupported where the robot has no head (RobotDescription::head), or the executor
  /// turns none.
  [[nodiscard]] static Result<GazeLoop> create(Parts parts);

  /// Whether it is time to look().
  [[nodiscard]] bool is_due(Stamp now) const noexcept;
  /// Turns the head. `way` holds during the call.
  void look(Stamp now, const RobotState& measured, const Replanner::Way& way);
  /// Why a motion must not begin now: it would run into the head before that is at rest, where it
  /// then goes. Empty: it may.
  [[nodiscard]] std::string objection(Stamp now, const Trajectory& motion);

 private:
  GazeLoop(Parts parts, Head head, HeadTurner& turner);
  [[nodiscard]] Result<void> turn(Stamp now, const RobotState& measured, const Replanner::Way& way);
  [[nodiscard]] HeadAngles head_at(Stamp now) const {
    return parts_.motion.head(now).value_or(head_.rest());
  }
  /// Where it would be at rest if it turned no further.
  [[nodiscard]] HeadAngles head_stop(Stamp now) const;

  Parts parts_;
  Head head_;
  HeadTurner* turner_;
  std::shared_ptr<HeadGuard> guard_;
  std::vector<Transform> T_world_link_;
  Scratch scratch_;
  std::optional<Stamp> looked_;
  std::optional<HeadAngles> told_;  ///< Where the head was told to turn last.
  Stamp told_at_;
  Stamp rests_until_;  ///< A motion wants it to.
  bool has_failed_ = false;
};

}  // namespace sidestep
