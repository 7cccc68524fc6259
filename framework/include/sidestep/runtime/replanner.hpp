#pragma once

#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include <sidestep/core/log.hpp>
#include <sidestep/planning/executor.hpp>
#include <sidestep/planning/optimiser.hpp>
#include <sidestep/planning/validity_check.hpp>
#include <sidestep/runtime/snapshot_slot.hpp>
#include <sidestep/trajectory/motion_limits.hpp>

namespace sidestep {

/// How a replanner behaves. Times on the run's clock.
struct ReplannerSettings {
  double replan_period_s = 0.1;     ///< Least time from one replan's begin to the next one's.
  double takeover_s = 0.1;          ///< From a replan's begin to when its trajectory takes over.
  double solve_limit_s = 0.08;      ///< For all attempts of one replan; less than takeover_s.
  double max_map_age_s = 0.5;       ///< An older map leads to a stop.
  double goal_tolerance = 0.02;     ///< Of every joint at the goal, m or rad.
  double rest_speed = 0.02;         ///< Slower joints count as at rest, m/s or rad/s.
  double tracking_tolerance = 0.1;  ///< Largest distance of a joint from what it follows, m or rad.
  double margin_m = 0.0;            ///< That spheres must keep from obstacles.
  double max_step_m = 0.02;         ///< Of the validity check.
  /// A stop begins no later than when what blocks the trajectory is so many times as far away, in
  /// time, as the robot needs to come to rest.
  double stop_reserve = 1.5;
  /// First guesses of a replan, in order: "refit", "straight_line", "perturbed", "sampled".
  std::vector<std::string> escalation = {"refit", "straight_line", "perturbed"};
};

/// What a replanner noticed or did.
struct ReplannerEvent {
  enum class Kind {
    kPlanned,       ///< A first trajectory, or one after a stop, is followed.
    kReplanned,     ///< A trajectory has been replaced by a new one.
    kReplanFailed,  ///< No attempt led to a valid trajectory; what is followed goes on.
    kStopped,       ///< The robot is being brought to rest.
    kRecovered,     ///< The cause of a stop is gone.
    kReached,       ///< The robot is at rest at its goal.
  };
  Kind kind = Kind::kPlanned;
  Stamp stamp;
  std::string cause;      ///< Why, in words; names what is in the way, who failed.
  double solve_ms = 0.0;  ///< All attempts, wall time; of plans and replans.
  std::string guess;      ///< The one that led to the trajectory.
  int attempts = 0;
  double cost = 0.0;
  double splice_velocity_jump = 0.0;  ///< Largest of any joint when the new one takes over.
  Stamp map_stamp;                    ///< Of the map that was planned in.
};
[[nodiscard]] std::string_view to_string(ReplannerEvent::Kind kind) noexcept;

/// Receding-horizon replanning (Finean 2021, Algorithm 1), with stops that are verified. A plain
/// state machine: whoever owns it calls step() again and again, at 250 Hz or better, from one
/// thread; it starts none. [planning]
class Replanner {
 public:
  /// Poses the problem from a state to the goal in a field: horizon, prior, terms.
  using PoseProblem =
      std::function<Problem(std::shared_ptr<const DistanceField> field, const RobotState& start)>;

  struct Parts {
    std::shared_ptr<const RobotModel> robot;
    Executor& executor;
    Optimiser& optimiser;
    Optimiser* sampler;  ///< For the guess "sampled"; may be null.
    SnapshotSlot& slot;
    PoseProblem pose_problem;
    RobotState goal;
    SpacePolicy space;
    MotionLimits limits;  ///< That trajectories keep.
    Log& log;
  };

  Replanner(Parts parts, ReplannerSettings settings);
  ~Replanner();

  enum class Status { kMoving, kWaiting, kReached };
  /// Looks at the newest map and state, and does what is due. Appends what happened to `events`.
  /// Never throws: what a plugin throws or returns amiss leads to a stop with an event that names
  /// it.
  Status step(Stamp now, std::vector<ReplannerEvent>& events);

  /// What the robot follows, and when its time 0 was; empty before the first plan and after a stop.
  [[nodiscard]] const Trajectory& followed() const noexcept;
  [[nodiscard]] Stamp followed_start() const noexcept;
  /// Validity checks so far.
  [[nodiscard]] std::int64_t checks() const noexcept;

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace sidestep
