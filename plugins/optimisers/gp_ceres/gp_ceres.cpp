#include "gp_ceres.hpp"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include <ceres/evaluation_callback.h>
#include <ceres/iteration_callback.h>
#include <ceres/problem.h>
#include <ceres/solver.h>
#include <glog/logging.h>

#include "factors.hpp"

namespace sidestep {
namespace {

/// Stops the iteration by GPMP2's rules, which look at accepted steps, and at the deadline.
class StoppingRule final : public ceres::IterationCallback {
 public:
  StoppingRule(const GpCeresSettings& settings, const Deadline& deadline)
      : settings_(settings), deadline_(deadline) {}

  ceres::CallbackReturnType operator()(const ceres::IterationSummary& iteration) override {
    if (iteration.iteration > 0 && iteration.step_is_successful) {
      last_decrease_ = iteration.cost_change;
      const double before = iteration.cost + iteration.cost_change;
      if (iteration.cost_change <= settings_.absolute_tolerance ||
          iteration.cost_change <= settings_.relative_tolerance * before) {
        return ceres::SOLVER_TERMINATE_SUCCESSFULLY;
      }
    }
    if (!deadline_.expired()) return ceres::SOLVER_CONTINUE;
    deadline_passed_ = true;
    return ceres::SOLVER_TERMINATE_SUCCESSFULLY;
  }

  [[nodiscard]] bool deadline_passed() const noexcept { return deadline_passed_; }
  [[nodiscard]] double last_decrease() const noexcept { return last_decrease_; }

 private:
  const GpCeresSettings& settings_;
  const Deadline& deadline_;
  double last_decrease_ = 0.0;
  bool deadline_passed_ = false;
};

/// Before each evaluation, Ceres has written the point into `support`: all costs of all states
/// are computed here in one batch, and the factors only copy them out.
class BatchEvaluation final : public ceres::EvaluationCallback {
 public:
  BatchEvaluation(StateRows& rows, std::span<const double> support)
      : rows_(rows), support_(support) {}

  void PrepareForEvaluation(bool, bool new_evaluation_point) override {
    // Jacobians come along at once: most steps are accepted, and Ceres then asks for them at the
    // same point.
    if (new_evaluation_point) rows_.update(support_);
  }

 private:
  StateRows& rows_;
  std::span<const double> support_;
};

/// The rows of one support state.
class SupportFactor final : public ceres::CostFunction {
 public:
  SupportFactor(const StateRows& rows, int state) : rows_(rows), state_(state) {
    set_num_residuals(rows.row_count(state));
    mutable_parameter_block_sizes()->assign(1, 2 * rows.dof());
  }

  bool Evaluate(double const* const*, double* residuals, double** jacobians) const override {
    const int width = 2 * rows_.dof() + 1;
    const double* row = rows_.rows(state_).data();
    for (int i = 0; i < num_residuals(); ++i, row += width) {
      residuals[i] = row[width - 1];
      if (jacobians != nullptr && jacobians[0] != nullptr) {
        std::copy_n(row, width - 1, jacobians[0] + i * (width - 1));
      }
    }
    return true;
  }

 private:
  const StateRows& rows_;
  int state_;
};

/// The chain as Ceres sees it: one parameter block per support state, [q; qdot].
class ChainProblem {
 public:
  ChainProblem(const Problem& problem, const Trajectory& initial)
      : problem_(problem),
        prior_(problem.qc, problem.dt_s),
        rows_(problem, prior_),
        support_(2 * initial.positions.size()),
        evaluation_(rows_, support_),
        ceres_(options()) {
    const std::size_t d = static_cast<std::size_t>(initial.dof);
    for (int i = 0; i < initial.size(); ++i) {
      std::ranges::copy(initial.q(i), state(i));
      std::ranges::copy(initial.qdot(i), state(i) + d);
    }
    add_factors();
    hold_free_ends();
  }

  void solve(const ceres::Solver::Options& options, ceres::Solver::Summary& summary) {
    ceres::Solve(options, &ceres_, &summary);
  }

  [[nodiscard]] Trajectory trajectory() const {
    Trajectory out = make_trajectory(prior_.dof(), problem_.support_states, problem_.dt_s);
    const std::size_t d = static_cast<std::size_t>(prior_.dof());
    for (std::size_t i = 0; i < out.times_s.size(); ++i) {
      const auto x = std::span(support_).subspan(2 * d * i, 2 * d);
      std::ranges::copy(x.first(d), out.q(static_cast<int>(i)).begin());
      std::ranges::copy(x.last(d), out.qdot(static_cast<int>(i)).begin());
    }
    return out;
  }

  /// The cost of each term at the current states, the GP prior first.
  [[nodiscard]] std::vector<TermCost> term_costs() {
    rows_.update(support_);
    std::vector<TermCost> costs{{"gp_prior", prior_cost()}};
    for (std::size_t t = 0; t < problem_.terms.size(); ++t) {
      costs.push_back({std::string(problem_.terms[t].cost->name()), rows_.term_cost(t)});
    }
    return costs;
  }

 private:
  ceres::Problem::Options options() {
    ceres::Problem::Options options;
    options.evaluation_callback = &evaluation_;
    options.disable_all_safety_checks = true;
    return options;
  }

  [[nodiscard]] double* state(int i) { return support_.data() + i * 2 * prior_.dof(); }

  void add_factors() {
    const int step = rows_.checks() + 1;
    for (int i = 0; i < problem_.support_states; ++i) {
      ceres_.AddParameterBlock(state(i), 2 * prior_.dof());
    }
    for (int i = 0; i < problem_.support_states; ++i) {
      add(std::make_unique<SupportFactor>(rows_, i * step), {state(i)});
      if (i + 1 == problem_.support_states) break;
      add(std::make_unique<GpPriorFactor>(prior_), {state(i), state(i + 1)});
      add(std::make_unique<IntervalFactor>(rows_, i * step + 1), {state(i), state(i + 1)});
    }
  }

  void add(std::unique_ptr<ceres::CostFunction> factor, const std::vector<double*>& states) {
    if (factor->num_residuals() == 0) return;
    ceres_.AddResidualBlock(factor.release(), nullptr, states);
  }

  /// An end that no term holds is held fixed.
  void hold_free_ends() {
    const auto held = [&](Placement placement) {
      return std::ranges::any_of(problem_.terms, [placement](const CostTerm& term) {
        return term.placement == placement;
      });
    };
    const bool fix_start = !held(Placement::kStart);
    const bool fix_goal = !held(Placement::kGoal);
    if (fix_start) fix(0, problem_.start);
    if (fix_goal) fix(problem_.support_states - 1, problem_.goal);
    // Ceres evaluates the factors of fixed states once, before it calls BatchEvaluation.
    if (fix_start || fix_goal) rows_.update(support_);
  }

  void fix(int i, const RobotState& at) {
    std::copy_n(at.q.data(), at.q.size(), state(i));
    std::copy_n(at.qdot.data(), at.qdot.size(), state(i) + prior_.dof());
    ceres_.SetParameterBlockConstant(state(i));
  }

  [[nodiscard]] double prior_cost() {
    const GpPriorFactor factor(prior_);
    std::vector<double> residuals(static_cast<std::size_t>(factor.num_residuals()));
    double sum = 0.0;
    for (int i = 0; i + 1 < problem_.support_states; ++i) {
      const double* const ends[] = {state(i), state(i + 1)};
      factor.Evaluate(ends, residuals.data(), nullptr);
      for (const double residual : residuals) sum += residual * residual;
    }
    return 0.5 * sum;
  }

  const Problem& problem_;
  GpPrior prior_;
  StateRows rows_;
  std::vector<double> support_;
  BatchEvaluation evaluation_;
  ceres::Problem ceres_;
};

ceres::Solver::Options solver_options(const GpCeresSettings& settings, StoppingRule& rule) {
  ceres::Solver::Options options;
  options.trust_region_strategy_type = ceres::LEVENBERG_MARQUARDT;
  // Chains of 20 to 40 states of 16: SuiteSparse, CXSparse and Eigen take the same time, the
  // Schur solvers 1.3 to 1.5 times as long, a dense Cholesky 20 to 60 times (solve_hsr).
  options.linear_solver_type = ceres::SPARSE_NORMAL_CHOLESKY;
  options.initial_trust_region_radius = 1.0 / settings.initial_damping;
  options.min_trust_region_radius = 1e-10;
  // Ceres damps with clamp(diag(J^T J), min, max) / radius: this makes it lambda I.
  options.min_lm_diagonal = 1.0;
  options.max_lm_diagonal = 1.0;
  options.jacobi_scaling = false;
  options.max_num_iterations = settings.max_iterations;
  options.function_tolerance = 0.0;  // StoppingRule decides, after accepting the step
  options.gradient_tolerance = 1e-10;
  options.parameter_tolerance = 1e-10;
  options.logging_type = ceres::SILENT;
  options.callbacks.push_back(&rule);
  return options;
}

/// Why a solve failed, from where its numbers went wrong.
std::string failure(const std::vector<TermCost>& terms, const std::string& message) {
  for (const TermCost& term : terms) {
    if (!std::isfinite(term.cost)) return "the cost of " + term.name + " is not a finite number";
  }
  return "Ceres: " + message;
}

class GpCeres final : public Optimiser {
 public:
  explicit GpCeres(const GpCeresSettings& settings) : settings_(settings) {}

  [[nodiscard]] Result<Solution> solve(const Problem& problem, const Trajectory& initial,
                                       const Deadline& deadline) override {
    const Stopwatch watch;
    SIDESTEP_TRY(problem.validate());
    SIDESTEP_TRY(check_initial(problem, initial));
    ChainProblem chain(problem, initial);
    StoppingRule rule(settings_, deadline);
    ceres::Solver::Summary summary;
    chain.solve(solver_options(settings_, rule), summary);

    Solution solution;
    solution.terms = chain.term_costs();
    for (const TermCost& term : solution.terms) solution.cost += term.cost;
    solution.initial_cost = summary.initial_cost;
    solution.iterations = std::max(0, static_cast<int>(summary.iterations.size()) - 1);
    solution.accepted_iterations = std::max(0, summary.num_successful_steps - 1);  // less the start
    conclude(summary, rule, deadline, solution);
    if (solution.status != SolveStatus::kFailed) solution.trajectory = chain.trajectory();
    solution.solve_ms = watch.elapsed_ms();
    return solution;
  }

 private:
  void conclude(const ceres::Solver::Summary& summary, const StoppingRule& rule,
                const Deadline& deadline, Solution& solution) const {
    if (!summary.IsSolutionUsable() || !std::isfinite(solution.cost)) {
      solution.status = SolveStatus::kFailed;
      solution.reason = failure(solution.terms, summary.message);
    } else if (rule.deadline_passed()) {
      solution.status = SolveStatus::kDeadline;
      solution.reason =
          (deadline.stop_requested() ? "stopped on request after " : "the deadline passed after ") +
          std::to_string(solution.iterations) + " iterations";
    } else if (summary.termination_type == ceres::NO_CONVERGENCE) {
      solution.status = SolveStatus::kIterationLimit;
      solution.reason =
          iteration_limit_reason(settings_.max_iterations, rule.last_decrease(), solution.cost);
    } else {
      solution.status = SolveStatus::kConverged;
    }
  }

  GpCeresSettings settings_;
};

}  // namespace

std::unique_ptr<Optimiser> make_gp_ceres(const GpCeresSettings& settings) {
  // Ceres warns on stderr through glog; what matters of it is in Solution::reason.
  FLAGS_minloglevel = google::GLOG_FATAL;
  return std::make_unique<GpCeres>(settings);
}

}  // namespace sidestep
