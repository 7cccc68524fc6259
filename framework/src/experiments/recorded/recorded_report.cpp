#include <string>

#include "recorded/recorded_figures.hpp"
#include "recorded/recorded_summary.hpp"
#include "report/html.hpp"
#include "report/run_report.hpp"

namespace sidestep::report {
namespace {

std::string recorded_times_section(const Json& runs) {
  std::vector<Row> rows;
  for (const Json& r : runs) {
    rows.push_back(
        {cell(at(r, "/label")), cell(at(r, "/field")), cell(at(r, "/problems")),
         cell(at(r, "/lm_iteration_us/p50"), "%.1f"), cell(at(r, "/lm_iteration_us/p95"), "%.1f"),
         cell(at(r, "/solve_ms/p50"), "%.4f"), cell(at(r, "/solve_ms/p95"), "%.4f"),
         cell(at(r, "/solve_ms/mean"), "%.4f"),
         cell(at(r, "/iterations/mean"), "%.2f") + " ± " + cell(at(r, "/iterations/sd"), "%.2f"),
         cell(at(r, "/peer/lm_iteration_us/p50"), "%.0f"),
         cell(at(r, "/peer/solve_ms/p50"), "%.2f"),
         cell(at(r, "/peer/iterations/mean"), "%.2f") + " ± " +
             cell(at(r, "/peer/iterations/sd"), "%.2f")});
  }
  return "<h2>Time</h2>\n" +
         html_table(
             {"run", "field", "problems", "iteration p50, us", "p95", "solve p50, ms", "p95",
              "mean", "iterations", "peer's iteration p50, us", "solve p50, ms", "iterations"},
             rows) +
         "<p>An iteration is an accepted step with the damping attempts before it. The peer's "
         "times are those that were recorded, on its machine.</p>\n";
}

std::string results_section(const Json& summary) {
  std::string html =
      "<h2>Costs and collisions</h2>\n" +
      html_table(Columns{{"run", "/label"},
                         {"field", "/field"},
                         {"solved", "/solved"},
                         {"within 1 % or below", "/cost/share_within_1pct", "%.4f"},
                         {"mean", "/cost/mean", "%.6g"},
                         {"peer's", "/cost/peer_mean", "%.6g"},
                         {"median", "/cost/median", "%.6g"},
                         {"peer's", "/cost/peer_median", "%.6g"},
                         {"collision-free", "/collision_free/share", "%.4f"},
                         {"peer's", "/collision_free/peer_share", "%.4f"},
                         {"start and goal free", "/free_ends/problems"},
                         {"of them collision-free", "/free_ends/share", "%.4f"},
                         {"peer's", "/free_ends/peer_share", "%.4f"},
                         {"free at the checked states", "/free_at_checks/share", "%.4f"},
                         {"peer's", "/free_at_checks/peer_share", "%.4f"}},
                 at(summary, "/runs"));
  if (at(summary, "/costs_comparable") == Json(false)) {
    html += "<p>The peer's state is a Lie group here: its costs are no measure of ours.</p>\n";
  }
  return html;
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
      auto column = results.column("solve/" + std::to_string(item), key);
      if (!column) return error_of(column);
      *values = std::move(*column);
    }
    all.push_back(std::move(series));
  }
  return all;
}

Result<std::string> recorded_body(const Json& summary, ResultsReader& results,
                                  const std::filesystem::path& run) {
  const Json runs = at(summary, "/runs");
  const auto series = series_of(runs, results);
  if (!series) return error_of(series);
  std::string html = "<p>" + escape_html(cell(at(summary, "/optimiser"))) + " on the problems of " +
                     escape_html(cell(at(summary, "/problems_file"))) + ", robot " +
                     escape_html(cell(at(summary, "/robot"))) + ".</p>\n";
  html += recorded_times_section(runs) + results_section(summary);
  const auto figures = figure_section(
      recorded_figures(*series, at(summary, "/costs_comparable") != Json(false)), run);
  if (!figures) return figures;
  return html + *figures;
}

}  // namespace
}  // namespace sidestep::report

namespace sidestep {

const report::RunReport& recorded_report() {
  static const report::RunReport kReport = {
      &report::recorded_body,
      {{"optimiser", "/optimiser"},
       {"problems", "/problems_file"},
       {"rules", "/label"},
       {"field", "/field"},
       {"iteration p50", "/lm_iteration_us/p50", "%.1f us"},
       {"solve p50", "/solve_ms/p50", "%.4f ms"},
       {"iterations", "/iterations/mean", "%.2f"},
       {"within 1 %", "/cost/share_within_1pct", "%.4f"},
       {"free", "/collision_free/share", "%.4f"}},
      [](const report::Json& summary) { return report::at(summary, "/runs"); }};
  return kReport;
}

}  // namespace sidestep
