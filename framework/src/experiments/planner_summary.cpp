#include "planner_summary.hpp"

#include <array>

#include "csv.hpp"
#include "json.hpp"
#include "report_parts.hpp"
#include "summary_values.hpp"

namespace sidestep {
namespace {

using Json = nlohmann::ordered_json;

/// One row: a planner on some problems.
Json row_json(const PlannerRecord& planner, const std::string& family,
              const std::vector<SetSolve>& solves) {
  const auto solved = those_of(solves, &SetSolve::is_solved);
  const auto within = [&](double limit_ms) {
    return share_of(solves,
                    [&](const SetSolve& s) { return s.is_solved() && s.time_ms <= limit_ms; });
  };
  return {
      {"name", planner.name},
      {"checker", planner.checker},
      {"family", family},
      {"problems", solves.size()},
      {"solved_share", {{"s1", within(1e3)}, {"s5", within(5e3)}}},
      {"smooth_share",
       share_of(solves, [](const SetSolve& s) { return s.is_solved() && s.is_smooth; })},
      {"time_ms", quantiles_json(values_of(solved, [](const SetSolve& s) { return s.time_ms; }))},
      {"path_length_rad",
       {{"p50",
         quantile_json(values_of(solved, [](const SetSolve& s) { return s.path_length; }), 0.5)}}},
      {"duration_s",
       {{"p50",
         quantile_json(values_of(solved, [](const SetSolve& s) { return s.duration_s; }), 0.5)}}},
      {"clearance_m",
       {{"p50",
         quantile_json(values_of(solved, [](const SetSolve& s) { return s.clearance_m; }), 0.5)}}},
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

const report::Columns& columns() {
  static const report::Columns kColumns = {{"planner", "/name"},
                                           {"checker", "/checker"},
                                           {"family", "/family"},
                                           {"problems", "/problems", "%.0f"},
                                           {"solved in 1 s", "/solved_share/s1", "%.4f"},
                                           {"in 5 s", "/solved_share/s5", "%.4f"},
                                           {"smooth", "/smooth_share", "%.4f"},
                                           {"time p50", "/time_ms/p50", "%.3f ms"},
                                           {"p95", "/time_ms/p95", "%.2f ms"},
                                           {"path p50", "/path_length_rad/p50", "%.2f rad"},
                                           {"motion p50", "/duration_s/p50", "%.2f s"},
                                           {"clearance p50", "/clearance_m/p50", "%.3f m"},
                                           {"refused", "/refused_by_check", "%.0f"}};
  return kColumns;
}

}  // namespace

ExperimentOutcome summarise_planners(const RunProvenance& provenance,
                                     const PlannerBenchmarkRecord& record) {
  Json planners = Json::array(), families = Json::array();
  std::size_t solves = 0;
  std::ptrdiff_t refused = 0;
  for (const PlannerRecord& planner : record.planners) {
    planners.push_back(row_json(planner, "all", planner.solves));
    solves += planner.solves.size();
    refused += planners.back()["refused_by_check"].get<std::ptrdiff_t>();
    for (const std::string& family : families_of(planner)) {
      families.push_back(row_json(planner, family, those_of(planner.solves, [&](const SetSolve& s) {
                                    return s.family == family;
                                  })));
    }
  }
  ExperimentOutcome outcome;
  outcome.interrupted = record.interrupted;
  outcome.success = !record.interrupted && solves > 0 && refused == 0;
  const std::string count =
      std::to_string(solves) + " answers to the problems of " + record.problems;
  outcome.verdict =
      record.interrupted ? "Interrupted after " + count + "; what was measured is saved."
      : refused > 0 ? "Failed: the independent check refuses " + std::to_string(refused) + " of " +
                          count + "."
                    : "Success: " + count + ", none refused by the independent check.";
  Json rows = planners;
  for (const Json& family : families) rows.push_back(family);
  outcome.table = report::text_table(columns(), rows);
  constexpr std::array kCsv = {"/name",
                               "/checker",
                               "/family",
                               "/problems",
                               "/solved_share/s1",
                               "/solved_share/s5",
                               "/smooth_share",
                               "/time_ms/p50",
                               "/time_ms/p95",
                               "/path_length_rad/p50",
                               "/duration_s/p50",
                               "/clearance_m/p50",
                               "/refused_by_check"};
  outcome.table_csv = csv_text(rows, kCsv);
  outcome.summary_json = summary_text(provenance, record.type, outcome,
                                      {{"problems_file", record.problems},
                                       {"robot", record.robot},
                                       {"planners", planners},
                                       {"families", families}});
  return outcome;
}

}  // namespace sidestep

namespace sidestep::report {

std::string planners_body(const Json& summary) {
  const auto table = [&](const Column& second, const char* rows) {
    return html_table(Columns{{"planner", "/name"},
                              second,
                              {"problems", "/problems"},
                              {"solved in 1 s", "/solved_share/s1", "%.3f"},
                              {"5 s", "/solved_share/s5", "%.3f"},
                              {"refused", "/refused_by_check"},
                              {"smooth", "/smooth_share", "%.3f"},
                              {"time p50, ms", "/time_ms/p50", "%.2f"},
                              {"p95", "/time_ms/p95", "%.1f"},
                              {"path, rad", "/path_length_rad/p50", "%.2f"},
                              {"clear, m", "/clearance_m/p50", "%.3f"}},
                      at(summary, rows));
  };
  return "<h2>All problems</h2>\n" + table({"checker", "/checker"}, "/planners") +
         "<h2>Family by family</h2>\n" + table({"family", "/family"}, "/families") +
         "<p>Times, lengths and clearances are medians over what was solved, but for "
         "p95. "
         "Solved: the independent check accepts the answer. Refused: it does not.</p>\n";
}

}  // namespace sidestep::report
