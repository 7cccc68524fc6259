#pragma once

#include <algorithm>
#include <array>
#include <cstdint>
#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include <sidestep/core/log.hpp>
#include <sidestep/planning/executor.hpp>
#include <sidestep/planning/optimiser.hpp>
#include <sidestep/planning/prediction_check.hpp>
#include <sidestep/planning/validity_check.hpp>
#include <sidestep/plugin/parameters.hpp>
#include <sidestep/runtime/snapshot_slot.hpp>
#include <sidestep/trajectory/motion_limits.hpp>

namespace sidestep {

/// First guesses of a replan: the rest of the path that is followed, at speeds of its own among
/// what is predicted, without an optimiser; that rest, resampled; a straight line; a short way of
/// the base that keeps clear (BaseWays); a line bent by seeded waves, other ones at every try;
/// the path of the sampling planner; a straight line from where a stop would end, which the robot
/// then makes first.
inline constexpr std::array<std::string_view, 7> kReplanGuesses{
    "retimed", "refit", "straight_line", "base_path", "perturbed", "sampled", "after_stop"};

/// How a replanner behaves, the block `replanner`. Times on the run's clock.
struct ReplannerSettings {
  double replan_period_s = 0.1;     ///< Least time from one replan's begin to the next one's.
  double takeover_s = 0.1;          ///< From a replan's begin to when its trajectory takes over.
  double solve_limit_s = 0.08;      ///< For all attempts of one replan; less than takeover_s.
  double stop_lead_s = 0.02;        ///< From the decision to stop to when braking begins.
  double max_map_age_s = 0.5;       ///< An older map leads to a stop.
  double max_state_age_s = 0.2;     ///< An older measured state leads to a stop.
  double goal_tolerance = 0.02;     ///< Of every joint at the goal, m or rad.
  double rest_speed = 0.02;         ///< Slower joints count as at rest, m/s or rad/s.
  double tracking_tolerance = 0.1;  ///< Largest distance of a joint from what it follows, m or rad.
  double margin_m = 0.0;            ///< That spheres must keep from obstacles.
  /// What moves is taken to come nearer no faster than this: while the robot moves, it can always
  /// come to rest before anything that was seen moving could reach it. 0: what moves is an obstacle
  /// like any other.
  double obstacle_speed_mps = 0.0;
  /// How fast what is tracked, standing or not, can change its velocity, beside
  /// obstacle_speed_mps; nothing: at once. Not of "ssm".
  std::optional<double> obstacle_acceleration_mps2;
  /// For so long what has been seen to move, and is out of view since, is taken to come nearer from
  /// where it was seen last, up to three seconds; 0: tracks go on as they went, all else stays.
  double out_of_view_s = 0.0;
  /// "passive", or "ssm": speed and separation monitoring (ISO/TS 15066, 5.5.4). Whoever is
  /// tracked, standing or not, is taken to walk up at kWalkingSpeed_mps, or at obstacle_speed_mps
  /// if that is more, and `intrusion_m` is left when the robot has come to rest.
  std::string safety = "passive";
  double intrusion_m = 0.2;  ///< C + Z_d + Z_r: how far a hand reaches unseen, and both may be off.
  /// How far from where it starts the links that stand on the floor (Floor::except_links) may move
  /// in space that no frame has seen; nothing: anywhere. Farther off, the robot rests before it.
  std::optional<double> unseen_start_m;
  double prediction_horizon_s = 6.0;  ///< For which is predicted what is tracked.
  std::string timing = "fastest";     ///< Or "planner": how proposals are timed.
  double prediction_margin_m = 0.1;   ///< That spheres keep from predicted sets.
  double max_step_m = 0.1;            ///< First spacing of validity checks, as motion of spheres.
  /// Where no trajectory is free all the way, one that is so for at least this long may do: what is
  /// in the way later is looked at again when it is nearer, and may have gone.
  double horizon_s = 8.0;
  /// By the wall's clock: after so long no further first guess is tried where one has led to such a
  /// trajectory; the next search begins with the next guess.
  double stopgap_after_s = 0.002;
  /// A stop begins no later than when what blocks the trajectory is so many times as far away, in
  /// time, as the robot needs to come to rest.
  double stop_reserve = 1.5;
  /// A valid trajectory is replanned, too, once its cost in the newest map has grown by this share
  /// of what the same motion cost in the map it was planned in; 0: never.
  double cost_tolerance = 0.0;
  /// Share by which a new trajectory must then be cheaper to be taken.
  double hysteresis = 0.1;
  /// First guesses of a replan, in order, of kReplanGuesses; others are passed over.
  std::vector<std::string> escalation = {"refit", "straight_line", "base_path", "perturbed",
                                         "after_stop"};
  std::uint64_t seed = 0;  ///< Of "perturbed".
  /// Whether time passes during step(), as on a wall clock: solves get deadlines, and what they
  /// take beyond them counts. False on a clock that stands still meanwhile: solves end by their own
  /// limits alone, takeover_s stands for what they take, and equal inputs give equal events.
  bool limit_wall_time = true;

  /// Longest time without supervision during a search.
  [[nodiscard]] double search_s() const noexcept { return limit_wall_time ? takeover_s : 0.0; }

  /// A step that takes longer, in wall time, has left the robot without supervision: the caller of
  /// step() stops the robot meanwhile, and the step ends in a stop.
  [[nodiscard]] double longest_step_s() const noexcept {
    return std::max(takeover_s, max_state_age_s);
  }

  static Parameters<ReplannerSettings> parameters();
};

/// An observation or action of the replanner.
struct ReplannerEvent {
  enum class Kind {
    kPlanned,       ///< A first trajectory, or one after a stop, is followed.
    kReplanned,     ///< A trajectory has been replaced by a new one.
    kReplanFailed,  ///< No attempt led to a valid trajectory; what is followed goes on.
    kSlowed,        ///< The robot brakes, since what moves nearby could else reach it.
    kStopped,       ///< The robot is being brought to rest, or kept there.
    kRecovered,     ///< The cause of a stop is gone; kPlanned or kReplanned follows.
    kReached,       ///< The robot is at rest at its goal.
  };
  /// The category of `cause`.
  enum class Reason {
    kGoal,          ///< There is a goal to go to, or it is reached.
    kBlocked,       ///< Something is in the way of what is, or was, followed.
    kCost,          ///< It has become costlier.
    kSooner,        ///< A wait, or a way round, may be needed no more.
    kAside,         ///< The robot stands in somebody's predicted way, or has left it.
    kMoving,        ///< Something that moves could reach the robot before it is at rest.
    kMap,           ///< The map is too old, its time jumped, or its tracks make no sense.
    kNotFollowing,  ///< The robot is not where it should be.
    kExecutor,      ///< The executor failed, refused or fell silent.
    kPlugin,        ///< A plugin threw, returned an invalid result or ignored its deadline.
    kClock,         ///< The clock went back.
    kEnd,           ///< The owner of the replanner ended it.
  };
  Kind kind = Kind::kPlanned;
  Reason reason = Reason::kGoal;
  Stamp stamp;
  std::string cause;               ///< Why, in words; names what is in the way, who failed.
  double solve_ms = 0.0;           ///< All attempts, wall time; of plans and replans.
  std::string guess;               ///< The one that led to the trajectory.
  std::vector<std::string> tried;  ///< All guesses tried, in order.
  int attempts = 0;                ///< How many those are.
  double cost = 0.0;               ///< That the optimiser states.
  /// Largest difference of any joint's velocity, m/s or rad/s, between the proposal made fit to be
  /// followed and what it takes over from. The trajectory that is sent has none: it has one state
  /// there (docs/closed_loop.md).
  double splice_velocity_jump = 0.0;
  /// Share of the robot's spheres along the new trajectory that are in space no frame has seen.
  double unknown_share = 0.0;
  Stamp takeover;   ///< When the new trajectory takes over, or the stop begins.
  Stamp map_stamp;  ///< Of the map that was planned in.
  /// The last motion, from the event's stamp on, that the search found and turned down; may be
  /// null.
  std::shared_ptr<const Trajectory> refused;
};
[[nodiscard]] std::string_view to_string(ReplannerEvent::Kind kind) noexcept;
[[nodiscard]] std::string_view to_string(ReplannerEvent::Reason reason) noexcept;

/// Receding-horizon replanning (Finean 2021, Algorithm 1), with stops that are verified. A plain
/// state machine: its owner calls step() again and again, at 250 Hz or better, from one
/// thread; it starts none. [planning]
///
/// The executor is always sent one trajectory from the current time on: the rest of what it
/// follows, up to the takeover, and then the new motion. docs/closed_loop.md says what leads to a
/// stop.
class Replanner {
 public:
  /// Poses the problem from a state to a goal in a field: horizon, prior, terms.
  using PoseProblem = std::function<Problem(std::shared_ptr<const DistanceField> field,
                                            const RobotState& start, const RobotState& goal)>;

  struct Parts {
    std::shared_ptr<const RobotModel> robot;
    Executor& executor;
    Optimiser& optimiser;
    Optimiser* sampler;  ///< For the guess "sampled"; may be null.
    SnapshotSlot& slot;
    PoseProblem pose_problem;
    /// Where the robot is to rest. Where the problem leaves the goal's configuration to costs
    /// (goal.hpp: is_goal_free), the end of the plan stands for it.
    RobotState goal;
    SpacePolicy space;
    MotionLimits limits;  ///< That trajectories keep, and stops.
    Log& log;
    std::string executor_name = "executor";  ///< For messages, as the next two.
    std::string optimiser_name = "optimiser";
    std::string sampler_name = "sampler";
    /// What keeps new maps from coming, in words, for the cause of a stop; empty where nothing
    /// does.
    std::function<std::string()> map_trouble = {};
    /// Says where the tracks of a map will be, none of which is in its field; may be null.
    Predictor* predictor = nullptr;
    std::string predictor_name = "predictor";
    /// Another configuration that does in a field what is asked of the goal, at each call another
    /// one where there are several; nothing where none was found. May be empty.
    std::function<std::optional<Eigen::VectorXd>(std::shared_ptr<const DistanceField> field)>
        other_goal = {};
    /// Of the term "moving" that problems with a prediction get; nothing: they get none.
    std::optional<CostSettings> moving_costs = std::nullopt;
    /// Why a motion that would begin now must not, whatever the map; empty: it may. May be empty.
    std::function<std::string(const Trajectory& motion)> objection = {};
  };

  Replanner(Parts parts, ReplannerSettings settings);
  ~Replanner();

  enum class Status {
    kMoving,   ///< The robot follows a trajectory, or has not come to rest yet.
    kWaiting,  ///< It stands: no plan yet, no map, or the cause of a stop lasts.
    kReached,  ///< It stands at its goal, for good.
  };
  /// Looks at the newest map and state, and does what is due. Appends what happened to `events`.
  /// Never throws: what a plugin throws or returns amiss leads to a stop with an event that names
  /// it.
  Status step(Stamp now, std::vector<ReplannerEvent>& events);

  /// Begins a stop, verified where that can be, of a robot that moves: for the last step() of all,
  /// since the next one would go on. Never throws.
  void stop(Stamp now, const std::string& cause, std::vector<ReplannerEvent>& events);

  /// What the robot follows, and when its time 0 was; empty before the first plan and after a stop.
  /// The reference holds until the next step().
  [[nodiscard]] const Trajectory& followed() const noexcept;
  [[nodiscard]] Stamp followed_start() const noexcept;
  /// Where it is to rest: the goal that was given, or another one since then.
  [[nodiscard]] const Eigen::VectorXd& goal() const noexcept;
  struct Way {
    const Trajectory* trajectory = nullptr;
    double from_s = 0.0;                   ///< The time of it at which the robot is on it.
    std::optional<double> blocked_s;       ///< The time of it from which an obstacle blocks it.
    const Trajectory* followed = nullptr;  ///< What the robot follows, or a stop; null at rest.
    double followed_s = 0.0;               ///< The time of that at which the robot is.
  };
  /// The way to the goal: what is followed, or, while the robot stands, brakes or steps aside, the
  /// last that was found, be it blocked; null where there is none. Holds until the next step().
  [[nodiscard]] Way way() const;
  /// What is predicted in the newest map; null where nothing is.
  [[nodiscard]] std::shared_ptr<const Prediction> prediction() const noexcept;
  /// Validity checks of what is followed so far: one for each map and each trajectory, since the
  /// same motion in the same map is not checked twice.
  [[nodiscard]] std::int64_t checks() const noexcept;

  /// How often a first guess was tried, and how often it led to the trajectory taken.
  struct GuessCount {
    std::string guess;
    std::int64_t tried = 0;
    std::int64_t led = 0;
  };
  /// In the order of the escalation.
  [[nodiscard]] const std::vector<GuessCount>& guess_counts() const noexcept;

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace sidestep
