#include "planners/planner_rows.hpp"
#include "report/figures_planners.hpp"
#include "report/html.hpp"
#include "report/report_parts.hpp"

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

}  // namespace

Result<std::string> planners_body(const Json& summary, const std::filesystem::path& run) {
  std::string html;
  if (const std::string fault = cell(at(summary, "/fault")); fault != "-") {
    html += "<p class=\"verdict failure\">" + escape_html(fault) + "</p>\n";
  }
  html += "<h2>All problems</h2>\n" + tables({"checker", "/checker"}, at(summary, "/planners"));
  const auto record = read_planner_record(run / "results.sqlite");
  if (!record) return tl::make_unexpected(record.error());
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

}  // namespace sidestep::report
