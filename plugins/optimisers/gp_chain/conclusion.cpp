#include "conclusion.hpp"

#include <cmath>
#include <limits>
#include <string>

#include <sidestep/planning/goal.hpp>

namespace sidestep {

void conclude(const Minimisation& end, const StoppingRules& stop, double cost,
              const Deadline& deadline, Solution& solution) {
  solution.iterations = end.tried;
  solution.accepted_iterations = end.accepted;
  switch (end.end) {
    case Minimisation::End::kConverged: solution.status = SolveStatus::kConverged; break;
    case Minimisation::End::kIterationLimit:
      solution.status = SolveStatus::kIterationLimit;
      solution.reason = iteration_limit_reason(stop.max_iterations, end.last_decrease, cost);
      break;
    case Minimisation::End::kDeadline:
      solution.status = SolveStatus::kDeadline;
      solution.reason =
          (deadline.stop_requested() ? "stopped on request after " : "the deadline passed after ") +
          std::to_string(end.tried) + " iterations";
      break;
    case Minimisation::End::kSingular:
      solution.status = SolveStatus::kFailed;
      solution.reason =
          "the normal equations are singular: qc, dt_s or the weight of a term is too large or "
          "too small for double precision";
      break;
  }
}

void name_broken_term(Solution& solution) {
  solution.status = SolveStatus::kFailed;
  solution.reason = "the cost of the initial trajectory is not a finite number";
  for (const TermCost& term : solution.terms) {
    if (std::isfinite(term.cost)) continue;
    solution.reason = "the cost of " + term.name + " is not a finite number";
    return;
  }
}

std::vector<TermCost> name_terms(const Problem& problem, std::span<const double> costs) {
  std::vector<TermCost> named{{"gp_prior", costs[0]}};
  for (std::size_t t = 0; t < problem.terms.size(); ++t) {
    named.push_back({std::string(problem.terms[t].cost->name()), costs[t + 1]});
  }
  return named;
}

Judge::Judge(const Problem& problem, const FieldChecks& checks)
    : problem_(problem),
      check_(checks.make(problem.field, problem.space,
                         {.margin_m = problem.collision_margin_m,
                          .speed_fraction = std::numeric_limits<double>::infinity(),
                          .first_violation_only = true})) {}

bool Judge::accepts(const Trajectory& found, const Deadline& deadline) const {
  if (!goal_miss(problem_, found.q(found.size() - 1)).empty()) return false;
  const auto verdict = check_->check(found, 0.0, deadline);
  return verdict.has_value() && verdict->valid();
}

}  // namespace sidestep
