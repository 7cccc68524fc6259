#include <sidestep/report/html.hpp>
#include <sidestep/report/run_report.hpp>
#include "study_figures.hpp"
#include "study_summary.hpp"

namespace sidestep::report {
namespace {

std::string with_sd(const Json& mean, const char* pattern) {
  const std::string text = cell(at(mean, "/mean"), pattern);
  return text == "-" ? text : text + " ± " + cell(at(mean, "/sd"), pattern);
}

std::string interval(const Json& ci, const char* pattern) {
  const std::string lower = cell(at(ci, "/0"), pattern);
  return lower == "-" ? "-" : "[" + lower + ", " + cell(at(ci, "/1"), pattern) + "]";
}

/// One quantity of one robot: printed figures, ours with intervals, and the difference.
Row quantity_row(const Json& robot, const char* name, const char* key, bool is_mean,
                 const char* pattern) {
  Row row{cell(at(robot, "/name")), name};
  const std::string value = std::string("/") + key;
  for (const char* kind : {"/published/unsigned", "/published/signed"}) {
    const Json published = at(robot, (kind + value).c_str());
    row.push_back(is_mean ? with_sd(published, "%g") : cell(published, "%g %%"));
  }
  for (const char* kind : {"/unsigned", "/signed", "/difference"}) {
    const Json own = at(robot, (kind + value).c_str());
    const bool is_difference = std::string(kind) == "/difference";
    row.push_back(!is_mean        ? cell(own, "%.3f %%")
                  : is_difference ? cell(at(own, "/mean"), pattern)
                                  : with_sd(own, pattern));
    row.push_back(is_mean ? interval(at(own, "/ci"), pattern)
                          : interval(at(robot, (kind + value + "_ci").c_str()), "%.3f"));
  }
  return row;
}

std::string outcomes_section(const Json& summary) {
  const std::string published = cell(at(summary, "/published_as"));
  const std::string interval_head =
      cell(Json(100.0 * at(summary, "/confidence").get<double>()), "%g %% interval");
  std::vector<Row> rows;
  for (const Json& robot : at(summary, "/robots")) {
    rows.push_back(quantity_row(robot, "failures", "failure_percent", false, "%.3f"));
    rows.push_back(quantity_row(robot, "iterations", "iterations", true, "%.2f"));
    rows.push_back(
        quantity_row(robot, "iterations, solvable problems", "iterations_solvable", true, "%.2f"));
    rows.push_back(quantity_row(robot, "valid cost", "valid_cost", true, "%.4g"));
  }
  return "<h2>Unsigned against signed fields</h2>\n" +
         html_table({"robot", "", published + ", unsigned", "signed", "unsigned", interval_head,
                     "signed", interval_head, "signed − unsigned", interval_head},
                    rows) +
         "<p>Failures: problems that a field fails to solve collision-free, among those that at "
         "least one of the two solves; Wilson's interval. Iterations: of every solve. Valid cost: "
         "of problems that both solve. Intervals of means and differences: percentile bootstrap "
         "over scenes.</p>\n";
}

std::string time_section(const Json& summary) {
  const Json time = at(summary, "/time");
  return "<h2>Time</h2>\n" +
         html_table({"wall", "of all cores", "in the optimiser, all threads", "in the check",
                     "making fields"},
                    {{cell(at(time, "/wall_s"), "%.1f s"), cell(at(time, "/cpu_s"), "%.1f s"),
                      cell(at(time, "/solve_s"), "%.1f s"), cell(at(time, "/check_s"), "%.1f s"),
                      cell(at(time, "/field_s"), "%.1f s")}});
}

Result<std::string> study_body(const Json& summary, ResultsReader&,
                               const std::filesystem::path& run) {
  std::string html;
  if (const std::string fault = cell(at(summary, "/fault")); fault != "-") {
    html += "<p class=\"verdict failure\">" + escape_html(fault) + "</p>\n";
  }
  html += outcomes_section(summary) + study_columns().html(study_fields(summary));
  const auto study = SIDESTEP_TRY(read_study(run / "results.sqlite"));
  const auto figures = SIDESTEP_TRY(figure_section(study_figures(study), run));
  return html + figures + time_section(summary);
}

}  // namespace
}  // namespace sidestep::report

namespace sidestep {

const report::RunReport& study_report() {
  static const report::RunReport kReport = {.body = &report::study_body,
                                            .columns = &study_columns(),
                                            .compared_rows = &study_fields,
                                            .pictures = {"study_"}};
  return kReport;
}

}  // namespace sidestep
