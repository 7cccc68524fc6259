#include <algorithm>
#include <random>

#include <sidestep/core/seed.hpp>
#include <sidestep/planning/costs.hpp>
#include <sidestep/runtime/results_store.hpp>

#include "incremental_summary.hpp"
#include "recorded_solves.hpp"

namespace sidestep {
namespace {

constexpr const char* kGoal = "goal";
constexpr const char* kObstacles = "obstacles";

constexpr const char* kSetIncremental = "incremental";

/// What the experiment sets of the optimiser: the stopping rules of each recorded run, and
/// `incremental`.
std::vector<std::string> set_of_incremental_optimiser() {
  std::vector<std::string> names = set_of_optimiser();
  names.emplace_back(kSetIncremental);
  return names;
}

/// The optimiser's block with a recorded run's stopping rules, incremental or not.
Node incremental_block(const Node& optimiser, const RecordedRun& run, bool is_incremental) {
  Node block = block_for(optimiser, run);
  const SourceMark mark{"the experiment incremental_benchmark", 0, 0};
  block.entries().push_back(
      {kSetIncremental, mark, Node(Node::Scalar{is_incremental ? "true" : "false", false}, mark)});
  return block;
}

std::mt19937_64 random_of(std::uint64_t seed, const std::string& part) {
  // What the experiment was called first: goals and boxes move as they did then.
  return std::mt19937_64(derive_seed(seed, "replanning/" + part));
}

/// The same problems in scenes whose boxes have moved, on a plane within it.
RecordedProblems with_moved_boxes(RecordedProblems problems, double sd_m, std::uint64_t seed) {
  const int axes = problems.grid.size_vox.z() == 1 ? 2 : 3;
  for (std::size_t scene = 0; scene < problems.scenes.size(); ++scene) {
    auto random = random_of(seed, "boxes/" + std::to_string(scene));
    std::normal_distribution<double> normal(0.0, 1.0);
    for (RecordedBox& box : problems.scenes[scene]) {
      Eigen::Vector3d by_m = Eigen::Vector3d::Zero();
      for (int axis = 0; axis < axes; ++axis) by_m[axis] = sd_m * normal(random);
      box.lower_m += by_m;
      box.upper_m += by_m;
    }
  }
  return problems;
}

/// A problem as it was, and as it is after the change. Terms that do not change are the same
/// objects.
struct ChangedProblem {
  Problem before, after;
  Trajectory line_before, line_after;
};

/// What a series of solves borrows.
struct IncrementalBench {
  const RecordedProblems& problems;
  const RecordedProblems& moved;
  const IncrementalSettings& settings;
  ExperimentContext& context;
  RecordedFields fields, moved_fields;
  SolveProgress progress;
};

void change_goal(Problem& problem, const RecordedOutcome& of, const IncrementalBench& bench) {
  auto random = random_of(bench.context.seed,
                          "goal/" + std::to_string(of.scene) + "/" + std::to_string(of.pair));
  std::normal_distribution<double> normal(0.0, 1.0);
  const std::vector<Joint>& joints = problem.robot->description().joints;
  for (std::size_t j = 0; j < joints.size(); ++j) {
    double& q = problem.goal.q[static_cast<Eigen::Index>(j)];
    q += bench.settings.goal_sd * normal(random);
    if (joints[j].type != Joint::Type::kContinuous) {
      q = std::clamp(q, joints[j].lower, joints[j].upper);
    }
  }
  const double sigma = bench.problems.settings.sigma_endpoint;
  for (CostTerm& term : problem.terms) {
    if (term.placement != Placement::kGoal) continue;
    term.cost = make_state_prior("goal", problem.goal, sigma);
  }
}

void change_field(Problem& problem, std::shared_ptr<const DistanceField> field,
                  const IncrementalBench& bench) {
  problem.field = std::move(field);
  const RecordedSettings& settings = bench.problems.settings;
  for (CostTerm& term : problem.terms) {
    if (term.placement != Placement::kSupportAndInterpolated) continue;
    term.cost = make_obstacle_cost(problem.robot, problem.field, problem.space, settings.epsilon_m,
                                   settings.sigma_obstacle_m);
  }
}

Trajectory line_of(const Problem& problem) {
  return straight_line(problem.start, problem.goal, problem.support_states, problem.dt_s);
}

std::vector<ChangedProblem> pose(const RecordedRun& run, const std::string& change,
                                 IncrementalBench& bench) {
  std::vector<ChangedProblem> posed;
  for (const RecordedOutcome& of : run.outcomes) {
    ChangedProblem one;
    one.before =
        recorded_problem(bench.problems, bench.fields.of(of.scene, run.is_signed), of.pair);
    one.after = one.before;
    if (change == kGoal) {
      change_goal(one.after, of, bench);
    } else {
      change_field(one.after, bench.moved_fields.of(of.scene, run.is_signed), bench);
    }
    one.line_before = line_of(one.before);
    one.line_after = line_of(one.after);
    posed.push_back(std::move(one));
  }
  return posed;
}

/// Solves a problem before its change, which is not timed, and after it in all ways, beginning with
/// another one in turn: the first one finds the memory of the change cold. Of the optimisers,
/// `kept` keeps what it can.
void solve_changed(const ChangedProblem& posed, PluginPtr<Optimiser>& plain,
                   PluginPtr<Optimiser>& kept, std::size_t turn, bool is_first,
                   const RecordedProblems& judged_in, const ExperimentContext& context,
                   ChangedSolve& record) {
  const auto base = solve_timed(kept, posed.before, posed.line_before, context).solution;
  const bool has_base = base && base->trajectory.size() > 0;
  const Trajectory& previous = has_base ? base->trajectory : posed.line_before;
  for (std::size_t i = 0; i < kSolveWays.size(); ++i) {
    const std::size_t way = (i + turn) % kSolveWays.size();
    const TimedSolve timed = solve_timed(way == kIncremental ? kept : plain, posed.after,
                                         way == kAfresh ? posed.line_after : previous, context);
    RecordedSolve& solve = record.ways[way];
    note(timed, is_first, solve);
    if (is_first && solve.solved) {
      solve.exact_clearance_m =
          exact_clearance_m(judged_in, record.scene, timed.solution->trajectory);
    }
  }
}

/// Every problem `repeats` times, pass by pass. Stops on request with those that all passes have
/// reached.
Result<ChangedSeries> solve_series(const RecordedRun& run, const std::string& change,
                                   IncrementalBench& bench) {
  ExperimentContext& context = bench.context;
  const Node& block = *context.configuration.root.find("optimiser");
  const auto make = [&](bool is_incremental) {
    return context.host.create<Optimiser>(incremental_block(block, run, is_incremental),
                                          bench.problems.robot);
  };
  auto plain = SIDESTEP_TRY(make(false));
  auto kept = SIDESTEP_TRY(make(true));
  const RecordedProblems& judged_in = change == kGoal ? bench.problems : bench.moved;
  const std::vector<ChangedProblem> posed = pose(run, change, bench);
  ChangedSeries series{run.label, run.is_signed, change, {}};
  for (std::size_t i = 0; i < posed.size(); ++i) {
    ChangedSolve record{run.outcomes[i].scene, run.outcomes[i].pair, false, {}};
    record.ends_free = are_ends_free(judged_in, record.scene, posed[i].after);
    series.problems.push_back(std::move(record));
  }
  const std::string what =
      run.label + (run.is_signed ? ", signed, other " : ", unsigned, other ") + change;
  for (PluginPtr<Optimiser>* one : {&plain, &kept}) {
    if (!posed.empty()) (void)solve_timed(*one, posed[0].before, posed[0].line_before, context);
  }
  for (int repeat = 0; repeat < bench.settings.repeats; ++repeat) {
    for (std::size_t i = 0; i < series.problems.size(); ++i) {
      solve_changed(posed[i], plain, kept, i + static_cast<std::size_t>(repeat), repeat == 0,
                    judged_in, context, series.problems[i]);
      if (context.stop.stop_requested()) {
        if (repeat == 0) series.problems.resize(i);
        return series;
      }
      bench.progress.advance(what);
    }
  }
  return series;
}

/// Series "series" (one item a series), and of the series with index `item`: "AFRESH/ITEM" and so
/// on, one item a problem.
void record_series(const ChangedSeries& series, std::int64_t item, Recorder& recorder) {
  recorder.add("series", item, "label", series.label);
  recorder.add("series", item, "signed", series.is_signed);
  recorder.add("series", item, "change", series.change);
  for (std::size_t way = 0; way < kSolveWays.size(); ++way) {
    const std::string name = std::string(kSolveWays[way]) + "/" + std::to_string(item);
    std::int64_t problem = 0;
    for (const ChangedSolve& record : series.problems) {
      const auto add = [&](std::string_view key, const auto& value) {
        recorder.add(name, problem, key, value);
      };
      add("scene", record.scene);
      add("pair", record.pair);
      add("ends_free", record.ends_free);
      record_solve(record.ways[way], name, problem, recorder);
      ++problem;
    }
  }
}

class IncrementalBenchmark final : public Experiment {
 public:
  [[nodiscard]] ExperimentFacts facts() const override {
    return {.blocks = {"optimiser"}, .set_of_optimiser = set_of_incremental_optimiser()};
  }
  [[nodiscard]] const report::RunReport& report() const override { return incremental_report(); }
  void check(const Configuration& configuration, Host& host,
             std::vector<Error>& errors) const override {
    check_recorded<IncrementalSettings>(configuration, set_of_incremental_optimiser(), host,
                                        errors);
  }
  [[nodiscard]] Result<ExperimentOutcome> run(ExperimentContext& context) const override {
    const auto start = SIDESTEP_TRY(start_recorded<IncrementalSettings>(context));
    const auto& [settings, problems, provenance, store] = start;
    Recorder recorder(*store);

    IncrementalRecord record;
    record.about = facts_of(problems, context);
    std::int64_t total = 0;
    for (const RecordedRun& run : problems.runs) {
      total += 2 * settings.repeats * std::ssize(run.outcomes);
    }
    const RecordedProblems moved = with_moved_boxes(problems, settings.obstacle_sd_m, context.seed);
    IncrementalBench bench{
        problems,        moved, settings, context, RecordedFields(problems), RecordedFields(moved),
        {context, total}};
    for (const RecordedRun& run : problems.runs) {
      for (const char* change : {kGoal, kObstacles}) {
        if (context.stop.stop_requested()) break;
        SIDESTEP_TRY(solve_part(
            record.series, [&] { return solve_series(run, change, bench); }, &record_series,
            recorder));
      }
    }
    record.about.interrupted = context.stop.stop_requested();

    return summarise_incremental(provenance, settings, record);
  }
};

}  // namespace

Parameters<IncrementalSettings> IncrementalSettings::parameters() {
  using S = IncrementalSettings;
  return declare_choice(experiment_parameters<S>(
                            "Seed of everything random in the run: what goals and boxes move by.",
                            "Threads that the optimiser may use; 0 for one per core."))
      .add("goal_sd", &S::goal_sd,
           "Standard deviation of what each joint of a changed goal moves by (m, rad), within its "
           "limits.",
           {.min = 0.0, .max = 10.0})
      .add("obstacle_sd_m", &S::obstacle_sd_m,
           "Standard deviation of what each box of a changed scene moves by along each axis.",
           {.unit = "m", .min = 0.0, .max = 10.0});
}

}  // namespace sidestep

SIDESTEP_EXPERIMENT(sidestep::IncrementalBenchmark, sidestep::IncrementalSettings,
                    "incremental_benchmark", "0.1.0",
                    "Solved problems whose goal or obstacles change: afresh, warm, incrementally")
