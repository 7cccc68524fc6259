#include <string>

#include "recorded/incremental_summary.hpp"
#include "report/html.hpp"
#include "report/run_report.hpp"

namespace sidestep::report {
namespace {

Result<std::string> incremental_body(const Json& summary, ResultsReader&,
                                     const std::filesystem::path&) {
  std::string html = "<p>" + escape_html(cell(at(summary, "/optimiser"))) + " on the problems of " +
                     escape_html(cell(at(summary, "/problems_file"))) + ", robot " +
                     escape_html(cell(at(summary, "/robot"))) +
                     "; each joint of the goal moved by " + cell(at(summary, "/goal_sd")) +
                     ", or each box by " + cell(at(summary, "/obstacle_sd_m")) +
                     " m along each axis (standard deviations).</p>\n";
  html += "<h2>Changed problems</h2>\n";
  html += html_table(Columns{{"run", "/label"},
                             {"field", "/field"},
                             {"change", "/change"},
                             {"way", "/way"},
                             {"problems", "/problems"},
                             {"solve p50, ms", "/solve_ms/p50", "%.4f"},
                             {"p95", "/solve_ms/p95", "%.4f"},
                             {"mean", "/solve_ms/mean", "%.4f"},
                             {"of afresh's p50", "/time_ratio/p50", "%.3f"},
                             {"p95", "/time_ratio/p95", "%.3f"},
                             {"of means", "/time_ratio/of_means", "%.3f"},
                             {"iterations", "/iterations/mean", "%.2f"},
                             {"cost of afresh's p05", "/cost_ratio/p05", "%.4f"},
                             {"p50", "/cost_ratio/p50", "%.4f"},
                             {"p95", "/cost_ratio/p95", "%.4f"},
                             {"within 1 % or below", "/cost_ratio/share_within_1pct", "%.4f"},
                             {"collision-free", "/collision_free/share", "%.4f"},
                             {"start and goal free", "/free_ends/problems"},
                             {"of them collision-free", "/free_ends/share", "%.4f"}},
                     at(summary, "/rows"));
  return html +
         "<p>Afresh: from a straight line. Warm: from the trajectory before the change. "
         "Incremental: by the optimiser that found it. Ratios are to afresh, problem by problem, "
         "but for that of the means.</p>\n";
}

}  // namespace
}  // namespace sidestep::report

namespace sidestep {

const report::RunReport& incremental_report() {
  static const report::RunReport kReport = {
      &report::incremental_body,
      {{"problems", "/problems_file"},
       {"rules", "/label"},
       {"field", "/field"},
       {"other", "/change"},
       {"way", "/way"},
       {"solve p50", "/solve_ms/p50", "%.4f ms"},
       {"of afresh's", "/time_ratio/p50", "%.3f"},
       {"iterations", "/iterations/mean", "%.2f"},
       {"within 1 %", "/cost_ratio/share_within_1pct", "%.4f"},
       {"free", "/collision_free/share", "%.4f"}},
      [](const report::Json& summary) { return report::at(summary, "/rows"); }};
  return kReport;
}

}  // namespace sidestep
