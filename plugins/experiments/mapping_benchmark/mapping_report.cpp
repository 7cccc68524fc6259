#include <algorithm>
#include <array>
#include <cmath>
#include <map>
#include <optional>

#include <sidestep/report/chart.hpp>
#include <sidestep/report/report_parts.hpp>
#include <sidestep/report/result_columns.hpp>

#include "mapping_parts.hpp"

namespace sidestep {
namespace {

using namespace report;

/// One bar of the chart.
struct SystemBar {
  std::string label;
  double resolution_m = 0.0;
  bool is_signed = false;
  double mean_ms = 0.0;
  double p50_ms = 0.0;
  double p95_ms = 0.0;
  std::optional<double> published_ms;
};

constexpr double kWidth = 900.0;
constexpr double kLabels = 250.0;
constexpr double kNumbers = 70.0;
constexpr double kRow = 24.0;
constexpr double kGroupHead = 30.0;

/// A logarithmic scale of milliseconds, whole decades.
struct LogScale {
  int from = 0;  ///< Powers of ten.
  int to = 1;

  [[nodiscard]] double at(double value_ms) const {
    const double share = (std::log10(std::max(value_ms, 1e-6)) - from) / (to - from);
    return kLabels + std::clamp(share, 0.0, 1.0) * (kWidth - kLabels - kNumbers);
  }
};

LogScale scale_of(const std::vector<SystemBar>& bars) {
  double least = 1e9, most = 0.0;
  for (const SystemBar& bar : bars) {
    for (const double value : {bar.mean_ms, bar.p50_ms, bar.p95_ms, bar.published_ms.value_or(0)}) {
      if (value > 0.0) least = std::min(least, value);
      most = std::max(most, value);
    }
  }
  if (!(most > 0.0)) return {};
  const int from = static_cast<int>(std::floor(std::log10(least) - 0.05));
  return {from, std::max(from + 1, static_cast<int>(std::ceil(std::log10(most))))};
}

void draw_scale(Canvas& canvas, const LogScale& scale, double top, double bottom) {
  for (int decade = scale.from; decade <= scale.to; ++decade) {
    const double x = scale.at(std::pow(10.0, decade));
    canvas.line(std::array{Point{x, top}, Point{x, bottom}}, {colour(0xDDDDDD), 1.0, {}});
    canvas.text({x, top - 5.0}, format("%g ms", std::pow(10.0, decade)),
                {.size = 11.0, .align = Align::kCentre});
  }
}

void draw_bar(Canvas& canvas, const LogScale& scale, const SystemBar& bar, double top) {
  const double middle = top + 0.5 * kRow;
  canvas.text({kLabels - 10.0, middle + 4.0}, bar.label, {.size = 12.0, .align = Align::kRight});
  const Colour fill = bar.is_signed ? palette::kOrange : palette::kBlue;
  const double end = scale.at(bar.p50_ms);
  canvas.rectangle({kLabels, top + 4.0, std::max(1.0, end - kLabels), kRow - 8.0}, fill);
  const Stroke thin{palette::kBlack, 1.2, {}};
  const double p95 = scale.at(bar.p95_ms);
  canvas.line(std::array{Point{end, middle}, Point{p95, middle}}, thin);
  canvas.line(std::array{Point{p95, middle - 5.0}, Point{p95, middle + 5.0}}, thin);
  if (bar.published_ms) {
    canvas.ring({scale.at(*bar.published_ms), middle}, 5.0, {palette::kVermilion, 2.0, {}});
  }
  canvas.text({kWidth - kNumbers + 8.0, middle + 4.0}, format("%.3g ms", bar.p50_ms),
              {.size = 12.0});
}

/// `published_as` names where published figures are from.
std::vector<Figure> mapping_figures(const std::vector<SystemBar>& bars,
                                    const std::string& published_as) {
  if (bars.empty()) return {};
  std::map<double, std::vector<const SystemBar*>> by_resolution;
  for (const SystemBar& bar : bars) by_resolution[bar.resolution_m].push_back(&bar);
  double height = 34.0;
  for (const auto& [resolution_m, group] : by_resolution) {
    height += kGroupHead + 24.0 + kRow * static_cast<double>(group.size());
  }
  Figure figure{"mapping_times",
                "Time from a frame in hand to the published field (logarithmic): bars to the "
                "median, whiskers to the 95th percentile.",
                Canvas(kWidth, height)};
  const LogScale scale = scale_of(bars);
  double y = 0.0;
  for (const auto& [resolution_m, group] : by_resolution) {
    figure.canvas.text({0.0, y + 18.0}, format("%g m", resolution_m), {.size = 13.0, .bold = true});
    y += kGroupHead;
    draw_scale(figure.canvas, scale, y, y + kRow * static_cast<double>(group.size()));
    for (const SystemBar* bar : group) {
      draw_bar(figure.canvas, scale, *bar, y);
      y += kRow;
    }
    y += 24.0;
  }
  std::vector<LegendEntry> legend = {
      {"unsigned", LegendEntry::Mark::kBox, {palette::kBlue, 1.0, {}}},
      {"signed", LegendEntry::Mark::kBox, {palette::kOrange, 1.0, {}}}};
  if (std::ranges::any_of(bars,
                          [](const SystemBar& bar) { return bar.published_ms.has_value(); })) {
    legend.push_back(
        {published_as + ", mean", LegendEntry::Mark::kCircle, {palette::kVermilion, 2.0, {}}});
  }
  draw_legend(figure.canvas, {0.0, y}, kWidth, legend);
  std::vector<Figure> figures;
  figures.push_back(std::move(figure));
  return figures;
}

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

const report::RunReport& mapping_report() {
  static const report::RunReport kReport = {
      .body = &mapping_body, .columns = &mapping_columns(), .pictures = {"mapping_times."}};
  return kReport;
}

}  // namespace sidestep
