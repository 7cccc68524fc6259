// gp_chain beside gp_ceres, on GPMP2's recorded problems and on the HSR with all its costs.
#include <algorithm>
#include <map>

#include <benchmark/benchmark.h>

#include <sidestep/problems/recorded_problems.hpp>

#include "gp_ceres.hpp"
#include "gp_chain.hpp"
#include "minimise.hpp"
#include "support/hsr_table.hpp"

namespace sidestep {
namespace {

using namespace testing_support;

struct PosedProblem {
  Problem problem;
  Trajectory initial;
};

/// Some hundred problems of one recorded set; empty where the recordings are absent.
const std::vector<PosedProblem>& problems_of(const std::string& set) {
  static std::map<std::string, std::vector<PosedProblem>> sets;
  const auto [found, is_new] = sets.try_emplace(set);
  std::vector<PosedProblem>& problems = found->second;
  if (!is_new) return problems;
  const auto folder = std::filesystem::path(SIDESTEP_SHARED_DATA) / "gpmp2";
  const auto recorded = read_recorded_problems(folder / ("problems_" + set + ".json"));
  if (!recorded) return problems;
  for (std::size_t scene = 0; scene < recorded->scenes.size(); ++scene) {
    const auto field = recorded_field(*recorded, static_cast<int>(scene), true);
    for (std::size_t pair = scene; pair < recorded->pairs.size(); pair += 3) {
      Problem problem = recorded_problem(*recorded, field, static_cast<int>(pair));
      Trajectory initial = recorded_initial(*recorded, problem);
      problems.push_back({std::move(problem), std::move(initial)});
    }
  }
  return problems;
}

double quantile(std::vector<double>& values, double share) {
  std::ranges::sort(values);
  return values[static_cast<std::size_t>(share * static_cast<double>(values.size() - 1))];
}

std::unique_ptr<Optimiser> optimiser_of(bool chain, bool replan, int starts = 1) {
  const double relative = replan ? 1e-2 : 1e-5;
  const int iterations = replan ? 50 : 100;
  if (chain) {
    return make_gp_chain(
        {.relative_tolerance = relative, .max_iterations = iterations, .starts = starts});
  }
  return make_gp_ceres({.relative_tolerance = relative, .max_iterations = iterations});
}

/// Every problem once an iteration. solve_ms and step_us are over problems; a step is one that was
/// tried, an iteration one that was accepted, which is what GPMP2 counts.
void solve_recorded(benchmark::State& state, const char* set, bool chain, bool replan,
                    int starts = 1) {
  const auto& problems = problems_of(set);
  if (problems.empty()) {
    state.SkipWithError("no recorded problems");
    return;
  }
  const auto optimiser = optimiser_of(chain, replan, starts);
  std::vector<double> solve_ms, iteration_us, step_us;
  for (auto _ : state) {
    for (const auto& [problem, initial] : problems) {
      const auto solution = optimiser->solve(problem, initial, Deadline());
      if (!solution) continue;
      solve_ms.push_back(solution->solve_ms);
      iteration_us.push_back(1e3 * solution->solve_ms / std::max(1, solution->accepted_iterations));
      step_us.push_back(1e3 * solution->solve_ms / std::max(1, solution->iterations));
    }
  }
  state.SetItemsProcessed(state.iterations() * static_cast<std::int64_t>(problems.size()));
  state.counters["solve_ms_p50"] = quantile(solve_ms, 0.5);
  state.counters["solve_ms_p95"] = quantile(solve_ms, 0.95);
  state.counters["iteration_us_p50"] = quantile(iteration_us, 0.5);
  state.counters["step_us_p50"] = quantile(step_us, 0.5);
}
#define SOLVE_RECORDED(set)                                                     \
  BENCHMARK_CAPTURE(solve_recorded, set / study / gp_chain, #set, true, false)  \
      ->Unit(benchmark::kMillisecond);                                          \
  BENCHMARK_CAPTURE(solve_recorded, set / study / gp_ceres, #set, false, false) \
      ->Unit(benchmark::kMillisecond);                                          \
  BENCHMARK_CAPTURE(solve_recorded, set / replan / gp_chain, #set, true, true)  \
      ->Unit(benchmark::kMillisecond);                                          \
  BENCHMARK_CAPTURE(solve_recorded, set / replan / gp_ceres, #set, false, true) \
      ->Unit(benchmark::kMillisecond)
BENCHMARK_CAPTURE(solve_recorded, panda_single / study / gp_chain / starts : 8, "panda_single",
                  true, false, 8)
    ->Unit(benchmark::kMillisecond);
BENCHMARK_CAPTURE(solve_recorded, panda_clutter / study / gp_chain / starts : 8, "panda_clutter",
                  true, false, 8)
    ->Unit(benchmark::kMillisecond);
SOLVE_RECORDED(panda_single);
SOLVE_RECORDED(panda_clutter);
SOLVE_RECORDED(wam_single);

void solve_hsr(benchmark::State& state, bool chain) {
  const Problem problem =
      hsr_reaches_table(static_cast<int>(state.range(0)), static_cast<int>(state.range(1)));
  const Trajectory initial =
      straight_line(problem.start, problem.goal, problem.support_states, problem.dt_s);
  const auto optimiser = optimiser_of(chain, state.range(2) != 0);
  Solution solution;
  for (auto _ : state) {
    auto result = optimiser->solve(problem, initial, Deadline());
    if (!result || result->status == SolveStatus::kFailed) state.SkipWithError("no solution");
    solution = std::move(*result);
  }
  state.counters["steps"] = solution.iterations;
  state.counters["cost"] = solution.cost;
}
BENCHMARK_CAPTURE(solve_hsr, gp_chain, true)
    ->ArgNames({"states", "checks", "replan"})
    ->ArgsProduct({{20}, {0, 4}, {0, 1}})
    ->Unit(benchmark::kMillisecond);
BENCHMARK_CAPTURE(solve_hsr, gp_ceres, false)
    ->ArgNames({"states", "checks", "replan"})
    ->ArgsProduct({{20}, {0, 4}, {0, 1}})
    ->Unit(benchmark::kMillisecond);

/// The parts of one iteration on a recorded problem.
template <class Part>
void iteration_part(benchmark::State& state, Part part) {
  const auto& problems = problems_of("panda_single");
  if (problems.empty()) {
    state.SkipWithError("no recorded problems");
    return;
  }
  ChainModel model;
  const auto rule = make_step_rule({});
  model.reset(problems[5].problem, problems[5].initial);
  if (minimise(model, *rule, {.max_iterations = 2}, Deadline()).accepted == 0) return;
  std::vector<double> step(model.current().support.size(), 0.0);
  for (auto _ : state) part(model, step);
}
BENCHMARK_CAPTURE(iteration_part, evaluate, [](ChainModel& model, std::vector<double>& step) {
  benchmark::DoNotOptimize(model.try_step(step));
})->Unit(benchmark::kMicrosecond);
BENCHMARK_CAPTURE(iteration_part, assemble, [](ChainModel& model, std::vector<double>&) {
  model.linearise();
})->Unit(benchmark::kMicrosecond);
BENCHMARK_CAPTURE(iteration_part, solve,
                  [lambda = 0.01](ChainModel& model, std::vector<double>& step) mutable {
                    lambda =
                        0.03 -
                        lambda;  // another one each time: with the same its factor would be kept
                    benchmark::DoNotOptimize(model.system().solve(lambda, step));
                  })
    ->Unit(benchmark::kMicrosecond);

}  // namespace
}  // namespace sidestep
