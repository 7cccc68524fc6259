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
  std::array<RecordedSolve, kSolveWays.size()> ways;

  ChangedSolve() = default;
  ChangedSolve(std::int64_t place, const RecordedOutcome& outcome) {
    for (RecordedSolve& solve : ways) {
      solve.problem = place;
      solve.scene = outcome.scene;
      solve.pair = outcome.pair;
    }
  }

  [[nodiscard]] const RecordedSolve& first() const noexcept { return ways.front(); }
  [[nodiscard]] bool ends_free() const noexcept { return first().ends_free; }
  [[nodiscard]] bool solved() const noexcept {
    return std::ranges::all_of(ways, &RecordedSolve::solved);
  }
  [[nodiscard]] std::optional<std::string> unsolved_reason() const {
    const auto unsolved = std::ranges::find(ways, false, &RecordedSolve::solved);
    return unsolved != ways.end() ? std::optional(unsolved->reason) : std::nullopt;
  }
  /// Of the series with index `series`: series "afresh/SERIES" and so on, one item a problem.
  void record(std::size_t series, Recorder& recorder) const {
    for (std::size_t way = 0; way < ways.size(); ++way) {
      stored().record(ways[way], name_of(way, series), ways[way].problem, recorder);
    }
  }
  static Result<std::vector<ChangedSolve>> read(ResultsReader& reader, std::size_t series,
                                                const std::string& file) {
    std::vector<ChangedSolve> solves;
    for (std::size_t way = 0; way < kSolveWays.size(); ++way) {
      const auto its = SIDESTEP_TRY(read_solves(stored(), reader, name_of(way, series), file));
      solves.resize(std::max(solves.size(), its.size()));
      for (std::size_t i = 0; i < its.size(); ++i) solves[i].ways[way] = its[i];
    }
    return solves;
  }

 private:
  static std::string name_of(std::size_t way, std::size_t series) {
    return std::string(kSolveWays[way]) + "/" + std::to_string(series);
  }
  static const StoredRow<RecordedSolve>& stored() {
    static const auto kStored = stored_solve<RecordedSolve>();
    return kStored;
  }
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
  std::array<Trajectory, kSolveWays.size()> found;  ///< After it, by way.
};

/// What a series of solves borrows.
struct IncrementalBench {
  const RecordedProblems& problems;
  const RecordedProblems& moved;
  const IncrementalSettings& settings;
  const ExperimentContext& context;
  RecordedFields fields{problems}, moved_fields{moved};
};

void change_goal(Problem& problem, const RecordedSolve& of, const IncrementalBench& bench) {
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

ChangedProblem pose(const RecordedSolve& of, const RecordedSeries& series,
                    IncrementalBench& bench) {
  ChangedProblem posed;
  posed.before =
      recorded_problem(bench.problems, bench.fields.of(of.scene, series.is_signed), of.pair);
  posed.after = posed.before;
  if (series.change == kGoal) {
    change_goal(posed.after, of, bench);
  } else {
    change_field(posed.after, bench.moved_fields.of(of.scene, series.is_signed), bench);
  }
  posed.line_before = straight_line(posed.before);
  posed.line_after = straight_line(posed.after);
  return posed;
}

/// The problems of a series, posed before the clock runs over nothing but solves. Of the
/// optimisers, `kept` keeps what it can.
class ChangeSolver {
 public:
  ChangeSolver(const RecordedSeries& series, const std::vector<ChangedSolve>& solves,
               PluginPtr<Optimiser> plain, PluginPtr<Optimiser> kept, IncrementalBench& bench)
      : context_(bench.context),
        judged_in_(series.change == kGoal ? bench.problems : bench.moved),
        plain_(std::move(plain)),
        kept_(std::move(kept)) {
    for (const ChangedSolve& solve : solves) posed_.push_back(pose(solve.first(), series, bench));
    const ChangedProblem& first = posed_.front();
    for (PluginPtr<Optimiser>* one : {&plain_, &kept_}) {
      (void)solve_timed(*one, first.before, first.line_before, context_);
    }
  }

  /// Before its change, which is not timed, and after it in all ways, beginning with another one in
  /// turn: the first one finds the memory of the change cold.
  void solve(std::size_t i, ChangedSolve& solve) {
    ChangedProblem& posed = posed_[i];
    const auto base = solve_timed(kept_, posed.before, posed.line_before, context_).solution;
    const bool has_base = base && base->trajectory.size() > 0;
    const Trajectory& previous = has_base ? base->trajectory : posed.line_before;
    const std::size_t turn = idx(solve.first().problem + solve.first().repeats);
    for (std::size_t w = 0; w < kSolveWays.size(); ++w) {
      const std::size_t way = (w + turn) % kSolveWays.size();
      TimedSolve timed = solve_timed(way == kIncremental ? kept_ : plain_, posed.after,
                                     way == kAfresh ? posed.line_after : previous, context_);
      RecordedSolve& record = solve.ways[way];
      note(timed, record);
      if (record.repeats == 1 && record.solved) {
        posed.found[way] = std::move(timed.solution->trajectory);
      }
    }
  }
  void judge(std::size_t i, ChangedSolve& solve) const {
    const ChangedProblem& posed = posed_[i];
    const int scene = solve.first().scene;
    const bool ends_free = are_ends_free(judged_in_, scene, posed.after);
    for (std::size_t way = 0; way < kSolveWays.size(); ++way) {
      RecordedSolve& record = solve.ways[way];
      record.ends_free = ends_free;
      if (!record.solved) continue;
      record.exact_clearance_m = exact_clearance_m(judged_in_, scene, posed.found[way]);
    }
  }

 private:
  const ExperimentContext& context_;
  const RecordedProblems& judged_in_;
  PluginPtr<Optimiser> plain_, kept_;
  std::vector<ChangedProblem> posed_;
};

/// One way through a series. Times, iterations and costs are of the problems solved in every way.
struct WayRow {
  const RecordedSeries& series;
  const std::vector<ChangedSolve>& problems;
  std::size_t way;
  std::vector<ChangedSolve> solved = those_of(problems, &ChangedSolve::solved);
  std::vector<ChangedSolve> with_free_ends = those_of(problems, &ChangedSolve::ends_free);

  /// The share of those problems whose trajectory is free of collisions.
  [[nodiscard]] Json share_free(const std::vector<ChangedSolve>& of) const {
    return share_of(of, [&](const ChangedSolve& s) { return s.ways[way].is_free(); });
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
  return statistics_of(times_ms(row)).mean /
         statistics_of(times_ms({row.series, row.problems, kAfresh})).mean;
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
          .add("problems", [](const R& r) { return r.problems.size(); },
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
          .add("collision_free.share", [](const R& r) { return r.share_free(r.problems); },
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

/// What the store in the folder `run` comes to.
Result<ExperimentOutcome> conclude_incremental(const std::filesystem::path& run, bool stopped,
                                               const std::optional<Error>& fault) {
  const auto record = SIDESTEP_TRY(read_recorded<ChangedSolve>(run / "results.sqlite"));
  const SolveCount count = count_solves(record, stopped, fault);
  Json rows = Json::array();
  for (std::size_t s = 0; s < record.series.size(); ++s) {
    for (std::size_t way = 0; way < kSolveWays.size(); ++way)
      rows.push_back(way_rows().row({record.series[s], record.solves[s], way}));
  }
  return summarise_solves(record, "incremental_benchmark", count,
                          verdict_text(record.optimiser, rows, count), way_rows(),
                          {{"problems", count.problems}, {"rows", rows}});
}

class IncrementalBenchmark final : public Experiment {
 public:
  [[nodiscard]] ExperimentFacts facts() const override {
    std::vector<std::string> set = kSetOfOptimiser;
    set.emplace_back(kIncrementalKey);
    return {.blocks = {"optimiser"}, .set_of_optimiser = set, .is_divisible = true};
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
    auto start = SIDESTEP_TRY(start_recorded(context, settings, {kGoal, kObstacles}));
    start.head.about =
        Json{{"goal_sd", settings.goal_sd}, {"obstacle_sd_m", settings.obstacle_sd_m}}.dump();
    const RecordedProblems moved =
        with_moved_boxes(start.problems, settings.obstacle_sd_m, context.seed);
    IncrementalBench bench{start.problems, moved, settings, context};
    const Node& block = block_of(context.configuration, "optimiser");
    const auto make = [&](const RecordedSeries& series, const RecordedRun& run,
                          const std::vector<ChangedSolve>& solves) -> Result<ChangeSolver> {
      const auto optimiser = [&](const char* is_incremental) {
        const SourceMark mark{"the experiment incremental_benchmark", 0, 0};
        return context.host.create<Optimiser>(
            with_entry(block_for(block, run), kIncrementalKey, plain_scalar(is_incremental, mark)),
            start.problems.robot);
      };
      auto plain = SIDESTEP_TRY(optimiser("false"));
      auto kept = SIDESTEP_TRY(optimiser("true"));
      return ChangeSolver(series, solves, std::move(plain), std::move(kept), bench);
    };
    return run_recorded<ChangedSolve>(context, start, make, &conclude_incremental);
  }
  [[nodiscard]] Result<ExperimentOutcome> merge(const std::vector<std::filesystem::path>& shards,
                                                const std::filesystem::path& out) const override {
    SIDESTEP_TRY(merge_recorded(shards, out));
    return conclude_incremental(out, false, std::nullopt);
  }
};

}  // namespace
}  // namespace sidestep

SIDESTEP_EXPERIMENT(sidestep::IncrementalBenchmark, sidestep::IncrementalSettings,
                    "incremental_benchmark", "0.1.0",
                    "Solved problems whose goal or obstacles change: afresh, warm, incrementally")
