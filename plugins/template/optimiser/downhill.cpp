// An optimiser: Gauss-Newton steps on all support states at once, damped until they lower the cost
// (Marquardt, 1963).

#include "downhill.hpp"

#include <cmath>
#include <string>
#include <utility>

#include <Eigen/SparseCholesky>

#include <sidestep/planning/trajectory_objective.hpp>

namespace downhill {
namespace {

using namespace sidestep;
using Expansion = TrajectoryObjective::Expansion;

double sum_of(const std::vector<TermCost>& terms) {
  double cost = 0.0;
  for (const TermCost& term : terms) cost += term.cost;
  return cost;
}

class Downhill final : public Optimiser {
 public:
  explicit Downhill(const Options& options) : options_(options) {}

  Result<Solution> solve(const Problem& problem, const Trajectory& initial,
                         const Deadline& deadline) override {
    const Stopwatch watch;
    SIDESTEP_TRY(problem.validate());
    SIDESTEP_TRY(check_initial(problem, initial));
    TrajectoryObjective objective(problem);
    Eigen::VectorXd x = objective.variables_of(initial);
    Expansion here = objective.expand(x);
    Solution solution;
    solution.initial_cost = here.cost;
    solution.status = descend(objective, deadline, x, here, solution);
    solution.cost = here.cost;
    solution.terms = std::move(here.terms);
    if (solution.status != SolveStatus::kFailed) solution.trajectory = objective.trajectory_of(x);
    solution.solve_ms = watch.elapsed_ms();
    return solution;
  }

 private:
  /// Moves x, with what is known there, and counts; all but kConverged has a reason.
  SolveStatus descend(TrajectoryObjective& objective, const Deadline& deadline, Eigen::VectorXd& x,
                      Expansion& here, Solution& solution) const {
    for (const TermCost& term : here.terms) {
      if (std::isfinite(term.cost)) continue;
      solution.reason = "the cost of " + term.name + " is not a finite number";
      return SolveStatus::kFailed;
    }
    double last_decrease = 0.0;
    for (double damping = 1e-3; damping < 1e9;) {  // beyond, no step is long enough to matter
      if (deadline.expired()) {
        solution.reason = "it had to end after " + std::to_string(solution.iterations) + " steps";
        return SolveStatus::kDeadline;
      }
      if (solution.iterations == options_.max_iterations) {
        solution.reason = iteration_limit_reason(solution.iterations, last_decrease, here.cost);
        return SolveStatus::kIterationLimit;
      }
      ++solution.iterations;
      auto damped = here.hessian;
      damped.diagonal() *= 1.0 + damping;
      const Eigen::SimplicialLDLT<Eigen::SparseMatrix<double>> factors(damped);
      const Eigen::VectorXd there = x - factors.solve(here.gradient);
      const double cost = sum_of(objective.costs(there));
      if (!(cost < here.cost)) {  // or it is not a number
        damping *= 10.0;
        continue;
      }
      ++solution.accepted_iterations;
      damping *= 0.1;
      last_decrease = here.cost - cost;
      x = there;
      here = objective.expand(x);
      if (last_decrease <= options_.relative_tolerance * (here.cost + last_decrease)) break;
    }
    return SolveStatus::kConverged;
  }

  Options options_;
};

}  // namespace

Result<std::unique_ptr<Optimiser>> create(const Options& options, const HostContext&) {
  return std::make_unique<Downhill>(options);
}

}  // namespace downhill

SIDESTEP_PLUGIN(sidestep::Optimiser, downhill::Options, downhill::create, "downhill", "0.1.0",
                "Damped Gauss-Newton steps on all states at once: an example of a plugin")
