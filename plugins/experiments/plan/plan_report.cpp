#include <sidestep/core/format.hpp>

#include <sidestep/report/html.hpp>
#include <sidestep/report/run_report.hpp>
#include "plan_figures.hpp"
#include "plan_summary.hpp"

namespace sidestep {
namespace {

namespace fs = std::filesystem;
using namespace report;

std::string map_section(const Json& summary) {
  std::string html = "<h2>Map</h2>\n";
  html += html_table(
      {"frames", "unusable", "frame time p50", "p95", "max", "occupied voxels", "resolution"},
      {{cell(at(summary, "/frames")), cell(at(summary, "/bad_frames")),
        cell(at(summary, "/map/frame_ms/p50"), "%.1f ms"),
        cell(at(summary, "/map/frame_ms/p95"), "%.1f ms"),
        cell(at(summary, "/map/frame_ms/max"), "%.1f ms"),
        cell(at(summary, "/map/occupied_vox"), "%.0f"),
        cell(at(summary, "/map/resolution_m"), "%.3f m")}});
  const Json errors = at(summary, "/bad_frame_errors");
  if (!errors.is_array() || errors.empty()) return html;
  html += "<details><summary>Unusable frames</summary><pre>";
  for (const Json& error : errors) html += escape_html(cell(error)) + "\n";
  return html + "</pre></details>\n";
}

/// Clearances as far as was looked say so.
std::string clearance_cell(const Json& of) {
  const std::string clear = cell(at(of, "/min_clearance_m"), "%.3f m");
  return at(of, "/clearance_is_bound") == Json(true) ? "at least " + clear : clear;
}

std::string checks_table(const Json& plan) {
  std::vector<Row> rows;
  for (const auto& [key, words] :
       {std::pair("snapshot", "spheres in the distance field"),
        {"voxels", "collision shapes among the occupied voxels"},
        {"scene", "collision shapes in the true scene, its floor included"}}) {
    const Json check = at(plan, ("/checks/" + std::string(key)).c_str());
    if (!check.is_object()) continue;
    rows.push_back({words, cell(at(check, "/outcome")), clearance_cell(check),
                    cell(at(check, "/min_clearance_link")),
                    cell(at(check, "/min_clearance_time_s"), "%.2f s"),
                    cell(at(check, "/min_self_clearance_m"), "%.3f m")});
  }
  if (rows.empty()) return "";
  return html_table({"check", "outcome", "clearance", "of", "at", "self-clearance"}, rows);
}

/// What holds a plan, in the order of its summary.
std::string explanation_section(const Json& plan) {
  const Json hindrances = at(plan, "/explanation/hindrances");
  if (!hindrances.is_array() || hindrances.empty()) return "";
  std::vector<Row> rows;
  for (const Json& hindrance : hindrances) {
    const Json first = at(hindrance, "/states/0"), last = at(hindrance, "/states/1");
    rows.push_back(
        {cell(at(hindrance, "/what")), cell(at(hindrance, "/broken")), cell(at(hindrance, "/term")),
         cell(at(hindrance, "/share"), kPercent), cell(at(hindrance, "/worst_s"), "%.2f s"),
         cell(at(hindrance, "/from_s"), "%.2f s") + " to " + cell(at(hindrance, "/to_s"), "%.2f s"),
         first == last ? cell(first) : cell(first) + " to " + cell(last)});
  }
  std::string html = "<h3>What holds it</h3>\n";
  html += html_table({"what", "broken", "cost term", "share of cost", "worst at", "felt", "states"},
                     rows);
  if (at(plan, "/retiming").is_object()) {
    html += "<p>Times and states are those of the optimised motion, before it was retimed.</p>\n";
  }
  return html;
}

/// Plans, one after the other, then the map that they were made in.
Result<std::string> plan_body(const Json& summary, ResultsReader& results, const fs::path& run) {
  std::string html;
  const Json plans = at(summary, "/plans");
  if (plans.is_array() && !plans.empty()) html += plan_columns().html(plans);
  std::int64_t item = 0;
  for (const Json& plan : plans) {
    const std::string name = cell(at(plan, "/name"));
    html += "<h2>Plan " + escape_html(name) + "</h2>\n";
    if (const std::string reason = cell(at(plan, "/reason")); !reason.empty() && reason != "-") {
      html += "<p class=\"verdict failure\">" + escape_html(reason) + "</p>\n";
    }
    if (const Json attached = at(plan, "/attached"); attached.is_array() && !attached.empty()) {
      std::string names;
      for (const Json& object : attached) names += (names.empty() ? "" : ", ") + cell(object);
      html += "<p>The robot carries: " + escape_html(names) + ".</p>\n";
    }
    html += explanation_section(plan);
    html += checks_table(plan);
    auto figures = SIDESTEP_TRY(plan_figures(results, item++, name));
    const auto section = SIDESTEP_TRY(figure_section(figures, run));
    html += section;
  }
  html += map_section(summary);
  auto figures = SIDESTEP_TRY(map_figures(results));
  const auto section = SIDESTEP_TRY(figure_section(figures, run));
  return html + section;
}

/// A run without a plan is a row, too.
Json plans_of(const Json& summary) {
  const Json plans = at(summary, "/plans");
  return plans.empty() ? Json::array({{{"success", false}}}) : plans;
}

}  // namespace

const report::RunReport& plan_report() {
  static const report::RunReport kReport = {
      .body = &plan_body,
      .columns = &plan_columns(),
      .compared_of_run = {{"frame p50", "/map/frame_ms/p50", "%.1f ms"}, {"frames", "/frames"}},
      .compared_rows = &plans_of,
      .pictures = {"plan-", "depth.", "frame_times."}};
  return kReport;
}

}  // namespace sidestep
