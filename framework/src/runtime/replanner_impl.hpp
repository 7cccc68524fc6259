#pragma once

#include <optional>
#include <string>
#include <vector>

#include <sidestep/core/time.hpp>
#include <sidestep/runtime/replanner.hpp>

#include "plan_search.hpp"
#include "reach_check.hpp"

namespace sidestep {

struct Replanner::Impl {
  using Event = ReplannerEvent;
  using Reason = ReplannerEvent::Reason;

  Impl(Parts given, ReplannerSettings chosen)
      : parts(std::move(given)),
        settings(std::move(chosen)),
        search(parts, settings),
        reach(parts.robot, parts.limits, settings.obstacle_speed_mps, settings.margin_m),
        checks_of_robot(parts.robot),
        margin_m(settings.margin_m) {}

  // The state machine: replanner.cpp.
  Status advance();
  [[nodiscard]] Status status() const;
  void supervise();
  void on_blocked();
  /// Brakes where what moves could reach the robot before it is at rest.
  [[nodiscard]] bool slows_down();
  void improve();
  void depart_from_rest(const RobotState& measured);
  [[nodiscard]] detail::Departure departure_of_followed() const;
  void find_unfinished(detail::Departure& departure) const;
  /// Searches and, where there is a plan, has it followed. False where what is followed goes on, or
  /// the robot has been stopped.
  bool replan(detail::Departure departure, Reason reason, const std::string& cause,
              std::optional<double> to_beat = {});
  bool follow(const detail::SearchResult& found, Reason reason, const std::string& cause);
  void set_followed(Trajectory motion, Stamp start);
  [[nodiscard]] bool is_due() const;

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
  /// A cause, and after it what whoever maps has to say.
  [[nodiscard]] std::string with_map_trouble(std::string cause) const;
  void use_margin(double kept_m);
  /// The largest of a few shares of the margin that a robot standing there keeps.
  [[nodiscard]] double margin_at(const Eigen::VectorXd& q) const;
  void check_followed();
  [[nodiscard]] Violation plainer(const Violation& unproven) const;
  [[nodiscard]] std::string describe(const Violation& violation) const;

  // Stops: replanner_stop.cpp.
  /// Brings the robot to rest, and notes why, once a reason. `by_executor`: no trajectory of ours
  /// would be followed.
  void halt(Reason reason, std::string cause, bool by_executor = false);
  [[nodiscard]] std::string stop_motion(bool by_executor);
  [[nodiscard]] bool follow_verified_stop(std::string& how);
  [[nodiscard]] std::string stop_by_executor();
  [[nodiscard]] bool must_stop_now();

  /// Whether so much time has passed in this step that what was measured in it says nothing now.
  [[nodiscard]] bool is_overdue() const;
  /// Now, with what this step has taken where that counts.
  [[nodiscard]] Stamp present() const;
  /// Of a time on the clock of what is followed.
  [[nodiscard]] double followed_s(Stamp stamp) const {
    return stamp.seconds() - followed_start.seconds();
  }
  Event& tell(Event::Kind kind, Reason reason, std::string cause);

  Parts parts;
  ReplannerSettings settings;
  detail::PlanSearch search;
  detail::ReachCheck reach;
  FieldChecks checks_of_robot;

  Stamp now;
  Stopwatch watch;         ///< Since the step's begin.
  std::string overdue_by;  ///< Whom to name where the step takes too long.
  std::vector<Event>* events = nullptr;
  std::optional<Stamp> first_step;
  std::optional<Stamp> last_step;
  std::optional<Stamp> last_replan;
  std::shared_ptr<const DistanceField> searched_in;  ///< The map of the last replan.
  std::optional<Stamp> failed_at;                    ///< The last replan that failed.

  Trajectory followed;  ///< Empty where nothing is.
  Stamp followed_start;
  std::optional<detail::Contingency>
      contingency;            ///< The last that was found, of what is followed.
  bool is_unreached = false;  ///< Nothing that moves in the newest map could reach the robot on it.
  Trajectory unfinished;      ///< The last one that was to lead to the goal, which stops interrupt.
  bool is_braking = false;    ///< What is followed is a stop.
  bool is_at_goal = false;
  bool is_moving = false;  ///< As measured.
  Stamp measured_at;
  std::optional<Eigen::VectorXd> rested_at;  ///< Where the last motion that was followed ended.
  std::optional<Eigen::VectorXd> free_goal;  ///< The end of a plan whose goal costs decide.

  struct Halt {
    Reason reason;
    std::string cause;
  };
  std::optional<Halt> halted;
  bool stop_failed = false;  ///< The executor's own: to be tried again.
  std::optional<Stamp> stop_tried;

  std::shared_ptr<const DistanceField> field;       ///< The newest one that was good.
  Stamp map_came;                                   ///< The step in which it did.
  std::shared_ptr<const DistanceField> planned_in;  ///< The one of what is followed.
  std::unique_ptr<ValidityCheck> check;             ///< In `field`, with `margin_m`.
  std::unique_ptr<ValidityCheck> obstacle_check;    ///< The same, of obstacles alone.
  double margin_m;          ///< The settings', or what a robot that leaves an obstacle can keep.
  bool is_checked = false;  ///< What is followed, in `field`.
  /// What is followed keeps all limits and is clear of itself: maps do not change that.
  bool is_sound = false;
  bool is_failing = false;  ///< The last replan from rest failed, and has been told of.
  struct Blocked {
    double begin_s = 0.0;  ///< On the clock of what is followed; no earlier violation is known.
    std::string cause;
    /// Until then a stop is known to be in time: it need not be asked again before.
    std::optional<Stamp> may_wait_until;
  };
  std::optional<Blocked> blocked;
  std::int64_t checks = 0;
};

}  // namespace sidestep
