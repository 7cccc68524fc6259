#include "planner_benchmark.hpp"

#include <algorithm>

#include <sidestep/runtime/guarded.hpp>
#include <sidestep/runtime/results_store.hpp>

#include "plan_recording.hpp"
#include "planner_settings.hpp"
#include "planner_summary.hpp"
#include "recorded_fields.hpp"
#include "run_provenance.hpp"

namespace sidestep {
namespace {

constexpr std::int64_t kProgressEvery = 25;  ///< Solves.

void check_planner_benchmark(const Configuration& configuration, Host& host,
                             std::vector<Error>& errors) {
  const Node* experiment = configuration.root.find("experiment");
  const Node* optimiser = configuration.root.find("optimiser");
  if (optimiser != nullptr) check_optimiser(*optimiser, set_of_optimiser(), host, errors);
  std::vector<Error> unfit;
  check_against_schema(*experiment, PlannerBenchmarkSettings::parameters().schema(), {}, unfit);
  if (!unfit.empty()) return;  // its schema told
  PlannerBenchmarkSettings settings;
  PlannerBenchmarkSettings::parameters().read(*experiment, settings, errors);
  if (!settings.problems.empty()) (void)read_chosen_problems(*experiment, settings, errors);
}

/// Series "run" (one item a run), and of the run with index `item`: "solve/ITEM", one item a
/// problem.
void record_run(const PlannerRunRecord& run, std::int64_t item, Recorder& recorder) {
  recorder.add("run", item, "label", run.label);
  recorder.add("run", item, "signed", run.is_signed);
  recorder.add("run", item, "relative_tolerance", run.relative_tolerance);
  recorder.add("run", item, "max_iterations", run.max_iterations);
  const std::string series = "solve/" + std::to_string(item);
  std::int64_t problem = 0;
  for (const SolveRecord& solve : run.solves) {
    const auto add = [&](std::string_view key, const auto& value) {
      recorder.add(series, problem, key, value);
    };
    add("scene", solve.peer.scene);
    add("pair", solve.peer.pair);
    add("status", to_string(solve.status));
    if (!solve.reason.empty()) add("reason", solve.reason);
    add("solve_ms", solve.solve_ms);
    add("iterations", solve.iterations);
    add("accepted_iterations", solve.accepted_iterations);
    add("initial_cost", solve.initial_cost);
    add("cost", solve.cost);
    add("ends_free", solve.ends_free);
    add("exact_clearance_m", solve.exact_clearance_m);
    add("clearance_at_checks_m", solve.clearance_at_checks_m);
    add("peer_solve_ms", solve.peer.total_ms);
    add("peer_iterations", solve.peer.iterations);
    add("peer_initial_cost", solve.peer.initial_cost);
    add("peer_cost", solve.peer.final_cost);
    add("peer_free_exactly", solve.peer.free_exactly);
    add("peer_free_at_checks", solve.peer.free_at_checks);
    ++problem;
  }
}

/// What solving a run borrows.
struct Bench {
  const RecordedProblems& problems;
  const PlannerBenchmarkSettings& settings;
  ExperimentContext& context;
  RecordedFields fields;
  std::int64_t total = 0;
  std::int64_t done = 0;

  void advance(const std::string& what) {
    ++done;
    if (context.progress && (done % kProgressEvery == 0 || done == total)) {
      context.progress(done, total, what);
    }
  }
};

/// One problem, ready to be solved, so that the clock runs over nothing but solves.
struct PosedProblem {
  Problem problem;
  Trajectory initial;
};

std::vector<PosedProblem> pose(const RecordedRun& run, Bench& bench) {
  std::vector<PosedProblem> posed;
  for (const RecordedOutcome& outcome : run.outcomes) {
    PosedProblem one;
    one.problem = recorded_problem(bench.problems, bench.fields.of(outcome.scene, run.is_signed),
                                   outcome.pair);
    one.initial = recorded_initial(one.problem);
    posed.push_back(std::move(one));
  }
  return posed;
}

Result<Solution> solve(PluginPtr<Optimiser>& optimiser, const PosedProblem& posed,
                       const ExperimentContext& context) {
  return guarded(plugin_of(optimiser), [&] {
    return optimiser->solve(posed.problem, posed.initial, Deadline(context.stop));
  });
}

void note(Result<Solution> solution, SolveRecord& record, Trajectory& trajectory) {
  if (!solution) {
    record.reason = solution.error().describe();
    return;
  }
  record.status = solution->status;
  record.reason = std::move(solution->reason);
  record.iterations = solution->iterations;
  record.accepted_iterations = solution->accepted_iterations;
  record.initial_cost = solution->initial_cost;
  record.cost = solution->cost;
  trajectory = std::move(solution->trajectory);
  record.solved = trajectory.size() > 0;
}

/// Holds a trajectory, which may be empty, against the obstacles.
void judge(const Problem& problem, const Trajectory& trajectory, Bench& bench,
           SolveRecord& record) {
  const int scene = record.peer.scene;
  const auto is_free = [&](const Eigen::VectorXd& q) {
    const std::span<const double> values(q.data(), static_cast<std::size_t>(q.size()));
    return exact_clearance_m(bench.problems, scene, values) > 0.0;
  };
  record.ends_free = is_free(problem.start.q) && is_free(problem.goal.q);
  if (!record.solved) return;
  record.exact_clearance_m = exact_clearance_m(bench.problems, scene, trajectory);
  record.clearance_at_checks_m =
      clearance_at_checks_m(problem, *bench.fields.of(scene, true), trajectory);
}

/// Solves every problem of a run `repeats` times, one pass after the other, after one solve that
/// does not count. Stops on request with those that all passes have reached.
Result<PlannerRunRecord> solve_run(const RecordedRun& run, Bench& bench) {
  ExperimentContext& context = bench.context;
  const Node block = block_for(*context.configuration.root.find("optimiser"), run);
  auto optimiser = context.host.create<Optimiser>(block, bench.problems.robot);
  if (!optimiser) return tl::make_unexpected(std::move(optimiser.error()));
  PlannerRunRecord record{run.label, run.is_signed, run.relative_tolerance, run.max_iterations, {}};
  const std::vector<PosedProblem> posed = pose(run, bench);
  const std::string what = run.label + (run.is_signed ? ", signed" : ", unsigned");
  std::vector<Trajectory> trajectories(posed.size());
  record.solves.resize(posed.size());
  if (!posed.empty()) (void)solve(*optimiser, posed.front(), context);
  std::size_t reached = posed.size();
  for (int repeat = 0; repeat < bench.settings.repeats; ++repeat) {
    for (std::size_t i = 0; i < reached; ++i) {
      SolveRecord& one = record.solves[i];
      const Stopwatch watch;
      auto solution = solve(*optimiser, posed[i], context);
      const double elapsed_ms = watch.elapsed_ms();
      if (context.stop.stop_requested()) {
        reached = repeat == 0 ? i : reached;
        break;
      }
      one.solve_ms = repeat == 0 ? elapsed_ms : std::min(one.solve_ms, elapsed_ms);
      one.peer = run.outcomes[i];
      if (repeat == 0) note(std::move(solution), one, trajectories[i]);
      bench.advance(what);
    }
  }
  record.solves.resize(reached);
  for (std::size_t i = 0; i < reached; ++i) {
    judge(posed[i].problem, trajectories[i], bench, record.solves[i]);
  }
  return record;
}

Result<ExperimentOutcome> run_planner_benchmark(ExperimentContext& context) {
  const Node& experiment = *context.configuration.root.find("experiment");
  std::vector<Error> errors;
  PlannerBenchmarkSettings settings;
  PlannerBenchmarkSettings::parameters().read(experiment, settings, errors);
  if (!errors.empty()) return tl::make_unexpected(std::move(errors.front()));
  const auto problems = read_problems(experiment, settings);
  if (!problems) return tl::make_unexpected(problems.error());

  const RunProvenance provenance = provenance_of(context);
  auto store = ResultsStore::open(context.out / "results.sqlite", provenance);
  if (!store) return tl::make_unexpected(std::move(store.error()));
  Recorder recorder(**store);

  PlannerBenchmarkRecord record;
  record.problems_file = settings.problems.filename().string();
  record.robot = problems->robot->description().name;
  record.optimiser = context.configuration.root.find("optimiser")->find("plugin")->text();
  record.costs_comparable = problems->costs_comparable;
  Bench bench{*problems, settings, context, RecordedFields(*problems)};
  for (const RecordedRun& run : problems->runs) {
    bench.total += settings.repeats * std::ssize(run.outcomes);
  }
  if (context.progress) context.progress(0, bench.total, "building fields");
  for (const RecordedRun& run : problems->runs) {
    if (context.stop.stop_requested()) break;
    auto solved = contained("solving recorded problems", [&] { return solve_run(run, bench); });
    if (!solved) return tl::make_unexpected(std::move(solved.error()));
    record_run(*solved, std::ssize(record.runs), recorder);
    record.runs.push_back(std::move(*solved));
    if (auto saved = recorder.commit(); !saved) {
      return tl::make_unexpected(std::move(saved.error()));
    }
  }
  record.interrupted = context.stop.stop_requested();

  return summarise_planner(provenance, settings, record);
}

}  // namespace

ExperimentType planner_benchmark_experiment() {
  return {"planner_benchmark",
          "An optimiser on problems that a peer has solved: time, cost, collisions",
          [] { return PlannerBenchmarkSettings::parameters().schema(); },
          {"optimiser"},
          &check_planner_benchmark,
          &run_planner_benchmark,
          nullptr,
          set_of_optimiser()};
}

}  // namespace sidestep
