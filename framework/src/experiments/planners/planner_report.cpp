#include "planners/planner_figures.hpp"
#include "planners/planner_summary.hpp"
#include "report/html.hpp"
#include "report/run_report.hpp"

namespace sidestep::report {
namespace {

std::string tables(const Column& second, const Json& rows) {
  return html_table(Columns{{"planner", "/name"},
                            second,
                            {"answers", "/answers"},
                            {"solved in 1 s", "/solved_share/s1", "%.3f"},
                            {"5 s", "/solved_share/s5", "%.3f"},
                            {"refused", "/refused_by_check"},
                            {"smooth", "/smooth_share", "%.3f"},
                            {"first, ms", "/first_valid_ms/p50", "%.2f"},
                            {"time p50, ms", "/time_ms/p50", "%.2f"},
                            {"p95", "/time_ms/p95", "%.1f"}},
                    rows) +
         html_table(Columns{{"planner", "/name"},
                            second,
                            {"path, rad", "/path_length_rad/p50", "%.2f"},
                            {"motion, s", "/duration_s/p50", "%.2f"},
                            {"acceleration", "/acceleration_ratio/p50", "%.2f"},
                            {"clearance, m", "/clearance_m/p50", "%.3f"}},
                    rows);
}

Result<std::string> planners_body(const Json& summary, ResultsReader&,
                                  const std::filesystem::path& run) {
  std::string html;
  if (const std::string fault = cell(at(summary, "/fault")); fault != "-") {
    html += "<p class=\"verdict failure\">" + escape_html(fault) + "</p>\n";
  }
  html += "<h2>All problems</h2>\n" + tables({"checker", "/checker"}, at(summary, "/planners"));
  const auto record = read_planner_record(run / "results.sqlite");
  if (!record) return error_of(record);
  const auto figures = figure_section(planner_figures(*record), run);
  if (!figures) return figures;
  html += *figures;
  html += "<h2>Family by family</h2>\n" + tables({"family", "/family"}, at(summary, "/families"));
  return html +
         "<p>Solved: the independent check accepts the answer. Refused: it does not. Times, paths, "
         "motions and clearances are medians over what was solved, but for p95. First: until the "
         "first valid answer; time: until the first one as smooth as the last. Acceleration: "
         "squared, over all joints and the whole motion, as a multiple of the least that one of "
         "its "
         "length and duration needs.</p>\n";
}

}  // namespace
}  // namespace sidestep::report

namespace sidestep {

const report::RunReport& planner_report() {
  static const report::RunReport kReport = {
      &report::planners_body,
      {{"planner", "/name"},
       {"checker", "/checker"},
       {"answers", "/answers"},
       {"solved in 1 s", "/solved_share/s1", "%.4f"},
       {"time p50", "/time_ms/p50", "%.3f ms"},
       {"time p95", "/time_ms/p95", "%.2f ms"},
       {"path p50", "/path_length_rad/p50", "%.2f rad"},
       {"refused", "/refused_by_check"}},
      [](const report::Json& summary) { return report::at(summary, "/planners"); }};
  return kReport;
}

}  // namespace sidestep
