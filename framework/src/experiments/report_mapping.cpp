#include <algorithm>

#include "html.hpp"
#include "report_parts.hpp"

namespace sidestep::report {
namespace {

std::string sign_text(const Json& system) {
  return at(system, "/signed") == Json(true) ? "signed" : "unsigned";
}

/// Name, field, resolution: what every table begins with.
Row head_of(const Json& system) {
  return {cell(at(system, "/name")), sign_text(system), cell(at(system, "/resolution_m"), "%g m")};
}

void append(Row& row, Row more) {
  row.insert(row.end(), std::make_move_iterator(more.begin()), std::make_move_iterator(more.end()));
}

std::string times_section(const Json& summary) {
  std::vector<Row> rows;
  for (const Json& s : at(summary, "/systems")) {
    Row row = head_of(s);
    append(row,
           {cell(at(s, "/frames")),
            cell(at(s, "/frame_ms/mean"), "%.2f") + " ± " + cell(at(s, "/frame_ms/sd"), "%.2f"),
            cell(at(s, "/frame_ms/p50"), "%.2f"), cell(at(s, "/frame_ms/p95"), "%.2f"),
            cell(at(s, "/stages_ms/integrate/mean"), "%.2f"),
            cell(at(s, "/stages_ms/field/mean"), "%.2f"),
            cell(at(s, "/stages_ms/publish/mean"), "%.2f"), cell(at(s, "/ratio/mean"), "%.2f"),
            cell(at(s, "/published_ms"), "%g")});
    rows.push_back(std::move(row));
  }
  const std::string reference = cell(at(summary, "/reference"));
  std::string html = "<h2>Time of an update, in ms</h2>\n";
  html += html_table({"system", "field", "voxel", "frames", "mean ± sd", "p50", "p95", "integrate",
                      "field", "publish", "ratio", cell(at(summary, "/published_as"))},
                     rows);
  if (!reference.empty()) {
    html += "<p>Ratio: times the mean of " + escape_html(reference) +
            " with the same kind of field at the same resolution.</p>\n";
  }
  return html;
}

std::string accuracy_section(const Json& summary) {
  std::vector<Row> rows;
  for (const Json& s : at(summary, "/systems")) {
    Row row = head_of(s);
    append(row, {cell(at(s, "/max_error_m"), "%.4f m"), cell(at(s, "/mean_error_m"), "%.3g m"),
                 cell(at(s, "/differing_vox"), "%.0f"), cell(at(s, "/compared_vox"), "%.0f"),
                 cell(at(s, "/memory_mib"), "%.0f MiB")});
    rows.push_back(std::move(row));
  }
  return "<h2>Fields against the exact transform of their own maps; memory</h2>\n" +
         html_table({"system", "field", "voxel", "max error", "mean error", "voxels that differ",
                     "voxels compared", "memory"},
                    rows);
}

std::string truth_section(const Json& summary) {
  std::vector<Row> rows;
  for (const Json& s : at(summary, "/systems")) {
    if (!at(s, "/truth").is_object()) continue;
    Row row = head_of(s);
    append(
        row,
        {cell(at(s, "/truth/collision_recall"), "%.4f"), cell(at(s, "/truth/occupied_vox"), "%.0f"),
         cell(at(s, "/truth/false_obstacle_vox"), "%.0f"),
         cell(at(s, "/truth/appear_frames/max"), "%.0f"),
         cell(at(s, "/truth/gone_frames/p95"), "%.0f"),
         cell(at(s, "/truth/gone_frames/max"), "%.0f"), cell(at(s, "/truth/ghost_vox"), "%.0f"),
         cell(at(s, "/truth/ghost_seen_vox"), "%.0f")});
    rows.push_back(std::move(row));
  }
  if (rows.empty()) return "";
  return "<h2>Maps against the true scene</h2>\n" +
         html_table({"system", "field", "voxel", "collision recall", "occupied", "false obstacles",
                     "frames until it appears, max", "frames until it is gone, p95", "max",
                     "ghost voxels", "of them seen through"},
                    rows);
}

std::string real_time_section(const Json& summary) {
  std::vector<Row> rows;
  for (const Json& s : at(summary, "/systems")) {
    if (!at(s, "/real_time").is_object()) continue;
    Row row = head_of(s);
    append(row, {cell(at(s, "/real_time/frames")), cell(at(s, "/real_time/dropped")),
                 cell(at(s, "/real_time/dropped_share"), "%.3f"),
                 cell(at(s, "/real_time/rate_hz"), "%.1f Hz"),
                 cell(at(s, "/real_time/latency_ms/p50"), "%.1f ms"),
                 cell(at(s, "/real_time/latency_ms/p95"), "%.1f ms"),
                 cell(at(s, "/real_time/latency_ms/max"), "%.1f ms")});
    rows.push_back(std::move(row));
  }
  if (rows.empty()) return "";
  return "<h2>In real time, late frames dropped</h2>\n" +
         html_table({"system", "field", "voxel", "mapped", "dropped", "share", "rate",
                     "latency p50", "p95", "max"},
                    rows);
}

std::string quarters_section(const Json& summary) {
  std::vector<Row> rows;
  for (const Json& s : at(summary, "/systems")) {
    Row times = head_of(s), memory = head_of(s);
    append(times, {"frame p50"});
    append(memory, {"memory"});
    for (const Json& quarter : at(s, "/quarters")) {
      times.push_back(cell(at(quarter, "/frame_ms/p50"), "%.2f ms"));
      memory.push_back(cell(at(quarter, "/memory_mib"), "%.0f MiB"));
    }
    rows.push_back(std::move(times));
    rows.push_back(std::move(memory));
  }
  return "<h2>By quarter of the run</h2>\n" +
         html_table({"system", "field", "voxel", "", "first", "second", "third", "fourth"}, rows);
}

std::string errors_section(const Json& summary) {
  std::string html;
  for (const Json& s : at(summary, "/systems")) {
    for (const char* key : {"/error", "/unmet"}) {
      const std::string text = cell(at(s, key));
      if (text.empty() || text == "-") continue;
      html += "<p class=\"verdict failure\">" +
              escape_html(cell(at(s, "/name")) + ", " + sign_text(s) + ", " +
                          cell(at(s, "/resolution_m"), "%g m") + ": " + text) +
              "</p>\n";
    }
  }
  return html;
}

std::vector<SystemBar> bars_of(const Json& summary) {
  std::vector<SystemBar> bars;
  for (const Json& s : at(summary, "/systems")) {
    if (!at(s, "/frame_ms/p50").is_number()) continue;
    SystemBar bar;
    bar.label = cell(at(s, "/name"));
    bar.resolution_m = at(s, "/resolution_m").get<double>();
    bar.is_signed = at(s, "/signed") == Json(true);
    bar.mean_ms = at(s, "/frame_ms/mean").get<double>();
    bar.p50_ms = at(s, "/frame_ms/p50").get<double>();
    bar.p95_ms = at(s, "/frame_ms/p95").get<double>();
    if (const Json published = at(s, "/published_ms"); published.is_number()) {
      bar.published_ms = published.get<double>();
    }
    bars.push_back(std::move(bar));
  }
  return bars;
}

}  // namespace

Result<std::string> mapping_body(const Json& summary, const std::filesystem::path& run) {
  std::string html = errors_section(summary);
  html += times_section(summary);
  const auto figures =
      figure_section(mapping_figures(bars_of(summary), cell(at(summary, "/published_as"))), run);
  if (!figures) return figures;
  html += *figures;
  html += accuracy_section(summary);
  html += truth_section(summary);
  html += real_time_section(summary);
  return html + quarters_section(summary);
}

}  // namespace sidestep::report
