#include <algorithm>

#include <sidestep/report/html.hpp>
#include <sidestep/report/run_report.hpp>
#include "mapping_figures.hpp"
#include "mapping_summary.hpp"

namespace sidestep::report {
namespace {

/// Name, field, resolution: what every table begins with.
const Columns kHead = {{"system", "/name"},
                       {"field", "/signed", "signed|unsigned"},
                       {"voxel", "/resolution_m", "%g m"}};

void append(Row& row, Row more) {
  row.insert(row.end(), std::make_move_iterator(more.begin()), std::make_move_iterator(more.end()));
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
  const auto figures = SIDESTEP_TRY(
      figure_section(mapping_figures(bars_of(summary), cell(at(summary, "/published_as"))), run));
  std::string html = errors_section(summary) + figures;
  if (const std::string name = cell(at(summary, "/published_as")); name != "-" && !name.empty()) {
    html += "<p>Published: " + escape_html(name) + ".</p>\n";
  }
  html += mapping_columns().html(at(summary, "/systems"));
  return html + quarters_section(summary);
}

}  // namespace
}  // namespace sidestep::report

namespace sidestep {

const report::RunReport& mapping_report() {
  static const report::RunReport kReport = {
      .body = &report::mapping_body, .columns = &mapping_columns(), .pictures = {"mapping_times."}};
  return kReport;
}

}  // namespace sidestep
