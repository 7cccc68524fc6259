#include "waypoint_solution.hpp"

#include <cmath>
#include <utility>
#include <vector>

#include <sidestep/planning/goal.hpp>

#include "waypoint_terms.hpp"

namespace sidestep {
namespace {

/// Takes over the costs of all terms; false, with the reason, if one is not a finite number.
bool account(std::vector<TermCost> terms, Solution& solution) {
  solution.terms = std::move(terms);
  solution.cost = 0.0;
  for (const TermCost& term : solution.terms) {
    solution.cost += term.cost;
    if (std::isfinite(term.cost) && std::isfinite(solution.cost)) continue;
    solution.status = SolveStatus::kFailed;
    solution.reason = "the cost of " + term.name + " is not a finite number";
    return false;
  }
  return true;
}

}  // namespace

Result<void> check_waypoint_problem(const Problem& problem, const Trajectory& initial) {
  SIDESTEP_TRY(problem.validate());
  return check_initial(problem, initial);
}

std::string why_not_between_ends(const Problem& problem, const std::string& optimiser) {
  if (!is_goal_free(problem)) return {};
  return "the goal configuration is left to costs (" + goal_cost_names(problem) + "), and " +
         optimiser +
         " moves the waypoints between two fixed ends: give a goal configuration, or use gp_chain";
}

Solution without_trajectory(SolveStatus status, std::string reason) {
  Solution solution;
  solution.status = status;
  solution.reason = std::move(reason);
  return solution;
}

Solution begin_solution(const Problem& problem, const WaypointStates& initial) {
  Solution solution;
  solution.status = SolveStatus::kConverged;
  account(term_costs(problem, initial), solution);
  solution.initial_cost = solution.cost;
  return solution;
}

void end_solution(const Problem& problem, WaypointStates& states, const Waypoints& initial,
                  const Waypoints& found, const WaypointSearch& search, int max_iterations,
                  const Deadline& deadline, Solution& solution) {
  solution.status = search.status;
  solution.iterations = search.iterations;
  solution.accepted_iterations = search.accepted;
  std::vector<TermCost> of_initial = std::move(solution.terms);
  states.update(found);
  if (!account(term_costs(problem, states), solution)) return;
  if (search.status == SolveStatus::kDeadline) {
    solution.reason =
        (deadline.stop_requested() ? "stopped on request after " : "the deadline passed after ") +
        std::to_string(search.iterations) + " iterations";
    if (solution.cost > solution.initial_cost) {
      states.update(initial);
      account(std::move(of_initial), solution);
    }
  } else if (search.status == SolveStatus::kIterationLimit) {
    solution.reason =
        iteration_limit_reason(max_iterations, search.last_decrease, search.objective);
  }
  solution.trajectory = states.trajectory();
}

}  // namespace sidestep
