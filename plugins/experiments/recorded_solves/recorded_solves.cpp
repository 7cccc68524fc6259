#include "recorded_solves.hpp"

#include <algorithm>
#include <array>

namespace sidestep {
namespace {

constexpr std::int64_t kProgressEvery = 25;

}  // namespace

RecordedFacts facts_of(const RecordedProblems& problems, const Configuration& configuration) {
  return {problems.file.filename().string(), problems.robot->description().name,
          configuration.root.find("optimiser")->find("plugin")->text()};
}

TimedSolve solve_timed(PluginPtr<Optimiser>& optimiser, const Problem& problem,
                       const Trajectory& initial, const ExperimentContext& context) {
  const Stopwatch watch;
  auto solution = guarded(plugin_of(optimiser), [&] {
    return optimiser->solve(problem, initial, Deadline(context.stop));
  });
  return {std::move(solution), watch.elapsed_ms()};
}

void note(const TimedSolve& timed, bool is_first, RecordedSolve& record) {
  record.solve_ms = is_first ? timed.elapsed_ms : std::min(record.solve_ms, timed.elapsed_ms);
  if (!is_first) return;
  if (!timed.solution) {
    record.reason = timed.solution.error().describe();
    return;
  }
  const Solution& solution = *timed.solution;
  record.solved = solution.trajectory.size() > 0;
  record.status = solution.status;
  record.reason = solution.reason;
  record.iterations = solution.iterations;
  record.accepted_iterations = solution.accepted_iterations;
  record.initial_cost = solution.initial_cost;
  record.cost = solution.cost;
}

void record_solve(const RecordedSolve& solve, std::string_view series, std::int64_t item,
                  Recorder& recorder) {
  const auto add = [&](std::string_view key, const auto& value) {
    recorder.add(series, item, key, value);
  };
  add("status", to_string(solve.status));
  if (!solve.reason.empty()) add("reason", solve.reason);
  add("solve_ms", solve.solve_ms);
  add("iterations", solve.iterations);
  add("accepted_iterations", solve.accepted_iterations);
  add("initial_cost", solve.initial_cost);
  add("cost", solve.cost);
  add("exact_clearance_m", solve.exact_clearance_m);
}

bool are_ends_free(const RecordedProblems& problems, int scene, const Problem& problem) {
  return std::ranges::all_of(std::array{&problem.start.q, &problem.goal.q}, [&](const auto* q) {
    const std::span<const double> values(q->data(), static_cast<std::size_t>(q->size()));
    return exact_clearance_m(problems, scene, values) > 0.0;
  });
}

SolveProgress::SolveProgress(const ExperimentContext& context, std::int64_t total)
    : context_(context), total_(total) {
  if (context.progress) context.progress(0, total, "building fields");
}

void SolveProgress::advance(const std::string& what) {
  ++done_;
  if (context_.progress && (done_ % kProgressEvery == 0 || done_ == total_)) {
    context_.progress(done_, total_, what);
  }
}

}  // namespace sidestep
