#include <algorithm>
#include <array>
#include <cmath>
#include <iterator>
#include <map>

#include <sidestep/report/chart.hpp>
#include <sidestep/report/report_parts.hpp>

#include "mapping_parts.hpp"

namespace sidestep {
namespace {

using namespace report;

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

/// 0 where there is none.
double number_of(const Json& system, const char* pointer) {
  const Json number = at(system, pointer);
  return number.is_number() ? number.get<double>() : 0.0;
}

LogScale scale_of(const Json& systems) {
  double least = 1e9, most = 0.0;
  for (const Json& system : systems) {
    for (const char* time : {"/frame_ms/mean", "/frame_ms/p50", "/frame_ms/p95", "/published_ms"}) {
      const double value = number_of(system, time);
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

void draw_bar(Canvas& canvas, const LogScale& scale, const Json& system, double top) {
  const double middle = top + 0.5 * kRow;
  canvas.text({kLabels - 10.0, middle + 4.0}, cell(at(system, "/name")),
              {.size = 12.0, .align = Align::kRight});
  const bool is_signed = at(system, "/signed") == Json(true);
  const double p50_ms = number_of(system, "/frame_ms/p50");
  const double end = scale.at(p50_ms), p95 = scale.at(number_of(system, "/frame_ms/p95"));
  canvas.rectangle({kLabels, top + 4.0, std::max(1.0, end - kLabels), kRow - 8.0},
                   is_signed ? palette::kOrange : palette::kBlue);
  const Stroke thin{palette::kBlack, 1.2, {}};
  canvas.line(std::array{Point{end, middle}, Point{p95, middle}}, thin);
  canvas.line(std::array{Point{p95, middle - 5.0}, Point{p95, middle + 5.0}}, thin);
  if (at(system, "/published_ms").is_number()) {
    canvas.ring({scale.at(number_of(system, "/published_ms")), middle}, 5.0,
                {palette::kVermilion, 2.0, {}});
  }
  canvas.text({kWidth - kNumbers + 8.0, middle + 4.0}, format("%.3g ms", p50_ms), {.size = 12.0});
}

/// A bar for each system that could be measured. `published_as` names where published figures are
/// from.
std::vector<Figure> mapping_figures(const Json& systems, const std::string& published_as) {
  const auto is_measured = [](const Json& system) {
    return at(system, "/frame_ms/p50").is_number();
  };
  Json measured = Json::array();
  std::ranges::copy_if(systems, std::back_inserter(measured), is_measured);
  if (measured.empty()) return {};
  std::map<double, std::vector<const Json*>> by_resolution;
  for (const Json& system : measured) {
    by_resolution[number_of(system, "/resolution_m")].push_back(&system);
  }
  double height = 34.0;
  for (const auto& [resolution_m, group] : by_resolution) {
    height += kGroupHead + 24.0 + kRow * static_cast<double>(group.size());
  }
  Figure figure{"mapping_times",
                "Time from a frame in hand to the published field (logarithmic): bars to the "
                "median, whiskers to the 95th percentile.",
                Canvas(kWidth, height)};
  Canvas& canvas = figure.canvas;
  const LogScale scale = scale_of(measured);
  double y = 0.0;
  for (const auto& [resolution_m, group] : by_resolution) {
    canvas.text({0.0, y + 18.0}, format("%g m", resolution_m), {.size = 13.0, .bold = true});
    y += kGroupHead;
    draw_scale(canvas, scale, y, y + kRow * static_cast<double>(group.size()));
    for (const Json* system : group) {
      draw_bar(canvas, scale, *system, y);
      y += kRow;
    }
    y += 24.0;
  }
  std::vector<LegendEntry> legend = {
      {"unsigned", LegendEntry::Mark::kBox, {palette::kBlue, 1.0, {}}},
      {"signed", LegendEntry::Mark::kBox, {palette::kOrange, 1.0, {}}}};
  if (std::ranges::any_of(
          measured, [](const Json& system) { return at(system, "/published_ms").is_number(); })) {
    legend.push_back(
        {published_as + ", mean", LegendEntry::Mark::kCircle, {palette::kVermilion, 2.0, {}}});
  }
  draw_legend(canvas, {0.0, y}, kWidth, legend);
  std::vector<Figure> figures;
  figures.push_back(std::move(figure));
  return figures;
}

/// Name, field, resolution: what every table begins with.
const Columns kHead = {{"system", "/name"},
                       {"field", "/signed", "signed|unsigned"},
                       {"voxel", "/resolution_m", "%g m"}};

std::string quarters_section(const Json& summary) {
  std::vector<Row> rows;
  for (const Json& s : at(summary, "/systems")) {
    Row times = cells_of(s, kHead), memory = cells_of(s, kHead);
    times.push_back("frame p50");
    memory.push_back("memory");
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

Result<std::string> mapping_body(const Json& summary, ResultsReader&,
                                 const std::filesystem::path& run) {
  const Json systems = at(summary, "/systems");
  const std::string published_as = cell(at(summary, "/published_as"));
  std::string html = errors_section(summary);
  html += SIDESTEP_TRY(figure_section(mapping_figures(systems, published_as), run));
  if (published_as != "-" && !published_as.empty()) {
    html += "<p>Published: " + escape_html(published_as) + ".</p>\n";
  }
  html += mapping_columns().html(systems);
  return html + quarters_section(summary);
}

}  // namespace

const report::RunReport& mapping_report() {
  static const report::RunReport kReport = {
      .body = &mapping_body, .columns = &mapping_columns(), .pictures = {"mapping_times."}};
  return kReport;
}

}  // namespace sidestep
