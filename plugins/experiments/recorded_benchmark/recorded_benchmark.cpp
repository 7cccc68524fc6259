#include <sidestep/runtime/results_store.hpp>

#include "recorded_solves.hpp"
#include "recorded_summary.hpp"

namespace sidestep {
namespace {

/// Series "run" (one item a run), and of the run with index `item`: "solve/ITEM", one item a
/// problem.
void record_run(const RecordedRunRecord& run, std::int64_t item, Recorder& recorder) {
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
    record_solve(solve, series, problem, recorder);
    add("ends_free", solve.ends_free);
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
struct RecordedBench {
  const RecordedProblems& problems;
  const RecordedBenchmarkSettings& settings;
  ExperimentContext& context;
  RecordedFields fields;
  SolveProgress progress;
};

/// One problem, ready to be solved, so that the clock runs over nothing but solves.
struct PosedProblem {
  Problem problem;
  Trajectory initial;
};

std::vector<PosedProblem> pose(const RecordedRun& run, RecordedBench& bench) {
  std::vector<PosedProblem> posed;
  for (const RecordedOutcome& outcome : run.outcomes) {
    PosedProblem one;
    one.problem = recorded_problem(bench.problems, bench.fields.of(outcome.scene, run.is_signed),
                                   outcome.pair);
    one.initial = recorded_initial(bench.problems, one.problem);
    posed.push_back(std::move(one));
  }
  return posed;
}

/// Holds a trajectory, which may be empty, against the obstacles.
void judge(const Problem& problem, const Trajectory& trajectory, RecordedBench& bench,
           SolveRecord& record) {
  const int scene = record.peer.scene;
  record.ends_free = are_ends_free(bench.problems, scene, problem);
  if (!record.solved) return;
  record.exact_clearance_m = exact_clearance_m(bench.problems, scene, trajectory);
  record.clearance_at_checks_m =
      clearance_at_checks_m(problem, *bench.fields.of(scene, true), trajectory);
}

/// Solves every problem of a run `repeats` times, one pass after the other, after one solve that
/// does not count. Stops on request with those that all passes have reached.
Result<RecordedRunRecord> solve_run(const RecordedRun& run, RecordedBench& bench) {
  ExperimentContext& context = bench.context;
  const Node block = block_for(*context.configuration.root.find("optimiser"), run);
  auto optimiser = SIDESTEP_TRY(context.host.create<Optimiser>(block, bench.problems.robot));
  RecordedRunRecord record{
      run.label, run.is_signed, run.relative_tolerance, run.max_iterations, {}};
  const std::vector<PosedProblem> posed = pose(run, bench);
  const std::string what = run.label + (run.is_signed ? ", signed" : ", unsigned");
  std::vector<Trajectory> trajectories(posed.size());
  record.solves.resize(posed.size());
  const auto solve = [&](const PosedProblem& one) {
    return solve_timed(optimiser, one.problem, one.initial, context);
  };
  if (!posed.empty()) (void)solve(posed.front());
  std::size_t reached = posed.size();
  for (int repeat = 0; repeat < bench.settings.repeats; ++repeat) {
    for (std::size_t i = 0; i < reached; ++i) {
      TimedSolve timed = solve(posed[i]);
      if (context.stop.stop_requested()) {
        reached = repeat == 0 ? i : reached;
        break;
      }
      record.solves[i].peer = run.outcomes[i];
      note(timed, repeat == 0, record.solves[i]);
      if (repeat == 0 && timed.solution) trajectories[i] = std::move(timed.solution->trajectory);
      bench.progress.advance(what);
    }
  }
  record.solves.resize(reached);
  for (std::size_t i = 0; i < reached; ++i) {
    judge(posed[i].problem, trajectories[i], bench, record.solves[i]);
  }
  return record;
}

class RecordedBenchmark final : public Experiment {
 public:
  [[nodiscard]] ExperimentFacts facts() const override {
    return {.blocks = {"optimiser"}, .set_of_optimiser = set_of_optimiser()};
  }
  [[nodiscard]] const report::RunReport& report() const override { return recorded_report(); }
  void check(const Configuration& configuration, Host& host,
             std::vector<Error>& errors) const override {
    check_recorded<RecordedBenchmarkSettings>(configuration, set_of_optimiser(), host, errors);
  }
  [[nodiscard]] Result<ExperimentOutcome> run(ExperimentContext& context) const override {
    const auto start = SIDESTEP_TRY(start_recorded<RecordedBenchmarkSettings>(context));
    const auto& [settings, problems, provenance, store] = start;
    Recorder recorder(*store);

    RecordedBenchmarkRecord record;
    record.about = facts_of(problems, context);
    record.costs_comparable = !problems.has_base;
    std::int64_t total = 0;
    for (const RecordedRun& run : problems.runs) {
      total += settings.repeats * std::ssize(run.outcomes);
    }
    RecordedBench bench{problems, settings, context, RecordedFields(problems), {context, total}};
    for (const RecordedRun& run : problems.runs) {
      if (context.stop.stop_requested()) break;
      SIDESTEP_TRY(solve_part(
          record.runs, [&] { return solve_run(run, bench); }, &record_run, recorder));
    }
    record.about.interrupted = context.stop.stop_requested();

    return summarise_recorded(provenance, settings, record);
  }
};

}  // namespace

Parameters<RecordedBenchmarkSettings> RecordedBenchmarkSettings::parameters() {
  using S = RecordedBenchmarkSettings;
  return declare_choice(experiment_parameters<S>(
      "Seed of everything random in the run.",
      "Threads that the optimiser may use within a solve; 0 for one per core. Problems are solved "
      "one after the other."));
}

}  // namespace sidestep

SIDESTEP_EXPERIMENT(sidestep::RecordedBenchmark, sidestep::RecordedBenchmarkSettings,
                    "recorded_benchmark", "0.1.0",
                    "An optimiser on problems that a peer has solved: time, cost, collisions")
