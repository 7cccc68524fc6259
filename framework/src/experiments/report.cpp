#include <sidestep/experiments/report.hpp>

#include <cmath>
#include <optional>

#include <nlohmann/json.hpp>

#include <sidestep/runtime/results_store.hpp>

#include "figures.hpp"
#include "html.hpp"
#include "report_parts.hpp"
#include "text_table.hpp"

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

std::string plans_table(const Json& plans) {
  std::vector<Row> rows;
  for (const Json& plan : plans) {
    const Json clearance_m = at(plan, "/min_clearance_m");
    rows.push_back({cell(at(plan, "/name")),
                    at(plan, "/success") == Json(true) ? "success" : "failed",
                    cell(at(plan, "/valid_snapshot")), cell(at(plan, "/valid_independent")),
                    cell(clearance_m, "%.3f m"), cell(at(plan, "/retiming/before_s"), "%.2f s"),
                    cell(at(plan, "/duration_s"), "%.2f s"), cell(at(plan, "/solve_ms"), "%.1f ms"),
                    cell(at(plan, "/iterations")), cell(at(plan, "/cost"), "%.4g"),
                    cell(at(plan, "/attempts"))});
  }
  return html_table({"plan", "result", "valid in the field", "valid independently", "clearance",
                     "optimised duration", "duration", "solve", "iterations", "cost", "attempts"},
                    rows);
}

std::string checks_table(const Json& plan) {
  std::vector<Row> rows;
  for (const auto& [key, words] : {std::pair("snapshot", "spheres in the distance field"),
                                   {"voxels", "collision shapes among the occupied voxels"},
                                   {"scene", "collision shapes in the true scene"}}) {
    const Json check = at(plan, ("/checks/" + std::string(key)).c_str());
    if (!check.is_object()) continue;
    rows.push_back(
        {words, cell(at(check, "/outcome")), cell(at(check, "/min_clearance_m"), "%.3f m"),
         cell(at(check, "/min_clearance_link")), cell(at(check, "/min_clearance_time_s"), "%.2f s"),
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
  if (at(summary, "/experiment") == Json("planner_benchmark")) {
    return planner_body(summary, results, run);
  }
  if (at(summary, "/experiment") == Json("replanning")) return replanning_body(summary);
  if (at(summary, "/experiment") == Json("replan")) return replan_body(summary, results, run);
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

Row plan_row(const fs::path& run, const Json& summary, const Json& plan) {
  return {run_name(run),
          cell(at(summary, "/configuration")),
          cell(at(plan, "/name")),
          at(plan, "/success") == Json(true) ? "success" : "failed",
          cell(at(plan, "/min_clearance_m"), "%.3f m"),
          cell(at(plan, "/duration_s"), "%.2f s"),
          cell(at(plan, "/solve_ms"), "%.1f ms"),
          cell(at(plan, "/iterations")),
          cell(at(summary, "/map/frame_ms/p50"), "%.1f ms"),
          cell(at(summary, "/frames")),
          cell(at(summary, "/provenance/git_hash"))};
}

Row system_row(const fs::path& run, const Json& summary, const Json& system) {
  return {run_name(run),
          cell(at(summary, "/configuration")),
          cell(at(system, "/name")),
          at(system, "/signed") == Json(true) ? "signed" : "unsigned",
          cell(at(system, "/resolution_m"), "%g m"),
          cell(at(system, "/frame_ms/p50"), "%.2f ms"),
          cell(at(system, "/frame_ms/p95"), "%.2f ms"),
          cell(at(system, "/max_error_m"), "%.4f m"),
          cell(at(system, "/mean_error_m"), "%.2g m"),
          cell(at(system, "/memory_mib"), "%.0f MiB"),
          cell(at(system, "/frames")),
          cell(at(summary, "/provenance/git_hash"))};
}

Row solver_row(const fs::path& run, const Json& summary, const Json& solver) {
  return {run_name(run),
          cell(at(summary, "/configuration")),
          cell(at(summary, "/optimiser")),
          cell(at(summary, "/problems_file")),
          cell(at(solver, "/label")),
          cell(at(solver, "/field")),
          cell(at(solver, "/lm_iteration_us/p50"), "%.1f us"),
          cell(at(solver, "/solve_ms/p50"), "%.4f ms"),
          cell(at(solver, "/iterations/mean"), "%.2f"),
          cell(at(solver, "/cost/share_within_1pct"), "%.4f"),
          cell(at(solver, "/collision_free/share"), "%.4f"),
          cell(at(summary, "/provenance/git_hash"))};
}

Row replan_row(const fs::path& run, const Json& summary, const Json& row) {
  return {run_name(run),
          cell(at(summary, "/configuration")),
          cell(at(summary, "/problems_file")),
          cell(at(row, "/label")),
          cell(at(row, "/field")),
          cell(at(row, "/change")),
          cell(at(row, "/way")),
          cell(at(row, "/solve_ms/p50"), "%.4f ms"),
          cell(at(row, "/time_ratio/p50"), "%.3f"),
          cell(at(row, "/iterations/mean"), "%.2f"),
          cell(at(row, "/cost_ratio/share_within_1pct"), "%.4f"),
          cell(at(row, "/collision_free/share"), "%.4f"),
          cell(at(summary, "/provenance/git_hash"))};
}

Row loop_row(const fs::path& run, const Json& summary) {
  return {run_name(run),
          cell(at(summary, "/configuration")),
          cell(at(summary, "/clock")),
          cell(at(summary, "/optimiser")),
          cell(at(summary, "/episodes")),
          cell(at(summary, "/success_share"), "%.4f"),
          cell(at(summary, "/collisions_true")),
          cell(at(summary, "/min_true_clearance_m"), "%.3f m"),
          cell(at(summary, "/replans")),
          cell(at(summary, "/solve_ms/p50"), "%.2f ms"),
          cell(at(summary, "/stamp_to_trajectory_ms/p95"), "%.1f ms"),
          cell(at(summary, "/provenance/git_hash"))};
}

Row study_row(const fs::path& run, const Json& summary, const Json& robot, const char* field) {
  const Json outcome = at(robot, (std::string("/") + field).c_str());
  return {run_name(run),
          cell(at(summary, "/configuration")),
          cell(at(robot, "/name")),
          field,
          cell(at(robot, "/problems")),
          cell(at(robot, "/solvable")),
          cell(at(outcome, "/failure_percent"), "%.3f %%"),
          cell(at(outcome, "/iterations/mean"), "%.2f"),
          cell(at(outcome, "/valid_cost/mean"), "%.4g"),
          cell(at(outcome, "/solve_ms/p50"), "%.3f ms"),
          cell(at(outcome, "/solve_ms/p95"), "%.3f ms"),
          cell(at(summary, "/provenance/git_hash"))};
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
  const Row plan_header = {"run",   "configuration", "plan",      "result", "clearance", "duration",
                           "solve", "iterations",    "frame p50", "frames", "commit"};
  const Row system_header = {"run",        "configuration", "system",    "field",
                             "voxel",      "frame p50",     "frame p95", "max error",
                             "mean error", "memory",        "frames",    "commit"};
  const Row solver_header = {"run",        "configuration", "optimiser",     "problems",
                             "rules",      "field",         "iteration p50", "solve p50",
                             "iterations", "within 1 %",    "free",          "commit"};
  const Row loop_header = {
      "run",        "configuration", "clock",   "optimiser", "episodes",          "success",
      "collisions", "clearance",     "replans", "solve p50", "stamp to plan p95", "commit"};
  std::vector<Row> plan_rows, system_rows, solver_rows, study_rows, replan_rows, loop_rows;
  const Row study_header = {"run",      "configuration", "robot",     "field",
                            "problems", "solvable",      "failures",  "iterations",
                            "cost",     "solve p50",     "solve p95", "commit"};
  const Row replan_header = {
      "run",       "configuration", "problems",   "rules",      "field", "other", "way",
      "solve p50", "of afresh's",   "iterations", "within 1 %", "free",  "commit"};
  for (const fs::path& run : runs) {
    const auto summary = read_summary(run);
    if (!summary) return tl::make_unexpected(summary.error());
    const Json systems = at(*summary, "/systems");
    for (const Json& system : systems) system_rows.push_back(system_row(run, *summary, system));
    const bool is_planner = at(*summary, "/experiment") == Json("planner_benchmark");
    if (is_planner) {
      const Json solvers = at(*summary, "/runs");
      for (const Json& solver : solvers) solver_rows.push_back(solver_row(run, *summary, solver));
    }
    const Json robots = at(*summary, "/robots");
    for (const Json& robot : robots) {
      for (const char* field : {"unsigned", "signed"}) {
        study_rows.push_back(study_row(run, *summary, robot, field));
      }
    }
    const bool is_replanning = at(*summary, "/experiment") == Json("replanning");
    if (is_replanning) {
      const Json rows = at(*summary, "/rows");
      for (const Json& row : rows) replan_rows.push_back(replan_row(run, *summary, row));
    }
    const bool is_loop = at(*summary, "/experiment") == Json("replan");
    if (is_loop) loop_rows.push_back(loop_row(run, *summary));
    if (is_loop || systems.is_array() || is_planner || is_replanning || robots.is_array()) continue;
    const Json plans = at(*summary, "/plans");
    for (const Json& plan : plans) plan_rows.push_back(plan_row(run, *summary, plan));
    if (!plans.is_array() || plans.empty())
      plan_rows.push_back(plan_row(run, *summary, Json::object()));
  }
  std::string text, body;
  for (const auto& [header, rows] :
       {std::pair(&plan_header, &plan_rows), std::pair(&system_header, &system_rows),
        std::pair(&solver_header, &solver_rows), std::pair(&study_header, &study_rows),
        std::pair(&replan_header, &replan_rows), std::pair(&loop_header, &loop_rows)}) {
    if (rows->empty()) continue;
    TextTable table(*header);
    for (const Row& row : *rows) table.add(row);
    text += (text.empty() ? "" : "\n") + table.text();
    body += html_table(*header, *rows);
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
