#pragma once

#include <array>
#include <optional>
#include <span>
#include <string>
#include <variant>
#include <vector>

#include <sidestep/core/time.hpp>
#include <sidestep/runtime/replanner.hpp>

#include "plan_search.hpp"
#include "reach_check.hpp"

namespace sidestep {

struct Replanner::Impl {
  using Event = ReplannerEvent;
  using Reason = ReplannerEvent::Reason;

  // Its phases. A halt leads from any of them to Braking or Resting, a plan to Driving.

  /// A motion that the executor was given.
  struct Motion {
    Trajectory trajectory;
    Stamp start;

    /// The motion's time at a stamp.
    [[nodiscard]] double time_s(Stamp stamp) const { return stamp.seconds() - start.seconds(); }
  };
  /// No motion is followed. The robot may still move, where the executor stops it by itself.
  struct Resting {
    std::optional<Eigen::VectorXd> at;  ///< Where the last motion ended.
  };
  struct Blocked {
    double begin_s = 0.0;  ///< Time of the motion; no earlier violation is known.
    std::string cause;
    /// Until then a stop is known to be in time: it need not be asked again before.
    std::optional<Stamp> may_wait_until;
  };
  /// A plan is followed.
  struct Driving : Motion {
    std::shared_ptr<const DistanceField> planned_in;
    bool is_checked = false;  ///< In `field`.
    /// It keeps all limits and is clear of itself: maps do not change that.
    bool is_sound = false;
    std::optional<Blocked> blocked;
    std::optional<detail::Contingency> contingency;  ///< The last that was found.
    bool is_unreached =
        false;              ///< Nothing that moves in the newest map could reach the robot on it.
    double delay_s = 0.0;   ///< For which it waits, or goes more slowly, among what is predicted.
    bool is_aside = false;  ///< It leads out of somebody's way, not to the goal.
    bool is_unfinished = false;  ///< It is Impl::unfinished itself, at the same times.
  };
  /// A stop is followed.
  struct Braking : Motion {};
  /// The robot is at rest at its goal. The motion is the one that led there.
  struct AtGoal : Motion {};

  Impl(Parts given, ReplannerSettings chosen)
      : parts(std::move(given)),
        settings(std::move(chosen)),
        search(parts, settings),
        reach(parts.robot, parts.limits, settings),
        checks_of_robot(parts.robot),
        prediction_check(parts.robot, settings.prediction_margin_m),
        margin_m(settings.margin_m) {
    parts.space.counts_fixed = false;
  }

  // The state machine: replanner.cpp.
  Status advance();
  [[nodiscard]] Status status() const;
  void supervise();
  void on_blocked(Driving& driving);
  /// Brakes where what moves could reach the robot before it is at rest.
  [[nodiscard]] bool slows_down(Driving& driving);
  void improve(const Driving& driving);
  /// Whether the straight way would be much sooner at the goal, and none was looked for lately.
  [[nodiscard]] bool goes_round_about(const Driving& driving) const;
  /// Sets out sooner, or goes faster or straighter, where what was in the way is gone: if that
  /// gains `by_s`.
  void hasten(const Driving& driving, double by_s);
  void depart_from_rest(const RobotState& measured);
  [[nodiscard]] detail::Departure departure_from(const Motion& motion) const;
  /// From where a stop ends.
  [[nodiscard]] detail::Departure departure_from_end(const Braking& stop) const;
  void find_unfinished(detail::Departure& departure) const;
  /// Searches and, where there is a plan, has it followed. False where what is followed goes on, or
  /// the robot has been stopped.
  bool replan(detail::Departure departure, Reason reason, const std::string& cause,
              std::optional<double> to_beat = {}, std::optional<double> to_end_before_s = {});
  bool follow(const detail::SearchResult& found, Reason reason, const std::string& cause);
  /// Takes another configuration that does what is asked of the goal where this one is blocked.
  void look_for_other_goal();
  [[nodiscard]] bool is_due() const;

  // Out of people's way: replanner_aside.cpp.
  /// Where the robot is to stand, at the end of the lead, in a predicted way, moves out of that.
  [[nodiscard]] bool step_aside(const detail::Departure& departure);
  /// Such a motion, if it is time for it: the shortest that is clear, or one that is so for
  /// longest.
  [[nodiscard]] std::optional<detail::FoundPlan> find_aside(
      const detail::Departure& departure, const PredictionOnClock& predicted,
      const PredictedConflict& standing) const;
  /// Along a straight line, to rest; nothing where that leads beyond the joints' limits.
  [[nodiscard]] std::optional<Trajectory> base_motion(std::span<const double> q,
                                                      const std::array<int, 2>& base,
                                                      double distance_m,
                                                      const Eigen::Vector2d& direction) const;
  /// Goes on to the goal as soon as that can be.
  void come_back(const Driving& driving);

  // What it sees: replanner_map.cpp.
  [[nodiscard]] std::optional<RobotState> measure();
  [[nodiscard]] bool reaches_goal(const RobotState& measured) const;
  [[nodiscard]] bool is_at_rest(const RobotState& measured) const;
  [[nodiscard]] bool keeps_to_plan(const RobotState& measured);
  void end_motion(const RobotState& measured);
  /// Takes the first state for the start, around which links on the floor may be in unseen space.
  void keep_to_observed(const RobotState& measured);
  /// In which a stop from full speed, decided on two periods from now, ends with its reserve.
  [[nodiscard]] double stopping_time_s() const;
  /// Pins the newest map; false where there is none that can be planned in.
  [[nodiscard]] bool look_at_map();
  /// What the predictor says of the tracks of a map; fails where those make no sense.
  [[nodiscard]] Result<Prediction> look_ahead(const Tracks& tracks, const DistanceField& map);
  /// The prediction on the clock of a motion that begins at a stamp.
  [[nodiscard]] std::optional<PredictionOnClock> predicted_from(Stamp begin) const;
  /// A cause, and after it what whoever maps has to say.
  [[nodiscard]] std::string with_map_trouble(const std::string& cause) const;
  void use_margin(double kept_m);
  /// Uses the largest of a few shares of the margin that a robot standing there keeps, or has it
  /// leave what it stands in.
  void use_margin_at(const Eigen::VectorXd& q);
  [[nodiscard]] std::shared_ptr<const Leaving> leaving_from(const Eigen::VectorXd& q) const;
  [[nodiscard]] std::shared_ptr<const Leaving> still_leaving(const Leaving& leaving) const;
  void check(Driving& driving);
  [[nodiscard]] Violation first_violation_after(const Violation& unproven,
                                                const Trajectory& trajectory) const;
  [[nodiscard]] std::string describe(const Violation& violation, const Motion& motion) const;
  [[nodiscard]] std::string describe(const PredictedConflict& conflict, const Motion& motion) const;

  // Stops: replanner_stop.cpp.
  /// Brings the robot to rest, and notes why, once a reason. `by_executor`: no trajectory of ours
  /// would be followed.
  void halt(Reason reason, std::string cause, bool by_executor = false);
  [[nodiscard]] std::string stop_motion(bool by_executor);
  [[nodiscard]] bool follow_verified_stop(Driving& driving, std::string& how);
  [[nodiscard]] std::string stop_by_executor();
  [[nodiscard]] bool must_stop_now(const Driving& driving) const;

  /// Whether what is found in this step can still take over.
  [[nodiscard]] bool is_in_time() const;
  /// Whether so much time has passed in this step that what was measured in it says nothing now.
  [[nodiscard]] bool is_overdue() const;
  /// Now, with what this step has taken where that counts.
  [[nodiscard]] Stamp present() const;
  /// The motion that is followed, or led to the goal; null where there is none.
  [[nodiscard]] const Motion* motion() const;
  Event& tell(Event::Kind kind, Reason reason, std::string cause);

  Parts parts;
  ReplannerSettings settings;
  detail::PlanSearch search;
  detail::ReachCheck reach;
  FieldChecks checks_of_robot;
  PredictionCheck prediction_check;

  Stamp now;
  Stopwatch watch;         ///< Since the step's begin.
  std::string overdue_by;  ///< Whom to name where the step takes too long.
  std::vector<Event>* events = nullptr;
  std::optional<Stamp> first_step;
  std::optional<Stamp> last_step;
  std::optional<Stamp> last_replan;
  std::shared_ptr<const DistanceField> searched_in;  ///< The map of the last replan.
  std::optional<Stamp> failed_at;                    ///< The last replan that failed.
  std::optional<Stamp> asked_for_goal;               ///< When another goal was last looked for.
  std::optional<Stamp> looked_around;                ///< When a straighter way was.

  std::variant<Resting, Driving, Braking, AtGoal> phase;
  Stamp last_start;       ///< Of the motion that was given last.
  Trajectory unfinished;  ///< The last way that was found to the goal, which stops interrupt.
  /// The last motion that a search turned down since then; null where none did.
  std::shared_ptr<const Trajectory> refused;
  std::optional<double> refused_free_s;  ///< Until when it was free of obstacles, if not all.
  bool is_moving = false;                ///< As measured.
  Stamp measured_at;
  std::optional<Eigen::VectorXd> free_goal;  ///< The end of a plan whose goal costs decide.

  struct Halt {
    Reason reason;
    std::string cause;
  };
  std::optional<Halt> halted;        ///< Why the robot brakes or rests; none before the first plan.
  std::optional<Stamp> failed_stop;  ///< When the executor's own stop failed: to be tried again.

  std::shared_ptr<const DistanceField> field;     ///< The newest one that was good.
  std::shared_ptr<const Prediction> prediction;   ///< With the field; null without a predictor.
  std::optional<Stamp> told_of_predictor;         ///< When the log last was.
  RobotState measured_state;                      ///< The newest.
  Stamp map_came;                                 ///< The step in which it did.
  std::unique_ptr<ValidityCheck> full_check;      ///< In `field`, with `margin_m`.
  std::unique_ptr<ValidityCheck> obstacle_check;  ///< The same, of obstacles alone.
  double margin_m;  ///< The settings', or what a robot that leaves an obstacle can keep.
  std::optional<Stamp> failing_told;  ///< When it was told last that replans from rest fail.
  std::int64_t checks = 0;
};

}  // namespace sidestep
