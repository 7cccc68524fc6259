#include "planners/planner_summary.hpp"

#include <algorithm>
#include <array>

#include "planners/ompl_database.hpp"
#include "report/csv.hpp"
#include "report/report_parts.hpp"
#include "results/json.hpp"
#include "results/summary_values.hpp"

namespace sidestep {
namespace {

using Json = nlohmann::ordered_json;

/// One row: a planner on some problems.
Json row_json(const PlannerRecord& planner, const std::string& family,
              const std::vector<SetSolve>& solves) {
  const auto solved = those_of(solves, &SetSolve::is_solved);
  const auto within = [&](double limit_ms) {
    return share_of(solves,
                    [&](const SetSolve& s) { return s.is_solved() && s.first_ms() <= limit_ms; });
  };
  const auto median_of = [&](auto value) {
    return Json{{"p50", quantile_json(values_of(solved, value), 0.5)}};
  };
  std::set<std::int64_t> problems;
  for (const SetSolve& solve : solves) problems.insert(solve.problem);
  return {
      {"name", planner.name},
      {"checker", planner.checker},
      {"family", family},
      {"problems", problems.size()},
      {"answers", solves.size()},
      {"solved_share", {{"s1", within(1e3)}, {"s5", within(5e3)}}},
      {"smooth_share",
       share_of(solves, [](const SetSolve& s) { return s.is_solved() && s.is_smooth(); })},
      {"time_ms", quantiles_json(values_of(solved, [](const SetSolve& s) { return s.time_ms(); }))},
      {"first_valid_ms",
       quantiles_json(values_of(solved, [](const SetSolve& s) { return s.first_ms(); }))},
      {"path_length_rad", median_of([](const SetSolve& s) { return s.path_length(); })},
      {"duration_s", median_of([](const SetSolve& s) { return s.duration_s; })},
      {"acceleration_ratio", median_of([](const SetSolve& s) { return s.acceleration_ratio; })},
      {"clearance_m", median_of([](const SetSolve& s) { return s.clearance_m; })},
      {"refused_by_check",
       std::ranges::count_if(solves, [](const SetSolve& s) { return !s.refusal.empty(); })}};
}

std::vector<std::string> families_of(const PlannerRecord& planner) {
  std::vector<std::string> families;
  for (const SetSolve& solve : planner.solves) {
    if (std::ranges::find(families, solve.family) == families.end())
      families.push_back(solve.family);
  }
  return families;
}

Json family_rows(const PlannerBenchmarkRecord& record) {
  Json rows = Json::array();
  for (const PlannerRecord& planner : record.planners) {
    for (const std::string& family : families_of(planner)) {
      rows.push_back(row_json(planner, family, those_of(planner.solves, [&](const SetSolve& s) {
                                return s.family == family;
                              })));
    }
  }
  return rows;
}

std::string table_text(const Json& rows) {
  return report::text_table({{"planner", "/name"},
                             {"checker", "/checker"},
                             {"family", "/family"},
                             {"answers", "/answers", "%.0f"},
                             {"solved in 1 s", "/solved_share/s1", "%.4f"},
                             {"in 5 s", "/solved_share/s5", "%.4f"},
                             {"smooth", "/smooth_share", "%.4f"},
                             {"first p50", "/first_valid_ms/p50", "%.3f ms"},
                             {"time p50", "/time_ms/p50", "%.3f ms"},
                             {"p95", "/time_ms/p95", "%.2f ms"},
                             {"path p50", "/path_length_rad/p50", "%.2f rad"},
                             {"motion p50", "/duration_s/p50", "%.2f s"},
                             {"acceleration p50", "/acceleration_ratio/p50", "%.2f"},
                             {"clearance p50", "/clearance_m/p50", "%.3f m"},
                             {"refused", "/refused_by_check", "%.0f"}},
                            rows);
}

std::string table_csv(const Json& rows) {
  constexpr std::array kColumns = {"/name",
                                   "/checker",
                                   "/family",
                                   "/problems",
                                   "/answers",
                                   "/solved_share/s1",
                                   "/solved_share/s5",
                                   "/smooth_share",
                                   "/first_valid_ms/p50",
                                   "/first_valid_ms/p95",
                                   "/time_ms/p50",
                                   "/time_ms/p95",
                                   "/path_length_rad/p50",
                                   "/duration_s/p50",
                                   "/acceleration_ratio/p50",
                                   "/clearance_m/p50",
                                   "/refused_by_check"};
  return csv_text(rows, kColumns);
}

std::string verdict_text(const PlannerBenchmarkRecord& record, bool interrupted,
                         std::ptrdiff_t refused, const std::optional<Error>& fault) {
  const std::string of = " answers to the problems of " + record.problems;
  const std::string count =
      std::to_string(record.solved()) + " of " + std::to_string(record.planned()) + of;
  if (fault) return "Ended early, after " + count + ": " + fault->describe();
  if (interrupted) {
    return "Interrupted after " + count + "; what was measured is saved, --resume goes on.";
  }
  const std::string part =
      record.shard.is_whole() ? "" : "Shard " + shard_name(record.shard) + ": ";
  if (refused > 0) {
    return part + "Failed: the independent check refuses " + std::to_string(refused) + " of " +
           count + ".";
  }
  if (record.solved() < record.planned()) return part + "Incomplete: " + count + ".";
  return part + "Success: " + std::to_string(record.solved()) + of +
         ", none refused by the independent check.";
}

}  // namespace

ExperimentOutcome summarise_planners(const PlannerBenchmarkRecord& record, bool interrupted,
                                     const std::optional<Error>& fault) {
  Json planners = Json::array();
  std::ptrdiff_t refused = 0;
  for (const PlannerRecord& planner : record.planners) {
    planners.push_back(row_json(planner, "all", planner.solves));
    refused += planners.back()["refused_by_check"].get<std::ptrdiff_t>();
  }
  const Json families = family_rows(record);
  const bool complete = record.solved() == record.planned();
  ExperimentOutcome outcome;
  outcome.fault = fault;
  outcome.interrupted = interrupted && !complete;
  outcome.success = complete && !fault && refused == 0;
  outcome.verdict = verdict_text(record, outcome.interrupted, refused, fault);
  Json rows = planners;
  for (const Json& family : families) rows.push_back(family);
  outcome.table = table_text(rows);
  outcome.table_csv = table_csv(rows);
  double wall_s = 0.0, cpu_s = 0.0;
  for (const RunSession& session : record.sessions) {
    wall_s += session.wall_s;
    cpu_s += session.cpu_s;
  }
  const Json shard = record.shard.is_whole()
                         ? Json(nullptr)
                         : Json{{"index", record.shard.index + 1}, {"count", record.shard.count}};
  outcome.summary_json = summary_text(
      record.provenance, "planner_benchmark", outcome,
      {{"fault", fault ? Json(fault->describe()) : Json(nullptr)},
       {"complete", complete},
       {"shard", shard},
       {"problems_file", record.problems},
       {"robot", record.robot},
       {"deadline_s", record.deadline_s},
       {"seeds", record.seeds},
       {"planners", planners},
       {"families", families},
       {"time", {{"sessions", record.sessions.size()}, {"wall_s", wall_s}, {"cpu_s", cpu_s}}}});
  return outcome;
}

Result<ExperimentOutcome> conclude_planners(const std::filesystem::path& run, bool interrupted,
                                            const std::optional<Error>& fault) {
  const auto record = read_planner_record(run / "results.sqlite");
  if (!record) return error_of(record);
  auto written = write_ompl_database(*record, run / kOmplDatabase);
  if (!written) return error_of(written);
  return summarise_planners(*record, interrupted, fault);
}

Result<ExperimentOutcome> merge_planners(const std::vector<std::filesystem::path>& runs,
                                         const std::filesystem::path& out) {
  auto whole = merged_record(runs, &read_planner_record, &absorb_planners);
  if (!whole) return error_of(whole);
  for (const std::filesystem::path& run : runs) {
    const auto part = read_planner_record(run / "results.sqlite");
    if (part && part->names == whole->names) continue;
    return fail(ErrorCode::kConfig, "this shard is of other problems than the first", run.string());
  }
  return conclude_whole(*whole, out, &record_planners, &conclude_planners);
}

}  // namespace sidestep
