#pragma once

#include <limits>
#include <optional>
#include <string>
#include <vector>

#include <sidestep/planning/base_ways.hpp>
#include <sidestep/planning/validity_check.hpp>
#include <sidestep/runtime/replanner.hpp>

#include "reach_check.hpp"

namespace sidestep::detail {

/// What a new trajectory takes over from.
struct Departure {
  Trajectory lead;                         ///< The motion from now to the takeover; never empty.
  const Trajectory* followed = nullptr;    ///< What the lead is the begin of; null at rest.
  double from_s = 0.0;                     ///< The takeover on its clock.
  const Trajectory* unfinished = nullptr;  ///< The way to the goal whose rest is worth a guess.
  double unfinished_from_s = 0.0;          ///< Where on it the takeover is.
  bool is_moving = false;                  ///< At the takeover.
};

struct FoundPlan {
  Trajectory trajectory;              ///< The lead and the new motion, checked as one.
  std::optional<Trajectory> at_once;  ///< The same as it was found, where it is slower now.
  bool is_rest = false;               ///< Of the departure's `unfinished`, at other speeds.
  double takeover_s = 0.0;
  double splice_velocity_jump = 0.0;
  double delay_s = 0.0;  ///< By its waits, detours and slowness among what is predicted.
  double cost = 0.0;
  double unknown_share = 0.0;
  double free_until_s =
      std::numeric_limits<double>::infinity();  ///< Of obstacles, if not for good.
  double rest_s = 0.0;      ///< Least time from where it is blocked to its end; 0 where it is free.
  bool frees_goal = false;  ///< Its end stands for the goal.
  bool is_aside = false;    ///< It leads out of somebody's way.
};

struct SearchResult {
  std::optional<FoundPlan> plan;
  std::string guess;  ///< That led to the plan.
  std::vector<std::string> tried;
  std::string failure;  ///< Why each guess failed.
  std::string fault;    ///< What a plugin did amiss; the search ended there.
  double solve_ms = 0.0;
  std::shared_ptr<const Trajectory> refused;  ///< The last motion that was turned down.
  std::optional<double> refused_free_s;       ///< Until when that is free of obstacles, if not all.
};

/// What is followed, and is not free all the way.
struct BlockedMotion {
  const Trajectory& motion;
  double begin_s;  ///< Of what blocks it, on its clock,
  double in_s;     ///< and from now on.
};

/// The least time from a motion's state at `from_s` to its end, each joint by itself, from rest.
[[nodiscard]] double least_rest_s(const Trajectory& motion, double from_s,
                                  const MotionLimits& limits);

/// Looks for a valid trajectory by one first guess after the other.
class PlanSearch {
 public:
  PlanSearch(const Replanner::Parts& parts, const ReplannerSettings& settings);

  struct Request {
    std::shared_ptr<const DistanceField> field;
    const ValidityCheck& check;  ///< In that field.
    const ReachCheck& reach;
    const PredictionCheck& prediction_check;
    std::optional<PredictionOnClock> predicted;  ///< On the clock of the new trajectory.
    Departure departure;
    Stamp now;
    /// What the new trajectory must cost less than, by the problem's terms.
    std::optional<double> to_beat;
    std::optional<double> to_end_before_s;  ///< From now on.
    /// What is not free all the way must be so for at least so long,
    double least_free_s = 0.0;
    /// and be expected at the goal before what is followed, if that is blocked, too.
    std::optional<BlockedMotion> blocked = std::nullopt;
  };
  /// Throws what the problem's poser, the robot and the field throw.
  [[nodiscard]] SearchResult run(const Request& request);

  /// The cost, in a field, of the rest of what is followed, as the problem posed at the takeover
  /// counts it; nothing where it cannot be told.
  [[nodiscard]] std::optional<double> cost_of_rest(std::shared_ptr<const DistanceField> field,
                                                   const Departure& departure) const;

  [[nodiscard]] const std::vector<Replanner::GuessCount>& counts() const noexcept {
    return counts_;
  }

 private:
  struct Task;  ///< A request on its way through the guesses.

  [[nodiscard]] std::vector<std::size_t> order(std::size_t first) const;
  void attempt(std::size_t guess, Task& task);
  [[nodiscard]] std::optional<Trajectory> first_guess(std::string_view name, Task& task);
  [[nodiscard]] bool depart(Departure departure, Task& task) const;
  [[nodiscard]] bool depart_after_stop(Task& task) const;
  [[nodiscard]] bool is_long_enough(const Task& task) const;
  [[nodiscard]] std::optional<Trajectory> solve(Optimiser& optimiser, const std::string& name,
                                                const Trajectory& guess, Task& task) const;
  [[nodiscard]] std::string why_elsewhere(const Task& task, const Trajectory& proposal) const;
  [[nodiscard]] std::optional<FoundPlan> accept(Trajectory proposal, Task& task) const;
  [[nodiscard]] std::optional<FoundPlan> timed(Trajectory proposal, Task& task) const;
  [[nodiscard]] std::optional<FoundPlan> checked(FoundPlan plan, Task& task) const;
  [[nodiscard]] const BaseWays& base_ways(Task& task) const;
  [[nodiscard]] double rest_s(const Trajectory& motion, double from_s, Task& task) const;
  [[nodiscard]] double to_arrive_before_s(Task& task) const;
  [[nodiscard]] double soonest_s(const FoundPlan& plan, const Task& task) const;
  [[nodiscard]] std::optional<Trajectory> among_predicted(const FoundPlan& plan,
                                                          const Trajectory& proposal,
                                                          const Departure& departure,
                                                          const Request& request) const;

  const Replanner::Parts& parts_;
  const ReplannerSettings& settings_;
  std::vector<Replanner::GuessCount> counts_;
  int bends_ = 0;          ///< Guesses bent so far.
  std::size_t first_ = 0;  ///< Guess of the next search: where the last one was cut short.
};

}  // namespace sidestep::detail
