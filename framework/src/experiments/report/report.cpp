#include <sidestep/experiments/report.hpp>

#include <cmath>
#include <optional>

#include <nlohmann/json.hpp>

#include <sidestep/runtime/results_store.hpp>

#include "report/figures.hpp"
#include "report/html.hpp"
#include "report/report_parts.hpp"
#include "report/text_table.hpp"

namespace sidestep {
namespace {

namespace fs = std::filesystem;
using namespace report;

Result<Json> read_summary(const fs::path& run) {
  const fs::path file = run / "summary.json";
  auto text = read_file(file);
  if (!text) {
    return fail(ErrorCode::kNotFound, "the folder holds no finished run", file.string(),
                "give the folder that `sidestep run` wrote to");
  }
  Json summary = Json::parse(*text, nullptr, false);
  if (!summary.is_object()) return fail(ErrorCode::kIo, "the summary is damaged", file.string());
  return summary;
}

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

/// The plans with their clearances in words, as "/clearance".
Json with_clearances(Json plans) {
  for (Json& plan : plans) {
    if (plan.is_object()) plan["clearance"] = clearance_cell(plan);
  }
  return plans;
}

std::string plans_table(const Json& plans) {
  return html_table(Columns{{"plan", "/name"},
                            {"result", "/success", "success|failed"},
                            {"valid in the field", "/valid_snapshot"},
                            {"valid independently", "/valid_independent"},
                            {"clearance", "/clearance"},
                            {"optimised duration", "/retiming/before_s", "%.2f s"},
                            {"duration", "/duration_s", "%.2f s"},
                            {"solve", "/solve_ms", "%.1f ms"},
                            {"iterations", "/iterations"},
                            {"cost", "/cost", "%.4g"},
                            {"attempts", "/attempts"}},
                    with_clearances(plans));
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
    const Json share = at(hindrance, "/share");
    const Json first = at(hindrance, "/states/0"), last = at(hindrance, "/states/1");
    rows.push_back(
        {cell(at(hindrance, "/what")), cell(at(hindrance, "/broken")), cell(at(hindrance, "/term")),
         share.is_number() ? format("%.1f %%", 100.0 * share.get<double>()) : "-",
         cell(at(hindrance, "/worst_s"), "%.2f s"),
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

std::string origin_section(const Json& summary, const fs::path& run) {
  std::string html = "<h2>Made with</h2>\n<table>\n";
  const Json provenance = at(summary, "/provenance");
  if (provenance.is_object()) {
    for (const auto& [key, value] : provenance.items()) {
      html += "<tr><td>" + escape_html(key) + "</td><td class=\"text\">" +
              escape_html(cell(value, "%.0f")) + "</td></tr>\n";
    }
  }
  html += "</table>\n";
  if (const auto config = read_file(run / "effective_config.yaml")) {
    html += "<h2>Configuration, as it took effect</h2>\n<pre>" + escape_html(*config) + "</pre>\n";
  }
  return html;
}

/// Plans, one after the other, then the map that they were made in.
Result<std::string> plan_body(const Json& summary, ResultsReader& results, const fs::path& run) {
  std::string html;
  const Json plans = at(summary, "/plans");
  if (plans.is_array() && !plans.empty()) html += plans_table(plans);
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
    auto figures = plan_figures(results, item++, name);
    if (!figures) return tl::make_unexpected(std::move(figures.error()));
    const auto section = figure_section(*figures, run);
    if (!section) return section;
    html += *section;
  }
  html += map_section(summary);
  auto figures = map_figures(results);
  if (!figures) return tl::make_unexpected(std::move(figures.error()));
  const auto section = figure_section(*figures, run);
  if (!section) return section;
  return html + *section;
}

/// What is particular to the type of the experiment.
Result<std::string> body_of(const Json& summary, ResultsReader& results, const fs::path& run) {
  if (at(summary, "/systems").is_array()) return mapping_body(summary, run);
  if (at(summary, "/experiment") == Json("recorded_benchmark")) {
    return recorded_body(summary, results, run);
  }
  if (at(summary, "/experiment") == Json("planner_benchmark")) return planners_body(summary, run);
  if (at(summary, "/experiment") == Json("incremental_benchmark")) return incremental_body(summary);
  if (at(summary, "/experiment") == Json("replan") ||
      at(summary, "/experiment") == Json("deploy")) {
    return replan_body(summary, results, run);
  }
  if (at(summary, "/experiment") == Json("field_study")) return study_body(summary, run);
  return plan_body(summary, results, run);
}

/// Everything that summary and store tell of a run, verdict first.
Result<std::string> report_body(const Json& summary, ResultsReader& results, const fs::path& run) {
  const bool success = at(summary, "/success") == Json(true);
  std::string html = "<h1>" + escape_html(cell(at(summary, "/configuration"))) + "</h1>\n";
  html += std::string("<p class=\"verdict ") + (success ? "success" : "failure") + "\">" +
          escape_html(cell(at(summary, "/verdict"))) + "</p>\n";
  const auto body = body_of(summary, results, run);
  if (!body) return body;
  html += *body;
  html += origin_section(summary, run);
  return html;
}

/// A run by the name of its folder: several may be of one configuration.
std::string run_name(const fs::path& run) {
  return (run.has_filename() ? run : run.parent_path()).filename().string();  // of "out/demo/", too
}

/// Runs of one type side by side: one row for each of what they tell of.
struct Comparison {
  const char* experiment;
  /// Of an item, whose own values hide those of the run; between its name and its commit.
  Columns columns;
  Json (*items)(const Json& summary);
};

/// A run without a plan is a row, too.
Json plans_of(const Json& summary) {
  const Json plans = at(summary, "/plans");
  return plans.empty() ? Json::array({{{"success", false}}}) : with_clearances(plans);
}

Json studied_fields_of(const Json& summary) {
  Json fields = Json::array();
  for (const Json& robot : at(summary, "/robots")) {
    for (const char* name : {"unsigned", "signed"}) {
      fields.push_back(robot);
      fields.back()["field"] = name;
      fields.back()["outcome"] = at(robot, ("/" + std::string(name)).c_str());
    }
  }
  return fields;
}

const std::vector<Comparison> kComparisons = {
    {"plan",
     {{"plan", "/name"},
      {"result", "/success", "success|failed"},
      {"clearance", "/clearance"},
      {"duration", "/duration_s", "%.2f s"},
      {"solve", "/solve_ms", "%.1f ms"},
      {"iterations", "/iterations"},
      {"frame p50", "/map/frame_ms/p50", "%.1f ms"},
      {"frames", "/frames"}},
     &plans_of},
    {"mapping_benchmark",
     {{"system", "/name"},
      {"field", "/signed", "signed|unsigned"},
      {"voxel", "/resolution_m", "%g m"},
      {"frame p50", "/frame_ms/p50", "%.2f ms"},
      {"frame p95", "/frame_ms/p95", "%.2f ms"},
      {"max error", "/max_error_m", "%.4f m"},
      {"mean error", "/mean_error_m", "%.2g m"},
      {"memory", "/memory_mib", "%.0f MiB"},
      {"frames", "/frames"}},
     [](const Json& summary) { return at(summary, "/systems"); }},
    {"planner_benchmark",
     {{"planner", "/name"},
      {"checker", "/checker"},
      {"answers", "/answers"},
      {"solved in 1 s", "/solved_share/s1", "%.4f"},
      {"time p50", "/time_ms/p50", "%.3f ms"},
      {"time p95", "/time_ms/p95", "%.2f ms"},
      {"path p50", "/path_length_rad/p50", "%.2f rad"},
      {"refused", "/refused_by_check"}},
     [](const Json& summary) { return at(summary, "/planners"); }},
    {"recorded_benchmark",
     {{"optimiser", "/optimiser"},
      {"problems", "/problems_file"},
      {"rules", "/label"},
      {"field", "/field"},
      {"iteration p50", "/lm_iteration_us/p50", "%.1f us"},
      {"solve p50", "/solve_ms/p50", "%.4f ms"},
      {"iterations", "/iterations/mean", "%.2f"},
      {"within 1 %", "/cost/share_within_1pct", "%.4f"},
      {"free", "/collision_free/share", "%.4f"}},
     [](const Json& summary) { return at(summary, "/runs"); }},
    {"field_study",
     {{"robot", "/name"},
      {"field", "/field"},
      {"problems", "/problems"},
      {"solvable", "/solvable"},
      {"failures", "/outcome/failure_percent", "%.3f %%"},
      {"iterations", "/outcome/iterations/mean", "%.2f"},
      {"cost", "/outcome/valid_cost/mean", "%.4g"},
      {"solve p50", "/outcome/solve_ms/p50", "%.3f ms"},
      {"solve p95", "/outcome/solve_ms/p95", "%.3f ms"}},
     &studied_fields_of},
    {"incremental_benchmark",
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
     [](const Json& summary) { return at(summary, "/rows"); }}};

/// What a run adds to a comparison.
void add_rows(const Comparison& comparison, const std::string& run, const Json& summary,
              std::vector<Row>& rows) {
  for (const Json& item : comparison.items(summary)) {
    Json shown = summary;
    shown.update(item);
    Row row = cells_of(shown, comparison.columns);
    row.insert(row.begin(), {run, cell(at(summary, "/configuration"))});
    row.push_back(cell(at(summary, "/provenance/git_hash")));
    rows.push_back(std::move(row));
  }
}

}  // namespace

bool is_report_picture(std::string_view file_name) {
  const bool picture = file_name.ends_with(".png") || file_name.ends_with(".svg");
  return picture && (file_name.starts_with("plan-") || file_name.starts_with("depth.") ||
                     file_name.starts_with("frame_times.") ||
                     file_name.starts_with("mapping_times.") || file_name.starts_with("planner_") ||
                     file_name.starts_with("episode-") || file_name.starts_with("study_"));
}

Result<void> write_report(const fs::path& run) {
  const auto summary = read_summary(run);
  if (!summary) return tl::make_unexpected(summary.error());
  auto results = ResultsReader::open(run / "results.sqlite");
  if (!results) return tl::make_unexpected(std::move(results.error()));
  auto body = report_body(*summary, **results, run);
  if (!body) return tl::make_unexpected(std::move(body.error()));
  const std::string title = "Sidestep: " + cell(at(*summary, "/configuration"));
  return write_file(run / "report.html", html_page(title, *body));
}

Result<std::string> compare_runs(const std::vector<fs::path>& runs, const fs::path& html) {
  std::vector<Json> summaries;
  for (const fs::path& run : runs) {
    auto summary = read_summary(run);
    if (!summary) return tl::make_unexpected(std::move(summary.error()));
    summaries.push_back(std::move(*summary));
  }
  std::string text, body;
  for (const Comparison& comparison : kComparisons) {
    std::vector<Row> rows;
    for (std::size_t r = 0; r < runs.size(); ++r) {
      if (at(summaries[r], "/experiment") != Json(comparison.experiment)) continue;
      add_rows(comparison, run_name(runs[r]), summaries[r], rows);
    }
    if (rows.empty()) continue;
    Row header = names_of(comparison.columns);
    header.insert(header.begin(), {"run", "configuration"});
    header.push_back("commit");
    TextTable table(header);
    for (const Row& row : rows) table.add(row);
    text += (text.empty() ? "" : "\n") + table.text();
    body += html_table(header, rows);
  }
  if (!html.empty()) {
    const std::string page = html_page("Sidestep: comparison", "<h1>Runs compared</h1>\n" + body);
    if (auto written = write_file(html, page); !written) {
      return tl::make_unexpected(std::move(written.error()));
    }
  }
  return text;
}

}  // namespace sidestep
