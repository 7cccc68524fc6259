#include <string>

#include <sidestep/report/html.hpp>
#include <sidestep/report/run_report.hpp>
#include "incremental_summary.hpp"

namespace sidestep::report {
namespace {

Result<std::string> incremental_body(const Json& summary, ResultsReader&,
                                     const std::filesystem::path&) {
  return "<p>" + escape_html(cell(at(summary, "/optimiser"))) + " on the problems of " +
         escape_html(cell(at(summary, "/problems_file"))) + ", robot " +
         escape_html(cell(at(summary, "/robot"))) + "; each joint of the goal moved by " +
         cell(at(summary, "/goal_sd")) + ", or each box by " + cell(at(summary, "/obstacle_sd_m")) +
         " m along each axis (standard deviations). Afresh: from a straight line. Warm: from the "
         "trajectory before the change. Incremental: by the optimiser that found it.</p>\n" +
         incremental_columns().html(at(summary, "/rows"));
}

}  // namespace
}  // namespace sidestep::report

namespace sidestep {

const report::RunReport& incremental_report() {
  static const report::RunReport kReport = {.body = &report::incremental_body,
                                            .columns = &incremental_columns(),
                                            .compared_of_run = {{"problems", "/problems_file"}}};
  return kReport;
}

}  // namespace sidestep
