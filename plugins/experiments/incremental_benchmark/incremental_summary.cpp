#include "incremental_summary.hpp"

#include <algorithm>

#include <sidestep/report/report_parts.hpp>
#include <sidestep/results/summary.hpp>

namespace sidestep {
namespace {

using report::at;
using report::cell;
using report::Json;

/// One way through a series. Times, iterations and costs are of the problems solved in every way.
struct WayRow {
  const ChangedSeries& series;
  std::size_t way;
  std::vector<ChangedSolve> solved = those_of(series.problems, &ChangedSolve::solved);
  std::vector<ChangedSolve> with_free_ends = those_of(series.problems, &ChangedSolve::ends_free);

  [[nodiscard]] bool is_free(const ChangedSolve& solve) const { return solve.ways[way].is_free(); }
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
  const auto mean_ms = [&](std::size_t way) {
    return statistics_of(values_of(row.solved, [&](const auto& s) { return s.ways[way].solve_ms; }))
        .mean;
  };
  return mean_ms(row.way) / mean_ms(kAfresh);
}

Json share_no_costlier(const WayRow& row) {
  return share_of(row.solved, [&](const ChangedSolve& s) {
    return s.ways[row.way].cost <= kOnePercent * s.ways[kAfresh].cost;
  });
}

const report::ResultColumnsOf<WayRow>& way_rows() {
  using R = WayRow;
  using S = RecordedSolve;
  static const auto kColumns =
      report::ResultColumnsOf<R>("/rows")
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
          .add("collision_free.share",
               [](const R& r) {
                 return share_of(r.series.problems,
                                 [&](const ChangedSolve& s) { return r.is_free(s); });
               },
               "Share of all problems with a trajectory free of collisions, by exact distances.",
               {.heading = "collision-free", .pattern = "%.4f", .compared = true})
          .add("free_ends.problems", [](const R& r) { return r.with_free_ends.size(); },
               "Problems whose start and goal touch nothing.",
               {.heading = "ends free", .pattern = "%.0f"})
          .add("free_ends.share",
               [](const R& r) {
                 return share_of(r.with_free_ends,
                                 [&](const ChangedSolve& s) { return r.is_free(s); });
               },
               "Share of these that is free of collisions.",
               {.heading = "of them free", .pattern = "%.4f"});
  return kColumns;
}

std::string verdict_text(const IncrementalRecord& record, const Json& rows,
                         const SolveCount& count) {
  std::string text = count.failure(record.about, "changed problems", "came to nothing in some way");
  if (!text.empty()) return text;
  text = "Success: " + std::to_string(count.problems) + " changed problems by " +
         record.about.optimiser + ", each with a trajectory in every way.";
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

}  // namespace

bool ChangedSolve::solved() const noexcept {
  return std::ranges::all_of(ways, &RecordedSolve::solved);
}

ExperimentOutcome summarise_incremental(const RunProvenance& provenance,
                                        const IncrementalSettings& settings,
                                        const IncrementalRecord& record) {
  Json rows = Json::array();
  SolveCount count;
  for (const ChangedSeries& series : record.series) {
    for (std::size_t way = 0; way < kSolveWays.size(); ++way)
      rows.push_back(way_rows().row({series, way}));
    for (const ChangedSolve& problem : series.problems) {
      const auto unsolved = std::ranges::find(problem.ways, false, &RecordedSolve::solved);
      const bool is_solved = unsolved == problem.ways.end();
      count.add(is_solved, is_solved ? "" : unsolved->reason);
    }
  }
  return summarise_solves(provenance, settings.type, record.about, count,
                          verdict_text(record, rows, count), way_rows(),
                          {{"repeats", settings.repeats},
                           {"goal_sd", settings.goal_sd},
                           {"obstacle_sd_m", settings.obstacle_sd_m},
                           {"problems", count.problems},
                           {"rows", rows}});
}

const report::RunReport& incremental_report() {
  static const report::RunReport kReport = {.body = &incremental_body,
                                            .columns = &way_rows(),
                                            .compared_of_run = {{"problems", "/problems_file"}}};
  return kReport;
}

}  // namespace sidestep
