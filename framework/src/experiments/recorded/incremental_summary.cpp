#include "recorded/incremental_summary.hpp"

#include <algorithm>

#include "report/csv.hpp"
#include "report/report_parts.hpp"
#include "results/json.hpp"
#include "results/summary_values.hpp"

namespace sidestep {
namespace {

using report::at;
using report::cell;
using Json = nlohmann::ordered_json;

constexpr std::size_t kAfresh = static_cast<std::size_t>(SolveWay::kAfresh);

/// One way through a series; times, iterations and costs are of the problems solved in every way.
Json row_of(const ChangedSeries& series, std::size_t way) {
  const auto solved = those_of(series.problems, &ChangedSolve::solved);
  const auto with_free_ends = those_of(series.problems, &ChangedSolve::ends_free);
  const auto is_free = [way](const ChangedSolve& r) { return r.ways[way].is_free(); };
  const auto solve_ms = values_of(solved, [&](const auto& r) { return r.ways[way].solve_ms; });
  const auto afresh_ms = values_of(solved, [](const auto& r) { return r.ways[kAfresh].solve_ms; });
  const auto time_ratio = values_of(
      solved, [&](const auto& r) { return r.ways[way].solve_ms / r.ways[kAfresh].solve_ms; });
  const auto cost_ratio =
      values_of(solved, [&](const auto& r) { return r.ways[way].cost / r.ways[kAfresh].cost; });
  const auto iterations =
      values_of(solved, [&](const auto& r) { return r.ways[way].accepted_iterations; });
  const double sum_ratio = statistics_of(solve_ms).mean / statistics_of(afresh_ms).mean;
  return {{"label", series.label},
          {"field", series.is_signed ? "sdf" : "usdf"},
          {"change", series.change},
          {"way", to_string(kSolveWays[way])},
          {"problems", series.problems.size()},
          {"solved", solved.size()},
          {"solve_ms", quantiles_and_mean_json(solve_ms)},
          {"time_ratio",
           {{"p50", quantile_json(time_ratio, 0.5)},
            {"p95", quantile_json(time_ratio, 0.95)},
            {"of_means", solved.empty() ? Json(nullptr) : Json(sum_ratio)}}},
          {"iterations", quantiles_and_mean_json(iterations)},
          {"cost_ratio",
           {{"p05", quantile_json(cost_ratio, 0.05)},
            {"p50", quantile_json(cost_ratio, 0.5)},
            {"p95", quantile_json(cost_ratio, 0.95)},
            {"share_within_1pct", share_of(solved,
                                           [way](const ChangedSolve& r) {
                                             return r.ways[way].cost <=
                                                    kOnePercent * r.ways[kAfresh].cost;
                                           })}}},
          {"collision_free", {{"share", share_of(series.problems, is_free)}}},
          {"free_ends",
           {{"problems", with_free_ends.size()}, {"share", share_of(with_free_ends, is_free)}}}};
}

std::string table_text(const Json& rows) {
  return report::text_table({{"run", "/label"},
                             {"field", "/field"},
                             {"change", "/change"},
                             {"way", "/way"},
                             {"problems", "/problems", "%.0f"},
                             {"solve p50", "/solve_ms/p50", "%.4f ms"},
                             {"p95", "/solve_ms/p95", "%.4f ms"},
                             {"mean", "/solve_ms/mean", "%.4f ms"},
                             {"of afresh's p50", "/time_ratio/p50", "%.3f"},
                             {"of means", "/time_ratio/of_means", "%.3f"},
                             {"iterations", "/iterations/mean", "%.2f"},
                             {"cost p50", "/cost_ratio/p50", "%.4f"},
                             {"p95", "/cost_ratio/p95", "%.4f"},
                             {"within 1 %", "/cost_ratio/share_within_1pct", "%.4f"},
                             {"collision-free", "/collision_free/share", "%.4f"},
                             {"ends free", "/free_ends/problems", "%.0f"},
                             {"of them", "/free_ends/share", "%.4f"}},
                            rows);
}

std::string table_csv(const Json& rows) {
  constexpr std::array kColumns = {"/label",
                                   "/field",
                                   "/change",
                                   "/way",
                                   "/problems",
                                   "/solved",
                                   "/solve_ms/p50",
                                   "/solve_ms/p95",
                                   "/solve_ms/mean",
                                   "/time_ratio/p50",
                                   "/time_ratio/p95",
                                   "/time_ratio/of_means",
                                   "/iterations/p50",
                                   "/iterations/p95",
                                   "/iterations/mean",
                                   "/cost_ratio/p05",
                                   "/cost_ratio/p50",
                                   "/cost_ratio/p95",
                                   "/cost_ratio/share_within_1pct",
                                   "/collision_free/share",
                                   "/free_ends/problems",
                                   "/free_ends/share"};
  return csv_text(rows, kColumns);
}

std::string verdict_text(const IncrementalRecord& record, const Json& rows, std::size_t problems,
                         std::size_t unsolved, const std::string& first_reason) {
  const std::string count =
      std::to_string(problems) + " changed problems by " + record.about.optimiser;
  if (record.interrupted) return "Interrupted after " + count + "; what was measured is saved.";
  if (unsolved > 0) {
    return "Failed: " + std::to_string(unsolved) + " of " + count +
           " came to nothing in some way, the first because: " + first_reason + ".";
  }
  std::string text = "Success: " + count + ", each with a trajectory in every way.";
  for (const Json& row : rows) {
    if (at(row, "/way") != Json(to_string(SolveWay::kIncremental))) continue;
    text += " " + cell(at(row, "/label")) + ", " + cell(at(row, "/field")) + ", other " +
            cell(at(row, "/change")) + ": incrementally in " +
            cell(at(row, "/time_ratio/p50"), "%.2f") + " of the time of solving afresh (median).";
  }
  return text;
}

}  // namespace

std::string_view to_string(SolveWay way) noexcept {
  switch (way) {
    case SolveWay::kAfresh: return "afresh";
    case SolveWay::kWarm: return "warm";
    case SolveWay::kIncremental: break;
  }
  return "incremental";
}

bool ChangedSolve::solved() const noexcept {
  return std::ranges::all_of(ways, &RecordedSolve::solved);
}

ExperimentOutcome summarise_incremental(const RunProvenance& provenance,
                                        const IncrementalSettings& settings,
                                        const IncrementalRecord& record) {
  Json rows = Json::array();
  std::size_t problems = 0, unsolved = 0;
  std::string first_reason;
  for (const ChangedSeries& series : record.series) {
    for (std::size_t way = 0; way < kSolveWays.size(); ++way) rows.push_back(row_of(series, way));
    for (const ChangedSolve& problem : series.problems) {
      ++problems;
      if (problem.solved()) continue;
      if (unsolved++ > 0) continue;
      first_reason = std::ranges::find(problem.ways, false, &RecordedSolve::solved)->reason;
    }
  }
  ExperimentOutcome outcome;
  outcome.interrupted = record.interrupted;
  outcome.success = !record.interrupted && problems > 0 && unsolved == 0;
  outcome.verdict = verdict_text(record, rows, problems, unsolved, first_reason);
  outcome.table = table_text(rows);
  outcome.table_csv = table_csv(rows);
  outcome.summary_json = summary_text(provenance, settings.type, outcome,
                                      {{"problems_file", record.about.problems_file},
                                       {"robot", record.about.robot},
                                       {"optimiser", record.about.optimiser},
                                       {"repeats", settings.repeats},
                                       {"goal_sd", settings.goal_sd},
                                       {"obstacle_sd_m", settings.obstacle_sd_m},
                                       {"problems", problems},
                                       {"rows", rows}});
  return outcome;
}

}  // namespace sidestep
