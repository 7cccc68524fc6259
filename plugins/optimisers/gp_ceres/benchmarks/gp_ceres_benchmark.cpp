// The HSR drives around a table and reaches over it: the plan of 8 joints that Sidestep is for.
#include <algorithm>

#include <benchmark/benchmark.h>

#include <sidestep/planning/costs.hpp>

#include "factors.hpp"
#include "gp_ceres.hpp"
#include "support/hsr_table.hpp"

namespace sidestep {
namespace {

using testing_support::hsr_reaches_table;

Trajectory line_of(const Problem& problem) {
  return straight_line(problem.start, problem.goal, problem.support_states, problem.dt_s);
}

void solve_hsr(benchmark::State& state) {
  const Problem problem =
      hsr_reaches_table(static_cast<int>(state.range(0)), static_cast<int>(state.range(1)));
  const Trajectory initial = line_of(problem);
  const auto optimiser = make_gp_ceres({.relative_tolerance = state.range(2) ? 1e-2 : 1e-5});
  Solution solution;
  for (auto _ : state) {
    auto result = optimiser->solve(problem, initial, Deadline());
    if (!result || result->status == SolveStatus::kFailed) state.SkipWithError("no solution");
    solution = std::move(*result);
  }
  state.counters["iterations"] = solution.iterations;
  state.counters["cost"] = solution.cost;
  state.counters["ms_per_iteration"] = solution.solve_ms / std::max(1, solution.iterations);
}
BENCHMARK(solve_hsr)
    ->ArgNames({"states", "checks", "replan"})
    ->ArgsProduct({{20, 40}, {0, 4}, {0, 1}})
    ->Unit(benchmark::kMillisecond);

/// One evaluation of all costs with Jacobians at all states.
void evaluate_hsr(benchmark::State& state) {
  const Problem problem = hsr_reaches_table(static_cast<int>(state.range(0)), 4);
  const GpPrior prior(problem.qc, problem.dt_s);
  StateRows rows(problem, prior);
  const Trajectory initial = line_of(problem);
  std::vector<double> support;
  for (int i = 0; i < initial.size(); ++i) {
    support.insert(support.end(), initial.q(i).begin(), initial.q(i).end());
    support.insert(support.end(), initial.qdot(i).begin(), initial.qdot(i).end());
  }
  for (auto _ : state) {
    rows.update(support);
    benchmark::DoNotOptimize(rows.rows(0).data());
  }
  state.SetItemsProcessed(state.iterations() * rows.state_count());
}
BENCHMARK(evaluate_hsr)->ArgName("states")->Arg(20)->Arg(40)->Unit(benchmark::kMicrosecond);

/// One term alone, at the states of the straight line.
void evaluate_term(benchmark::State& state) {
  Problem problem = hsr_reaches_table(40, 4);
  const CostTerm& term = problem.terms[static_cast<std::size_t>(state.range(0))];
  const auto dof = static_cast<std::size_t>(problem.robot->description().dof());
  const Trajectory initial = line_of(problem);
  std::vector<double> times_s(196), q(196 * dof), qdot(196 * dof);
  for (std::size_t i = 0; i < times_s.size(); ++i) {
    times_s[i] = 0.2 * problem.dt_s * static_cast<double>(i);
    initial.sample(times_s[i], std::span(q).subspan(i * dof, dof),
                   std::span(qdot).subspan(i * dof, dof));
  }
  const std::size_t rows = times_s.size() * static_cast<std::size_t>(term.cost->residual_count());
  std::vector<double> residuals(rows), by_q(rows * dof), by_qdot(rows * dof);
  const bool jacobians = state.range(1) != 0;
  Scratch scratch;
  for (auto _ : state) {
    term.cost->evaluate({196, static_cast<int>(dof), q, qdot, times_s},
                        {residuals, jacobians ? std::span<double>(by_q) : std::span<double>(),
                         jacobians ? std::span<double>(by_qdot) : std::span<double>()},
                        scratch);
    benchmark::DoNotOptimize(residuals.data());
  }
  state.SetLabel(std::string(term.cost->name()));
  state.SetItemsProcessed(state.iterations() * 196);
}
BENCHMARK(evaluate_term)
    ->ArgNames({"term", "jacobians"})
    ->ArgsProduct({{2, 3, 4, 5}, {0, 1}})
    ->Unit(benchmark::kMicrosecond);

}  // namespace
}  // namespace sidestep
