#include <algorithm>
#include <array>
#include <random>

#include <sidestep/core/seed.hpp>
#include <sidestep/planning/costs.hpp>
#include <sidestep/planning/initial_guess.hpp>
#include <sidestep/report/report_parts.hpp>
#include <sidestep/runtime/blocks.hpp>
#include <sidestep/runtime/results_store.hpp>

#include "recorded_solves.hpp"

namespace sidestep {
namespace {

using namespace report;

/// The `experiment` block of an incremental benchmark.
struct IncrementalSettings : ProblemChoice, ExperimentSettings {
  double goal_sd = 0.1;
  double obstacle_sd_m = 0.05;

  IncrementalSettings() { runs = {"replan"}; }

  static Parameters<IncrementalSettings> parameters() {
    using S = IncrementalSettings;
    return declare_choice(experiment_parameters<S>(
                              "Seed of everything random in the run: what goals and boxes move by.",
                              "Threads that the optimiser may use; 0 for one per core."))
        .add(
            "goal_sd", &S::goal_sd,
            "Standard deviation of what each joint of a changed goal moves by (m, rad), within its "
            "limits.",
            {.min = 0.0, .max = 10.0})
        .add("obstacle_sd_m", &S::obstacle_sd_m,
             "Standard deviation of what each box of a changed scene moves by along each axis.",
             {.unit = "m", .min = 0.0, .max = 10.0});
  }
};

/// How a changed problem is solved: from a straight line; from the trajectory before, whole; by the
/// optimiser that has found the trajectory before.
enum SolveWay : std::size_t { kAfresh, kWarm, kIncremental };
inline constexpr std::array kSolveWays = {"afresh", "warm", "incremental"};

/// A changed problem in all ways.
struct ChangedSolve {
  int scene = 0;
  int pair = 0;
  bool ends_free = false;  ///< Start and goal touch nothing.
  std::array<RecordedSolve, kSolveWays.size()> ways;

  [[nodiscard]] bool solved() const noexcept {
    return std::ranges::all_of(ways, &RecordedSolve::solved);
  }
};

/// All problems of a recorded run with one change.
struct ChangedSeries : RecordedRun {
  std::string change;  ///< "goal" or "obstacles".
  std::vector<ChangedSolve> problems;
};

constexpr const char* kGoal = "goal";
constexpr const char* kObstacles = "obstacles";

constexpr const char* kIncrementalKey = "incremental";

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
  RecordedFields fields{problems}, moved_fields{moved};
  SolveProgress progress{context, problems, 2 * settings.repeats};
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
    one.line_before = straight_line(one.before);
    one.line_after = straight_line(one.after);
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
  const auto make = [&](const char* is_incremental) {
    const SourceMark mark{"the experiment incremental_benchmark", 0, 0};
    return context.host.create<Optimiser>(
        with_entry(block_for(block, run), kIncrementalKey, plain_scalar(is_incremental, mark)),
        bench.problems.robot);
  };
  auto plain = SIDESTEP_TRY(make("false"));
  auto kept = SIDESTEP_TRY(make("true"));
  const RecordedProblems& judged_in = change == kGoal ? bench.problems : bench.moved;
  const std::vector<ChangedProblem> posed = pose(run, change, bench);
  ChangedSeries series{run, change, {}};
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

/// One way through a series. Times, iterations and costs are of the problems solved in every way.
struct WayRow {
  const ChangedSeries& series;
  std::size_t way;
  std::vector<ChangedSolve> solved = those_of(series.problems, &ChangedSolve::solved);
  std::vector<ChangedSolve> with_free_ends = those_of(series.problems, &ChangedSolve::ends_free);

  /// The share of those problems whose trajectory is free of collisions.
  [[nodiscard]] Json share_free(const std::vector<ChangedSolve>& problems) const {
    return share_of(problems, [&](const ChangedSolve& s) { return s.ways[way].is_free(); });
  }
};

/// A number of each problem that is solved, in this way.
template <class Value>
auto of_way(Value value) {
  return [value](const WayRow& row) {
    return values_of(row.solved,
                     [&](const auto& s) { return std::invoke(value, s.ways[row.way]); });
  };
}

/// The same as a multiple of what it is afresh.
template <class Value>
auto of_afresh(Value value) {
  return [value](const WayRow& row) {
    return values_of(row.solved, [&](const auto& s) {
      return std::invoke(value, s.ways[row.way]) / std::invoke(value, s.ways[kAfresh]);
    });
  };
}

Json ratio_of_mean_times(const WayRow& row) {
  if (row.solved.empty()) return nullptr;
  const auto times_ms = of_way(&RecordedSolve::solve_ms);
  return statistics_of(times_ms(row)).mean / statistics_of(times_ms({row.series, kAfresh})).mean;
}

Json share_no_costlier(const WayRow& row) {
  return share_of(row.solved, [&](const ChangedSolve& s) {
    return s.ways[row.way].cost <= kOnePercent * s.ways[kAfresh].cost;
  });
}

const ResultColumnsOf<WayRow>& way_rows() {
  using R = WayRow;
  using S = RecordedSolve;
  static const auto kColumns =
      ResultColumnsOf<R>("/rows")
          .add("label", [](const R& r) { return r.series.label; }, "Run of the recording.",
               {.heading = "rules", .compared = true})
          .add("field", [](const R& r) { return r.series.is_signed ? "sdf" : "usdf"; },
               "Kind of field: `sdf` or `usdf`.", {.heading = "field", .compared = true})
          .add("change", [](const R& r) { return r.series.change; },
               "What was changed: `goal` or `obstacles`.", {.heading = "other", .compared = true})
          .add(
              "way", [](const R& r) { return kSolveWays[r.way]; },
              "How it was solved: `afresh` from a straight line, `warm` from the trajectory before "
              "the change, `incremental` by the optimiser that had found it.",
              {.heading = "way", .compared = true})
          .table("Time", "Ratios are to afresh, problem by problem, but for that of the means.")
          .add("problems", [](const R& r) { return r.series.problems.size(); },
               "Problems with this change.", {.heading = "problems", .pattern = "%.0f"})
          .add("solved", [](const R& r) { return r.solved.size(); }, "Solved in every way.",
               {.heading = "solved", .pattern = "%.0f"})
          .spread("solve_ms.", of_way(&S::solve_ms), "Wall time of a solve.",
                  {"p50", "p95", "mean"},
                  {.heading = "solve", .pattern = "%.4f ms", .compared = true})
          .spread("time_ratio.", of_afresh(&S::solve_ms),
                  "Its ratio to the time of solving afresh.", {"p50", "p95"},
                  {.heading = "of afresh's", .pattern = "%.3f", .compared = true})
          .add("time_ratio.of_means", &ratio_of_mean_times, "Ratio of the mean times.",
               {.heading = "of means", .pattern = "%.3f"})
          .spread("iterations.", of_way(&S::accepted_iterations), "Accepted iterations.",
                  {"p50", "p95", "mean"},
                  {.heading = "iterations", .pattern = "%.2f", .page_only = true})
          .table("Costs and collisions")
          .spread("cost_ratio.", of_afresh(&S::cost), "Ratio of the final cost to that of afresh.",
                  {"p05", "p50", "p95"}, {.heading = "cost of afresh's", .pattern = "%.4f"})
          .add("cost_ratio.share_within_1pct", &share_no_costlier,
               "Share that costs at most 1 % more than afresh.",
               {.heading = "within 1 % or below", .pattern = "%.4f", .compared = true})
          .add("collision_free.share", [](const R& r) { return r.share_free(r.series.problems); },
               "Share of all problems with a trajectory free of collisions, by exact distances.",
               {.heading = "collision-free", .pattern = "%.4f", .compared = true})
          .add("free_ends.problems", [](const R& r) { return r.with_free_ends.size(); },
               "Problems whose start and goal touch nothing.",
               {.heading = "ends free", .pattern = "%.0f"})
          .add("free_ends.share", [](const R& r) { return r.share_free(r.with_free_ends); },
               "Share of these that is free of collisions.",
               {.heading = "of them free", .pattern = "%.4f"});
  return kColumns;
}

std::string verdict_text(const std::string& optimiser, const Json& rows, const SolveCount& count) {
  const std::string problems = "changed problems by " + optimiser;
  std::string text = count.failure(problems, "came to nothing in some way");
  if (!text.empty()) return text;
  text = "Success: " + std::to_string(count.problems) + " " + problems +
         ", each with a trajectory in every way.";
  for (const Json& row : rows) {
    if (at(row, "/way") != Json(kSolveWays[kIncremental])) continue;
    text += " " + cell(at(row, "/label")) + ", " + cell(at(row, "/field")) + ", other " +
            cell(at(row, "/change")) + ": incrementally in " +
            cell(at(row, "/time_ratio/p50"), "%.2f") + " of the time of solving afresh (median).";
  }
  return text;
}

Result<std::string> incremental_body(const Json& summary, ResultsReader&,
                                     const std::filesystem::path&) {
  return sentence_of(summary) + "; each joint of the goal moved by " +
         cell(at(summary, "/goal_sd")) + ", or each box by " + cell(at(summary, "/obstacle_sd_m")) +
         " m along each axis (standard deviations). Afresh: from a straight line. Warm: from the "
         "trajectory before the change. Incremental: by the optimiser that found it.</p>\n" +
         way_rows().html(at(summary, "/rows"));
}

ExperimentOutcome summarise_incremental(const RecordedStart& start,
                                        const IncrementalSettings& settings,
                                        const std::vector<ChangedSeries>& all, SolveCount count) {
  Json rows = Json::array();
  for (const ChangedSeries& series : all) {
    for (std::size_t way = 0; way < kSolveWays.size(); ++way)
      rows.push_back(way_rows().row({series, way}));
    for (const ChangedSolve& problem : series.problems) {
      const auto unsolved = std::ranges::find(problem.ways, false, &RecordedSolve::solved);
      const bool is_solved = unsolved == problem.ways.end();
      count.add(is_solved, is_solved ? "" : unsolved->reason);
    }
  }
  return summarise_solves(start, settings.type, count, verdict_text(start.optimiser, rows, count),
                          way_rows(),
                          {{"repeats", settings.repeats},
                           {"goal_sd", settings.goal_sd},
                           {"obstacle_sd_m", settings.obstacle_sd_m},
                           {"problems", count.problems},
                           {"rows", rows}});
}

class IncrementalBenchmark final : public Experiment {
 public:
  [[nodiscard]] ExperimentFacts facts() const override {
    std::vector<std::string> set = kSetOfOptimiser;
    set.emplace_back(kIncrementalKey);
    return {.blocks = {"optimiser"}, .set_of_optimiser = set};
  }
  [[nodiscard]] const report::RunReport& report() const override {
    static const RunReport kReport = {.body = &incremental_body,
                                      .columns = &way_rows(),
                                      .compared_of_run = {{"problems", "/problems_file"}}};
    return kReport;
  }
  void check(const Configuration& configuration, Host& host,
             std::vector<Error>& errors) const override {
    check_recorded<IncrementalSettings>(configuration, facts().set_of_optimiser, host, errors);
  }
  [[nodiscard]] Result<ExperimentOutcome> run(ExperimentContext& context) const override {
    const auto settings =
        SIDESTEP_TRY(read_block<IncrementalSettings>(context.configuration, "experiment"));
    const auto start = SIDESTEP_TRY(start_recorded(context, settings));
    Recorder recorder(*start.store);
    std::vector<ChangedSeries> series;
    const RecordedProblems moved =
        with_moved_boxes(start.problems, settings.obstacle_sd_m, context.seed);
    IncrementalBench bench{start.problems, moved, settings, context};
    for (const RecordedRun& run : start.problems.runs) {
      for (const char* change : {kGoal, kObstacles}) {
        if (context.stop.stop_requested()) break;
        SIDESTEP_TRY(solve_part(
            series, [&] { return solve_series(run, change, bench); }, &record_series, recorder));
      }
    }
    return summarise_incremental(start, settings, series, {context.stop.stop_requested()});
  }
};

}  // namespace
}  // namespace sidestep

SIDESTEP_EXPERIMENT(sidestep::IncrementalBenchmark, sidestep::IncrementalSettings,
                    "incremental_benchmark", "0.1.0",
                    "Solved problems whose goal or obstacles change: afresh, warm, incrementally")
