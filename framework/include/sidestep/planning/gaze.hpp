#pragma once

#include <functional>
#include <optional>
#include <span>

#include <sidestep/core/error.hpp>
#include <sidestep/core/export.hpp>
#include <sidestep/core/time.hpp>
#include <sidestep/field/distance_field.hpp>
#include <sidestep/mapping/moving_obstacles.hpp>
#include <sidestep/mapping/tracks.hpp>
#include <sidestep/robot/head.hpp>
#include <sidestep/sensing/frame.hpp>
#include <sidestep/trajectory/trajectory.hpp>

namespace sidestep {

/// What a gaze decides by. References, and pointers that are not null, hold during the call.
struct GazeRequest {
  Stamp now;
  const RobotModel& robot;
  const RobotState& state;                  ///< Measured.
  std::span<const Transform> T_world_link;  ///< In that state, the head at rest (head.hpp).
  const Head& head;
  HeadAngles at;  ///< Where the head is; at rest where that is not known.
  /// Whether the head may turn to angles: what it carries keeps apart from the rest of the robot,
  /// as that is and as its way goes on. Empty: it may turn anywhere.
  std::function<bool(const HeadAngles& to)> may_turn;
  [[nodiscard]] bool may(const HeadAngles& to) const { return !may_turn || may_turn(to); }
  /// The way to the goal: what is followed, or, while the robot stands, brakes or steps aside, the
  /// last that was found. Null where there is none.
  const Trajectory* way = nullptr;
  double way_from_s = 0.0;               ///< The time of `way` at which the robot is on it.
  std::optional<double> way_blocked_s;   ///< The time of `way` from which it is blocked, if it is.
  const DistanceField* field = nullptr;  ///< The newest map; null before the first.
  const Tracks* tracks = nullptr;        ///< With it; null where nobody tracks.
  const MovingObstacles* moving = nullptr;  ///< With it; null where nobody looks for it.
  /// Of the newest frame in it, whichever camera took that; null where there is none.
  const CameraView* camera = nullptr;
};

/// Turns a robot's head.
class SIDESTEP_EXPORT Gaze {
 public:
  virtual ~Gaze() = default;
  /// Where the head is to turn now; asked ten times a second in one episode, or one run of deploy.
  /// Angles beyond its limits end there. Where it would come too near to the rest of the robot,
  /// also on the way, it stays where it is, or goes to rest where that comes too near to it. Fails
  /// where it cannot tell: the head stays. A slow one delays the next step of the replanner, which
  /// may then stop the robot. [planning]; may allocate.
  [[nodiscard]] virtual Result<HeadAngles> look(const GazeRequest& request) = 0;
  /// Whether it wants GazeRequest::tracks; the loop then tracks what moves. [any]
  [[nodiscard]] virtual bool wants_tracks() const noexcept { return false; }
};

}  // namespace sidestep
