#include <algorithm>
#include <array>
#include <cmath>

#include <sidestep/report/chart.hpp>
#include <sidestep/report/report_parts.hpp>
#include <sidestep/runtime/results_store.hpp>

#include "recorded_solves.hpp"

namespace sidestep {
namespace {

using namespace report;

/// The `experiment` block of a benchmark on recorded problems.
struct RecordedBenchmarkSettings : ProblemChoice, ExperimentSettings {
  RecordedBenchmarkSettings() { runs = {"study", "replan"}; }

  static Parameters<RecordedBenchmarkSettings> parameters() {
    return declare_choice(experiment_parameters<RecordedBenchmarkSettings>(
        "Seed of everything random in the run.",
        "Threads that the optimiser may use within a solve; 0 for one per core. Problems are "
        "solved one after the other."));
  }
};

/// One problem, solved.
struct SolveRecord : RecordedSolve {
  RecordedOutcome peer;
  double clearance_at_checks_m = 0.0;  ///< Where solved.

  SolveRecord() = default;
  SolveRecord(std::int64_t place, const RecordedOutcome& outcome) : peer(outcome) {
    problem = place;
    scene = peer.scene;
    pair = peer.pair;
  }

  /// Per accepted step, which is what GPMP2 counts as an iteration.
  [[nodiscard]] double iteration_us() const noexcept {
    return 1e3 * solve_ms / std::max(1, accepted_iterations);
  }
  [[nodiscard]] bool free_at_checks() const noexcept {
    return solved && clearance_at_checks_m > 0.0;
  }

  [[nodiscard]] const RecordedSolve& first() const noexcept { return *this; }
  [[nodiscard]] std::optional<std::string> unsolved_reason() const {
    return solved ? std::nullopt : std::optional(reason);
  }
  /// Of the series with index `series`: series "solve/SERIES", one item a problem.
  void record(std::size_t series, Recorder& recorder) const {
    stored().record(*this, name_of(series), problem, recorder);
  }
  static Result<std::vector<SolveRecord>> read(ResultsReader& reader, std::size_t series,
                                               const std::string& file) {
    return read_solves(stored(), reader, name_of(series), file);
  }

 private:
  static std::string name_of(std::size_t series) { return "solve/" + std::to_string(series); }
  static const StoredRow<SolveRecord>& stored() {
    using S = SolveRecord;
    const auto of_peer = [](auto member) {
      return [member](auto& solve) -> auto& { return solve.peer.*member; };
    };
    static const auto kStored =
        stored_solve<S>()
            .add("clearance_at_checks_m", &S::clearance_at_checks_m)
            .add("peer_solve_ms", of_peer(&RecordedOutcome::total_ms))
            .add("peer_optimise_ms", of_peer(&RecordedOutcome::optimise_ms))
            .add("peer_iterations", of_peer(&RecordedOutcome::iterations))
            .add("peer_initial_cost", of_peer(&RecordedOutcome::initial_cost))
            .add("peer_cost", of_peer(&RecordedOutcome::final_cost))
            .add("peer_free_exactly", of_peer(&RecordedOutcome::free_exactly))
            .add("peer_free_at_checks", of_peer(&RecordedOutcome::free_at_checks));
    return kStored;
  }
};

/// The problems of a run, posed before the clock runs over nothing but solves.
class RunSolver {
 public:
  RunSolver(const RecordedRun& run, const std::vector<SolveRecord>& solves,
            PluginPtr<Optimiser> optimiser, const RecordedProblems& problems,
            RecordedFields& fields, const ExperimentContext& context)
      : problems_(problems), fields_(fields), context_(context), optimiser_(std::move(optimiser)) {
    for (const SolveRecord& solve : solves) {
      Problem problem =
          recorded_problem(problems, fields.of(solve.scene, run.is_signed), solve.pair);
      Trajectory initial = recorded_initial(problems, problem);
      posed_.push_back({std::move(problem), std::move(initial), {}});
    }
    (void)solve_timed(optimiser_, posed_.front().problem, posed_.front().initial, context);
  }

  void solve(std::size_t i, SolveRecord& solve) {
    Posed& posed = posed_[i];
    TimedSolve timed = solve_timed(optimiser_, posed.problem, posed.initial, context_);
    note(timed, solve);
    if (solve.repeats == 1 && timed.solution) posed.found = std::move(timed.solution->trajectory);
  }
  void judge(std::size_t i, SolveRecord& solve) {
    const Posed& posed = posed_[i];
    solve.ends_free = are_ends_free(problems_, solve.scene, posed.problem);
    if (!solve.solved) return;
    solve.exact_clearance_m = exact_clearance_m(problems_, solve.scene, posed.found);
    solve.clearance_at_checks_m =
        clearance_at_checks_m(posed.problem, *fields_.of(solve.scene, true), posed.found);
  }

 private:
  struct Posed {
    Problem problem;
    Trajectory initial;
    Trajectory found;
  };
  const RecordedProblems& problems_;
  RecordedFields& fields_;
  const ExperimentContext& context_;
  PluginPtr<Optimiser> optimiser_;
  std::vector<Posed> posed_;
};

/// One recorded run. Costs and times are of the problems that are solved.
struct RunRow {
  const RecordedSeries& run;
  const std::vector<SolveRecord>& solves;
  bool costs_comparable;
  std::vector<SolveRecord> solved = those_of(solves, &SolveRecord::solved);
  std::vector<SolveRecord> with_free_ends = those_of(solves, &SolveRecord::ends_free);
  /// Of which the recording counts the peer's iterations.
  std::vector<SolveRecord> counted =
      those_of(solves, [](const SolveRecord& s) { return s.peer.iterations >= 0; });
  /// Where ours and the peer's costs are measured alike; nothing where they are not.
  std::vector<SolveRecord> comparable = costs_comparable ? solved : std::vector<SolveRecord>();

  [[nodiscard]] const std::vector<SolveRecord>& all() const { return solves; }
};

/// A number of each of some problems of a row.
template <class Some, class Value>
auto of_each(Some some, Value value) {
  return [=](const RunRow& row) { return values_of(std::invoke(some, row), value); };
}
template <class Some, class Holds>
auto share_among(Some some, Holds holds) {
  return [=](const RunRow& row) { return share_of(std::invoke(some, row), holds); };
}

bool is_peer_free(const SolveRecord& s) { return s.peer.free_exactly; }

Json share_no_costlier(const RunRow& row) {
  if (row.comparable.empty()) return nullptr;
  return share_of(row.solves, [](const SolveRecord& s) {
    return s.solved && s.cost <= kOnePercent * s.peer.final_cost;
  });
}

const ResultColumnsOf<RunRow>& recorded_runs() {
  using R = RunRow;
  using S = SolveRecord;
  static const auto kColumns =
      ResultColumnsOf<R>("/runs")
          .add("label", [](const R& r) { return r.run.label; }, "Run of the recording.",
               {.heading = "rules", .compared = true})
          .add("field", [](const R& r) { return r.run.is_signed ? "sdf" : "usdf"; },
               "Kind of field: `sdf` or `usdf`.", {.heading = "field", .compared = true})
          .table("Time",
                 "An iteration is an accepted step with the damping attempts before it. The peer's "
                 "times are those that were recorded, on its machine.")
          .add(
              "relative_tolerance", [](const R& r) { return r.run.relative_tolerance; },
              "Relative decrease of the cost at which a solve ends.")
          .add(
              "max_iterations", [](const R& r) { return r.run.max_iterations; },
              "Iterations at which it ends.")
          .add("problems", [](const R& r) { return r.solves.size(); }, "Problems of the run.",
               {.heading = "problems", .pattern = "%.0f"})
          .add("solved", [](const R& r) { return r.solved.size(); }, "Problems with a trajectory.",
               {.heading = "solved", .pattern = "%.0f"})
          .spread("lm_iteration_us.", of_each(&R::solved, &S::iteration_us),
                  "Wall time of an accepted iteration.", {"p50", "p95"},
                  {.heading = "iteration", .pattern = "%.1f us", .compared = true})
          .spread("solve_ms.", of_each(&R::solved, &S::solve_ms), "Wall time of a solve.",
                  {"p50", "p95", "mean"},
                  {.heading = "solve", .pattern = "%.4f ms", .compared = true})
          .spread("iterations.", of_each(&R::solved, &S::accepted_iterations),
                  "Accepted iterations.", {"mean", "sd"},
                  {.heading = "iterations", .pattern = "%.2f", .compared = true})
          .spread("peer.lm_iteration_us.",
                  of_each(&R::counted,
                          [](const S& s) {
                            return 1e3 * s.peer.optimise_ms / std::max(1, s.peer.iterations);
                          }),
                  "The peer's, as recorded.", {"p50", "p95"},
                  {.heading = "peer's iteration", .pattern = "%.0f us", .page_only = true})
          .spread("peer.solve_ms.", of_each(&R::all, [](const S& s) { return s.peer.total_ms; }),
                  "The peer's, as recorded.", {"p50", "p95", "mean"},
                  {.heading = "peer's solve", .pattern = "%.2f ms", .page_only = true})
          .spread("peer.iterations.",
                  of_each(&R::counted, [](const S& s) { return s.peer.iterations; }),
                  "The peer's, as recorded.", {"mean", "sd"},
                  {.heading = "peer's iterations", .pattern = "%.2f", .page_only = true})
          .table("Costs and collisions")
          .add("cost.share_within_1pct", &share_no_costlier,
               "Share of all problems that cost at most 1 % more than the peer's.",
               {.heading = "within 1 % or below", .pattern = "%.4f", .compared = true})
          .spread("cost.", of_each(&R::solved, &S::cost), "Final cost.", {"mean", "median"},
                  {.heading = "cost", .pattern = "%.6g"})
          .spread("cost.peer_",
                  of_each(&R::comparable, [](const S& s) { return s.peer.final_cost; }),
                  "The peer's, as recorded.", {"mean", "median"},
                  {.heading = "peer's cost", .pattern = "%.6g"})
          .add("collision_free.share", share_among(&R::all, &S::is_free),
               "Share of all problems with a trajectory free of collisions, by exact distances.",
               {.heading = "collision-free", .pattern = "%.4f", .compared = true})
          .add("collision_free.peer_share", share_among(&R::all, &is_peer_free), "The peer's.",
               {.heading = "peer's", .pattern = "%.4f"})
          .add("free_ends.problems", [](const R& r) { return r.with_free_ends.size(); },
               "Problems whose start and goal touch nothing.",
               {.heading = "ends free", .pattern = "%.0f"})
          .add("free_ends.share", share_among(&R::with_free_ends, &S::is_free),
               "Share of these that is free of collisions.",
               {.heading = "of them free", .pattern = "%.4f"})
          .add("free_ends.peer_share", share_among(&R::with_free_ends, &is_peer_free),
               "The peer's.", {.heading = "peer's", .pattern = "%.4f"})
          .add("free_at_checks.share", share_among(&R::all, &S::free_at_checks),
               "Share that is free at the states that the peer checks.",
               {.heading = "free at the checked states", .pattern = "%.4f", .page_only = true})
          .add("free_at_checks.peer_share",
               share_among(&R::all, [](const S& s) { return s.peer.free_at_checks; }),
               "The peer's.", {.heading = "peer's", .pattern = "%.4f", .page_only = true});
  return kColumns;
}

std::string verdict_text(const RecordedHead& head, bool costs_comparable, const SolveCount& count) {
  const std::string solves = "solves by " + head.optimiser;
  const std::string failure = count.failure(solves);
  if (!count.complete() || count.fault) return failure;
  const std::string note =
      costs_comparable
          ? ""
          : " The peer's state is a Lie group here, the optimiser's is not: costs are not "
            "comparable.";
  if (!failure.empty()) return failure + note;
  return "Success: " + std::to_string(count.problems) + " " + solves + " on the problems of " +
         head.problems_file + ", each with a trajectory." + note;
}

/// What the charts show of one run: decimal logarithms, one a problem.
struct PlannerSeries {
  std::string label;
  std::vector<double> cost;
  std::vector<double> peer_cost;
  std::vector<double> solve_ms;
  std::vector<double> peer_solve_ms;
};

constexpr double kWidth = 900.0;
constexpr double kHeight = 460.0;
constexpr std::array kColours = {palette::kBlue,   palette::kOrange, palette::kGreen,
                                 palette::kPurple, palette::kSky,    palette::kVermilion};

Colour colour_of(std::size_t run) { return kColours[run % kColours.size()]; }

/// Decimal logarithms; what has none counts as 1e-12.
std::vector<double> logarithms(const std::vector<double>& values) {
  std::vector<double> logs;
  for (const double value : values) logs.push_back(std::log10(std::max(value, 1e-12)));
  return logs;
}

/// Of two members of every run.
Range range_of(const std::vector<PlannerSeries>& runs, std::vector<double> PlannerSeries::*ours,
               std::vector<double> PlannerSeries::*peers) {
  Range range{INFINITY, -INFINITY};
  for (const PlannerSeries& run : runs) {
    for (const double value : run.*ours) range.include(value);
    for (const double value : run.*peers) range.include(value);
  }
  return range.lower <= range.upper ? range.padded(0.04) : Range{};
}

Figure cost_figure(const std::vector<PlannerSeries>& runs) {
  Figure figure{"planner_costs",
                "Final cost of each problem against the peer's, both as decimal logarithms; on the "
                "line they are equal, below it ours is lower.",
                Canvas(kWidth, kHeight)};
  const Range range = range_of(runs, &PlannerSeries::cost, &PlannerSeries::peer_cost);
  Axes axes(figure.canvas, {0.0, 0.0, kWidth, kHeight - 30.0}, range, range,
            {"Cost", "log10 of the peer's cost", "log10 of the cost"});
  axes.grid();
  axes.line({range.lower, range.upper}, {range.lower, range.upper},
            {palette::kGrey, 1.0, {5.0, 4.0}});
  std::vector<LegendEntry> legend;
  for (std::size_t r = 0; r < runs.size(); ++r) {
    const PlannerSeries& run = runs[r];
    for (std::size_t i = 0; i < std::min(run.cost.size(), run.peer_cost.size()); ++i) {
      const Point at = axes.at(run.peer_cost[i], run.cost[i]);
      figure.canvas.circle(at, 2.2, colour_of(r).with_alpha(0.5));
    }
    legend.push_back({run.label, LegendEntry::Mark::kBox, {colour_of(r), 1.0, {}}});
  }
  axes.finish();
  draw_legend(figure.canvas, {58.0, kHeight - 26.0}, kWidth - 60.0, legend);
  return figure;
}

Figure time_figure(const std::vector<PlannerSeries>& runs) {
  Figure figure{"planner_times",
                "Share of the problems that are solved within a time (decimal logarithm of "
                "milliseconds); dashed: the peer's CPU times, as recorded.",
                Canvas(kWidth, kHeight)};
  const Range range = range_of(runs, &PlannerSeries::solve_ms, &PlannerSeries::peer_solve_ms);
  Axes axes(figure.canvas, {0.0, 0.0, kWidth, kHeight - 30.0}, range, {0.0, 1.0},
            {"Time of a solve", "log10 of ms", "share of problems"});
  axes.grid();
  std::vector<LegendEntry> legend;
  for (std::size_t r = 0; r < runs.size(); ++r) {
    const Stroke stroke{colour_of(r), 1.6, {}};
    axes.shares(runs[r].solve_ms, runs[r].solve_ms.size(), stroke);
    axes.shares(runs[r].peer_solve_ms, runs[r].peer_solve_ms.size(),
                {colour_of(r), 1.2, {4.0, 3.0}});
    legend.push_back({runs[r].label, LegendEntry::Mark::kLine, stroke});
  }
  axes.finish();
  draw_legend(figure.canvas, {58.0, kHeight - 26.0}, kWidth - 60.0, legend);
  return figure;
}

Result<std::vector<PlannerSeries>> series_of(const Json& runs, ResultsReader& results) {
  std::vector<PlannerSeries> all;
  for (std::size_t item = 0; item < runs.size(); ++item) {
    PlannerSeries series;
    series.label = cell(at(runs[item], "/label")) + ", " + cell(at(runs[item], "/field"));
    for (const auto& [key, values] : {std::pair("cost", &series.cost),
                                      {"peer_cost", &series.peer_cost},
                                      {"solve_ms", &series.solve_ms},
                                      {"peer_solve_ms", &series.peer_solve_ms}}) {
      *values = logarithms(SIDESTEP_TRY(results.column("solve/" + std::to_string(item), key)));
    }
    all.push_back(std::move(series));
  }
  return all;
}

Result<std::string> recorded_body(const Json& summary, ResultsReader& results,
                                  const std::filesystem::path& run) {
  const Json runs = at(summary, "/runs");
  const auto series = SIDESTEP_TRY(series_of(runs, results));
  const bool costs_comparable = at(summary, "/costs_comparable") != Json(false);
  std::string html = sentence_of(summary) + ".</p>\n" + recorded_runs().html(runs);
  if (!costs_comparable) {
    html +=
        "<p>The peer's state is a Lie group here, the optimiser's is not: its costs are no measure "
        "of ours.</p>\n";
  }
  std::vector<Figure> figures;
  if (!series.empty() && costs_comparable) figures.push_back(cost_figure(series));
  if (!series.empty()) figures.push_back(time_figure(series));
  const auto section = SIDESTEP_TRY(figure_section(figures, run));
  return html + section;
}

/// What the store in the folder `run` comes to.
Result<ExperimentOutcome> conclude_recorded(const std::filesystem::path& run, bool stopped,
                                            const std::optional<Error>& fault) {
  const auto record = SIDESTEP_TRY(read_recorded<SolveRecord>(run / "results.sqlite"));
  const bool costs_comparable =
      at(Json::parse(record.about, nullptr, false), "/costs_comparable") != Json(false);
  const SolveCount count = count_solves(record, stopped, fault);
  Json runs = Json::array();
  std::size_t problems = 0;
  for (std::size_t s = 0; s < record.series.size(); ++s) {
    runs.push_back(recorded_runs().row({record.series[s], record.solves[s], costs_comparable}));
    problems = std::max(problems, record.solves[s].size());
  }
  return summarise_solves(record, "recorded_benchmark", count,
                          verdict_text(record, costs_comparable, count), recorded_runs(),
                          {{"problems", problems}, {"runs", runs}});
}

class RecordedBenchmark final : public Experiment {
 public:
  [[nodiscard]] ExperimentFacts facts() const override {
    return {.blocks = {"optimiser"}, .set_of_optimiser = kSetOfOptimiser, .is_divisible = true};
  }
  [[nodiscard]] const report::RunReport& report() const override {
    static const RunReport kReport = {
        .body = &recorded_body,
        .columns = &recorded_runs(),
        .compared_of_run = {{"optimiser", "/optimiser"}, {"problems", "/problems_file"}},
        .pictures = {"planner_"}};
    return kReport;
  }
  void check(const Configuration& configuration, Host& host,
             std::vector<Error>& errors) const override {
    check_recorded<RecordedBenchmarkSettings>(configuration, kSetOfOptimiser, host, errors);
  }
  [[nodiscard]] Result<ExperimentOutcome> run(ExperimentContext& context) const override {
    const auto settings =
        SIDESTEP_TRY(read_block<RecordedBenchmarkSettings>(context.configuration, "experiment"));
    auto start = SIDESTEP_TRY(start_recorded(context, settings, {""}));
    const Node& block = block_of(context.configuration, "optimiser");
    const Node* const prior = block.find("base_prior");
    // The peer's state is a Lie group where there is a base.
    const bool is_comparable =
        !start.problems.has_base || (prior != nullptr && prior->text() == "body");
    start.head.about = Json{{"costs_comparable", is_comparable}}.dump();
    RecordedFields fields(start.problems);
    const auto make = [&](const RecordedSeries&, const RecordedRun& run,
                          const std::vector<SolveRecord>& solves) -> Result<RunSolver> {
      auto optimiser =
          SIDESTEP_TRY(context.host.create<Optimiser>(block_for(block, run), start.problems.robot));
      return RunSolver(run, solves, std::move(optimiser), start.problems, fields, context);
    };
    return run_recorded<SolveRecord>(context, start, make, &conclude_recorded);
  }
  [[nodiscard]] Result<ExperimentOutcome> merge(const std::vector<std::filesystem::path>& shards,
                                                const std::filesystem::path& out) const override {
    SIDESTEP_TRY(merge_recorded(shards, out));
    return conclude_recorded(out, false, std::nullopt);
  }
};

}  // namespace
}  // namespace sidestep

SIDESTEP_EXPERIMENT(sidestep::RecordedBenchmark, sidestep::RecordedBenchmarkSettings,
                    "recorded_benchmark", "0.1.0",
                    "An optimiser on problems that a peer has solved: time, cost, collisions")
