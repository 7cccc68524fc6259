#include <algorithm>

#include "mapping/mapping_figures.hpp"
#include "mapping/mapping_summary.hpp"
#include "report/html.hpp"
#include "report/run_report.hpp"

namespace sidestep::report {
namespace {

/// Name, field, resolution: what every table begins with.
const Columns kHead = {{"system", "/name"},
                       {"field", "/signed", "signed|unsigned"},
                       {"voxel", "/resolution_m", "%g m"}};

Columns with_head(const Columns& columns) {
  Columns all = kHead;
  all.insert(all.end(), columns.begin(), columns.end());
  return all;
}

void append(Row& row, Row more) {
  row.insert(row.end(), std::make_move_iterator(more.begin()), std::make_move_iterator(more.end()));
}

std::string times_section(const Json& summary) {
  std::vector<Row> rows;
  for (const Json& s : at(summary, "/systems")) {
    Row row = cells_of(s, kHead);
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
  return "<h2>Fields against the exact transform of their own maps; memory</h2>\n" +
         html_table(with_head({{"max error", "/max_error_m", "%.4f m"},
                               {"mean error", "/mean_error_m", "%.3g m"},
                               {"voxels that differ", "/differing_vox", "%.0f"},
                               {"voxels compared", "/compared_vox", "%.0f"},
                               {"memory", "/memory_mib", "%.0f MiB"}}),
                    at(summary, "/systems"));
}

std::string truth_section(const Json& summary) {
  const Json with_truth = those_with("/truth", at(summary, "/systems"));
  if (with_truth.empty()) return "";
  return "<h2>Maps against the true scene</h2>\n" +
         html_table(with_head({{"collision recall", "/truth/collision_recall", "%.4f"},
                               {"occupied", "/truth/occupied_vox", "%.0f"},
                               {"false obstacles", "/truth/false_obstacle_vox", "%.0f"},
                               {"frames until it appears, max", "/truth/appear_frames/max", "%.0f"},
                               {"frames until it is gone, p95", "/truth/gone_frames/p95", "%.0f"},
                               {"max", "/truth/gone_frames/max", "%.0f"},
                               {"ghost voxels", "/truth/ghost_vox", "%.0f"},
                               {"of them seen through", "/truth/ghost_seen_vox", "%.0f"}}),
                    with_truth);
}

std::string real_time_section(const Json& summary) {
  const Json in_real_time = those_with("/real_time", at(summary, "/systems"));
  if (in_real_time.empty()) return "";
  return "<h2>In real time, late frames dropped</h2>\n" +
         html_table(with_head({{"mapped", "/real_time/frames"},
                               {"dropped", "/real_time/dropped"},
                               {"share", "/real_time/dropped_share", "%.3f"},
                               {"rate", "/real_time/rate_hz", "%.1f Hz"},
                               {"latency p50", "/real_time/latency_ms/p50", "%.1f ms"},
                               {"p95", "/real_time/latency_ms/p95", "%.1f ms"},
                               {"max", "/real_time/latency_ms/max", "%.1f ms"}}),
                    in_real_time);
}

std::string quarters_section(const Json& summary) {
  std::vector<Row> rows;
  for (const Json& s : at(summary, "/systems")) {
    Row times = cells_of(s, kHead), memory = cells_of(s, kHead);
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
      const Row head = cells_of(s, kHead);
      html += "<p class=\"verdict failure\">" +
              escape_html(head[0] + ", " + head[1] + ", " + head[2] + ": " + text) + "</p>\n";
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

Result<std::string> mapping_body(const Json& summary, ResultsReader&,
                                 const std::filesystem::path& run) {
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

}  // namespace
}  // namespace sidestep::report

namespace sidestep {

const report::RunReport& mapping_report() {
  static const report::RunReport kReport = {
      &report::mapping_body,
      {{"system", "/name"},
       {"field", "/signed", "signed|unsigned"},
       {"voxel", "/resolution_m", "%g m"},
       {"frame p50", "/frame_ms/p50", "%.2f ms"},
       {"frame p95", "/frame_ms/p95", "%.2f ms"},
       {"max error", "/max_error_m", "%.4f m"},
       {"mean error", "/mean_error_m", "%.2g m"},
       {"memory", "/memory_mib", "%.0f MiB"},
       {"frames", "/frames"}},
      [](const report::Json& summary) { return report::at(summary, "/systems"); }};
  return kReport;
}

}  // namespace sidestep
