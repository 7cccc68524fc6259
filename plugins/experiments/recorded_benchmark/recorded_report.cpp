#include <string>

#include <sidestep/report/html.hpp>
#include <sidestep/report/run_report.hpp>
#include "recorded_figures.hpp"
#include "recorded_summary.hpp"

namespace sidestep::report {
namespace {

Result<std::vector<PlannerSeries>> series_of(const Json& runs, ResultsReader& results) {
  std::vector<PlannerSeries> all;
  for (std::size_t item = 0; item < runs.size(); ++item) {
    PlannerSeries series;
    series.label = cell(at(runs[item], "/label")) + ", " + cell(at(runs[item], "/field"));
    for (const auto& [key, values] : {std::pair("cost", &series.cost),
                                      {"peer_cost", &series.peer_cost},
                                      {"solve_ms", &series.solve_ms},
                                      {"peer_solve_ms", &series.peer_solve_ms}}) {
      *values = SIDESTEP_TRY(results.column("solve/" + std::to_string(item), key));
    }
    all.push_back(std::move(series));
  }
  return all;
}

Result<std::string> recorded_body(const Json& summary, ResultsReader& results,
                                  const std::filesystem::path& run) {
  const Json runs = at(summary, "/runs");
  const auto series = SIDESTEP_TRY(series_of(runs, results));
  std::string html = "<p>" + escape_html(cell(at(summary, "/optimiser"))) + " on the problems of " +
                     escape_html(cell(at(summary, "/problems_file"))) + ", robot " +
                     escape_html(cell(at(summary, "/robot"))) + ".</p>\n";
  html += recorded_columns().html(runs);
  if (at(summary, "/costs_comparable") == Json(false)) {
    html += "<p>The peer's state is a Lie group here: its costs are no measure of ours.</p>\n";
  }
  const auto figures = SIDESTEP_TRY(figure_section(
      recorded_figures(series, at(summary, "/costs_comparable") != Json(false)), run));
  return html + figures;
}

}  // namespace
}  // namespace sidestep::report

namespace sidestep {

const report::RunReport& recorded_report() {
  static const report::RunReport kReport = {
      .body = &report::recorded_body,
      .columns = &recorded_columns(),
      .compared_of_run = {{"optimiser", "/optimiser"}, {"problems", "/problems_file"}},
      .pictures = {"planner_"}};
  return kReport;
}

}  // namespace sidestep
