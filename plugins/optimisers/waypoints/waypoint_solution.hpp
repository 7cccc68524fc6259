#pragma once

#include <optional>
#include <string>
#include <utility>

#include <sidestep/core/time.hpp>
#include <sidestep/planning/optimiser.hpp>

#include "difference_metric.hpp"
#include "waypoint_states.hpp"

namespace sidestep {

/// How the iterations of an optimiser over waypoints ended, in its own objective.
struct WaypointSearch {
  SolveStatus status = SolveStatus::kConverged;
  int iterations = 0;
  int accepted = 0;
  double objective = 0.0;
  double last_decrease = 0.0;  ///< Of the objective, by the last accepted iteration.
};

/// Fails with kInvalidArgument where problem or initial trajectory make no sense.
[[nodiscard]] Result<void> check_waypoint_problem(const Problem& problem,
                                                  const Trajectory& initial);

/// Why an optimiser that moves waypoints between two fixed ends cannot solve a problem; empty if it
/// can. `optimiser`: its name.
[[nodiscard]] std::string why_not_between_ends(const Problem& problem,
                                               const std::string& optimiser);

/// A solution without a trajectory.
[[nodiscard]] Solution without_trajectory(SolveStatus status, std::string reason);

/// The solution that holds the costs of the initial waypoints; kFailed, naming the term, if one is
/// not a finite number.
[[nodiscard]] Solution begin_solution(const Problem& problem, const WaypointStates& initial);

/// Fills in what the waypoints that were found cost and how the search for them ended. One that was
/// interrupted hands out the initial ones where those cost the problem less, for an optimiser's own
/// objective need not fall together with it. `solution`: that of begin_solution().
void end_solution(const Problem& problem, WaypointStates& states, const Waypoints& initial,
                  const Waypoints& found, const WaypointSearch& search, int max_iterations,
                  const Deadline& deadline, Solution& solution);

/// Checks problem and initial trajectory, makes the metric, and has `find(metric)` look for the
/// Solution; where there can be none, says why. `optimiser`: its name. `smoothness`: an option's
/// value (derivative_of()).
template <class Find>
[[nodiscard]] Result<Solution> solve_between_ends(const Problem& problem, const Trajectory& initial,
                                                  const std::string& optimiser,
                                                  const std::string& smoothness, Find find) {
  const Stopwatch watch;
  SIDESTEP_TRY(check_waypoint_problem(problem, initial));
  if (std::string why = why_not_between_ends(problem, optimiser); !why.empty()) {
    return without_trajectory(SolveStatus::kNoPath, std::move(why));
  }
  const DifferenceMetric metric(problem, derivative_of(smoothness));
  if (!metric.is_usable()) {
    return without_trajectory(SolveStatus::kFailed, singular_metric_reason(problem));
  }
  Solution solution = find(metric);
  solution.solve_ms = watch.elapsed_ms();
  return solution;
}

inline constexpr const char* kObjectiveNotFinite =
    "the objective of the initial trajectory is not a finite number";

}  // namespace sidestep
