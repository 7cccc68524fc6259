#include <sidestep/report/html.hpp>
#include <sidestep/report/run_report.hpp>
#include "ompl_database.hpp"
#include "planner_figures.hpp"
#include "planner_summary.hpp"

namespace sidestep::report {
namespace {

Result<std::string> planners_body(const Json& summary, ResultsReader&,
                                  const std::filesystem::path& run) {
  std::string html;
  if (const std::string fault = cell(at(summary, "/fault")); fault != "-") {
    html += "<p class=\"verdict failure\">" + escape_html(fault) + "</p>\n";
  }
  html += "<h2>All problems</h2>\n" + planner_columns().html(at(summary, "/planners"));
  const auto record = SIDESTEP_TRY(read_planner_record(run / "results.sqlite"));
  const auto figures = SIDESTEP_TRY(figure_section(planner_figures(record), run));
  html += figures;
  return html + "<h2>Family by family</h2>\n" + planner_columns().html(at(summary, "/families"));
}

}  // namespace
}  // namespace sidestep::report

namespace sidestep {

const report::RunReport& planner_report() {
  static const report::RunReport kReport = {.body = &report::planners_body,
                                            .columns = &planner_columns(),
                                            .pictures = {"planner_"},
                                            .files = {kOmplDatabase}};
  return kReport;
}

}  // namespace sidestep
