#include "gp_chain.hpp"

#include <cmath>
#include <cstdio>
#include <string>
#include <utility>

#include "minimise.hpp"

namespace sidestep {
namespace {

Result<void> check_initial(const Problem& problem, const Trajectory& initial) {
  if (auto valid = initial.validate(); !valid) return valid;
  const int dof = problem.robot->description().dof();
  if (initial.dof == dof && initial.size() == problem.support_states) return {};
  return fail(ErrorCode::kInvalidArgument,
              "the initial trajectory has " + std::to_string(initial.size()) + " states of " +
                  std::to_string(initial.dof) + " joints, but the problem " +
                  std::to_string(problem.support_states) + " of " + std::to_string(dof));
}

std::vector<TermCost> term_costs(const Problem& problem, const ChainEvaluation& evaluation) {
  std::vector<TermCost> costs{{"gp_prior", evaluation.terms[0]}};
  for (std::size_t t = 0; t < problem.terms.size(); ++t) {
    costs.push_back({std::string(problem.terms[t].cost->name()), evaluation.terms[t + 1]});
  }
  return costs;
}

Trajectory trajectory_of(const Problem& problem, const ChainEvaluation& evaluation) {
  const int dof = problem.robot->description().dof();
  Trajectory out = make_trajectory(dof, problem.support_states, problem.dt_s);
  const double* x = evaluation.support.data();
  for (int i = 0; i < out.size(); ++i, x += 2 * dof) {
    std::copy_n(x, dof, out.q(i).begin());
    std::copy_n(x + dof, dof, out.qdot(i).begin());
  }
  return out;
}

std::string percent(double share) {
  char buffer[32];
  std::snprintf(buffer, sizeof buffer, "%.2g %%", 100.0 * share);
  return buffer;
}

class GpChain final : public Optimiser {
 public:
  explicit GpChain(const GpChainSettings& settings)
      : stop_{settings.relative_tolerance, settings.absolute_tolerance, settings.max_iterations},
        rule_(make_step_rule(settings)) {}

  [[nodiscard]] Result<Solution> solve(const Problem& problem, const Trajectory& initial,
                                       const Deadline& deadline) override {
    const Stopwatch watch;
    if (auto valid = problem.validate(); !valid) return tl::make_unexpected(valid.error());
    if (auto valid = check_initial(problem, initial); !valid) {
      return tl::make_unexpected(valid.error());
    }
    model_.reset(problem, initial);
    Solution solution;
    solution.initial_cost = model_.current().cost;
    if (std::isfinite(solution.initial_cost)) {
      conclude(minimise(model_, *rule_, stop_, deadline), deadline, solution);
    }
    solution.terms = term_costs(problem, model_.current());
    solution.cost = model_.current().cost;
    if (!std::isfinite(solution.initial_cost)) name_broken_term(solution);
    if (solution.status != SolveStatus::kFailed) {
      solution.trajectory = trajectory_of(problem, model_.current());
    }
    solution.solve_ms = watch.elapsed_ms();
    return solution;
  }

 private:
  void conclude(const Minimisation& end, const Deadline& deadline, Solution& solution) const {
    solution.iterations = end.tried;
    solution.accepted_iterations = end.accepted;
    switch (end.end) {
      case Minimisation::End::kConverged: solution.status = SolveStatus::kConverged; break;
      case Minimisation::End::kIterationLimit: {
        solution.status = SolveStatus::kIterationLimit;
        const double before = model_.current().cost + end.last_decrease;
        solution.reason = "stopped after " + std::to_string(stop_.max_iterations) +
                          " iterations, when the last one still lowered the cost by " +
                          percent(end.last_decrease / before);
        break;
      }
      case Minimisation::End::kDeadline:
        solution.status = SolveStatus::kDeadline;
        solution.reason = (deadline.stop_requested() ? "stopped on request after "
                                                     : "the deadline passed after ") +
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

  static void name_broken_term(Solution& solution) {
    solution.status = SolveStatus::kFailed;
    solution.reason = "the cost of the initial trajectory is not a finite number";
    for (const TermCost& term : solution.terms) {
      if (std::isfinite(term.cost)) continue;
      solution.reason = "the cost of " + term.name + " is not a finite number";
      return;
    }
  }

  StoppingRules stop_;
  std::unique_ptr<StepRule> rule_;
  ChainModel model_;
};

}  // namespace

std::unique_ptr<StepRule> make_step_rule(const GpChainSettings& settings) {
  if (settings.method == "gauss_newton") return make_gauss_newton();
  if (settings.method == "dogleg") return make_dogleg(settings.initial_radius);
  return make_levenberg_marquardt(settings.initial_damping, settings.relative_tolerance);
}

std::unique_ptr<Optimiser> make_gp_chain(const GpChainSettings& settings) {
  return std::make_unique<GpChain>(settings);
}

}  // namespace sidestep
