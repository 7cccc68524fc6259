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

/// Has a gaze say, ten times a second, where a robot's head turns. Where one throws, fails or says
/// what is not a number the head stays, and it is named in the log, again only after it did well. A
/// head that does not move where it is told to is named, too.
///
/// Plans have the head at rest. It is not turned where it would come near to the rest of the robot
/// or to obstacles, as the robot is and goes on, and goes to rest in time where they come near. A
/// motion that leaves no time for that must not begin. [planning]
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
    double margin_m = 0.0;  ///< Of the head from obstacles, as of what plans move.
  };
  /// Fails with kUnsupported where the robot has no head (RobotDescription::head), or the executor
  /// turns none.
  [[nodiscard]] static Result<GazeLoop> create(Parts parts);

  /// Whether it is time to look().
  [[nodiscard]] bool is_due(Stamp now) const noexcept;
  GazeLoop(GazeLoop&& other) noexcept;
  ~GazeLoop();

  /// Turns the head. `way` holds during the call.
  void look(Stamp now, const RobotState& measured, const Replanner::Way& way);
  /// Why a motion that is to be followed must not begin now: it would run into the head before that
  /// is at rest, where it goes for it. Empty: it may.
  [[nodiscard]] std::string objection(Stamp now, const Trajectory& motion);

 private:
  GazeLoop(Parts parts, Head head, HeadTurner& turner);
  /// Where the gaze wants it, within its limits.
  [[nodiscard]] Result<HeadAngles> ask(Stamp now, const RobotState& measured,
                                       const Replanner::Way& way, const HeadAngles& at,
                                       const HeadAngles& stop);
  /// Whether the way to some angles is clear by its rest.
  [[nodiscard]] bool is_clear_by_rest(const HeadAngles& at, const HeadAngles& stop,
                                      const HeadAngles& to);
  /// Where it turns instead of where it was asked to.
  [[nodiscard]] HeadAngles apart(Stamp now, const HeadAngles& at, const HeadAngles& stop,
                                 const HeadAngles& asked);
  [[nodiscard]] Result<void> tell(Stamp now, HeadAngles wanted);
  /// Names a head that has stood still, not where it was told to be, for half a second.
  void watch_head(Stamp now, const HeadAngles& at);
  [[nodiscard]] Result<void> turn(Stamp now, const RobotState& measured, const Replanner::Way& way);
  [[nodiscard]] HeadAngles head_at(Stamp now) const {
    return parts_.motion.head(now).value_or(head_.rest());
  }
  /// Where it would be at rest if it turned no further.
  [[nodiscard]] HeadAngles head_stop(Stamp now) const;

  Parts parts_;
  Head head_;
  HeadTurner* turner_;
  std::unique_ptr<HeadGuard> guard_;
  std::vector<Transform> T_world_link_;
  Scratch scratch_;
  std::optional<Stamp> looked_;
  std::optional<HeadAngles> told_;  ///< Where the head was told to turn last.
  Stamp told_at_;
  Stamp rests_until_;  ///< A motion wants it to.
  bool has_failed_ = false;
  std::optional<HeadAngles> stood_at_;  ///< Where it has been, short of where it was told to be,
  Stamp stood_since_;                   ///< since then.
  bool is_stuck_ = false;
};

}  // namespace sidestep
