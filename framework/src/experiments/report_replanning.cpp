#include <string>

#include "html.hpp"
#include "report_parts.hpp"

namespace sidestep::report {

std::string replanning_body(const Json& summary) {
  std::vector<Row> rows;
  const Json all = at(summary, "/rows");
  for (const Json& r : all) {
    rows.push_back({cell(at(r, "/label")), cell(at(r, "/field")), cell(at(r, "/change")),
                    cell(at(r, "/way")), cell(at(r, "/problems")),
                    cell(at(r, "/solve_ms/p50"), "%.4f"), cell(at(r, "/solve_ms/p95"), "%.4f"),
                    cell(at(r, "/solve_ms/mean"), "%.4f"), cell(at(r, "/time_ratio/p50"), "%.3f"),
                    cell(at(r, "/time_ratio/p95"), "%.3f"),
                    cell(at(r, "/time_ratio/of_means"), "%.3f"),
                    cell(at(r, "/iterations/mean"), "%.2f"), cell(at(r, "/cost_ratio/p05"), "%.4f"),
                    cell(at(r, "/cost_ratio/p50"), "%.4f"), cell(at(r, "/cost_ratio/p95"), "%.4f"),
                    cell(at(r, "/cost_ratio/share_within_1pct"), "%.4f"),
                    cell(at(r, "/collision_free/share"), "%.4f"),
                    cell(at(r, "/free_ends/problems")), cell(at(r, "/free_ends/share"), "%.4f")});
  }
  std::string html = "<p>" + escape_html(cell(at(summary, "/optimiser"))) + " on the problems of " +
                     escape_html(cell(at(summary, "/problems_file"))) + ", robot " +
                     escape_html(cell(at(summary, "/robot"))) +
                     "; each joint of the goal moved by " + cell(at(summary, "/goal_sd")) +
                     ", or each box by " + cell(at(summary, "/obstacle_sd_m")) +
                     " m along each axis (standard deviations).</p>\n";
  html += "<h2>Replanning</h2>\n";
  html += html_table(
      {"run", "field", "change", "way", "problems", "solve p50, ms", "p95", "mean",
       "of afresh's p50", "p95", "of means", "iterations", "cost of afresh's p05", "p50", "p95",
       "within 1 % or below", "collision-free", "start and goal free", "of them collision-free"},
      rows);
  return html +
         "<p>Afresh: from a straight line. Warm: from the trajectory before the change. "
         "Incremental: by the optimiser that found it. Ratios are to afresh, problem by problem, "
         "but for that of the means.</p>\n";
}

}  // namespace sidestep::report
