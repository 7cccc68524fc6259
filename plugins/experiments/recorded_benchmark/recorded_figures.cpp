#include "recorded_figures.hpp"

#include <algorithm>
#include <array>
#include <cmath>

#include <sidestep/report/chart.hpp>

namespace sidestep {
namespace {

constexpr double kWidth = 900.0;
constexpr double kHeight = 460.0;
constexpr std::array kColours = {palette::kBlue,   palette::kOrange, palette::kGreen,
                                 palette::kPurple, palette::kSky,    palette::kVermilion};

Colour colour_of(std::size_t run) { return kColours[run % kColours.size()]; }

/// Decimal logarithms; what has none counts as 1e-12.
std::vector<double> logarithms(const std::vector<double>& values) {
  std::vector<double> logs;
  for (const double value : values) logs.push_back(std::log10(std::max(value, 1e-12)));
  return logs;
}

Range range_of(const std::vector<std::vector<double>>& lists) {
  Range range{INFINITY, -INFINITY};
  for (const auto& values : lists) {
    for (const double value : values) range.include(value);
  }
  return range.lower <= range.upper ? range.padded(0.04) : Range{};
}

Figure cost_figure(const std::vector<PlannerSeries>& runs) {
  Figure figure{"planner_costs",
                "Final cost of each problem against the peer's, both as decimal logarithms; on the "
                "line they are equal, below it ours is lower.",
                Canvas(kWidth, kHeight)};
  std::vector<std::vector<double>> ours, peers;
  for (const PlannerSeries& run : runs) {
    ours.push_back(logarithms(run.cost));
    peers.push_back(logarithms(run.peer_cost));
  }
  std::vector<std::vector<double>> all = ours;
  all.insert(all.end(), peers.begin(), peers.end());
  const Range range = range_of(all);
  Axes axes(figure.canvas, {0.0, 0.0, kWidth, kHeight - 30.0}, range, range,
            {"Cost", "log10 of the peer's cost", "log10 of the cost"});
  axes.grid();
  axes.line({range.lower, range.upper}, {range.lower, range.upper},
            {palette::kGrey, 1.0, {5.0, 4.0}});
  std::vector<LegendEntry> legend;
  for (std::size_t r = 0; r < runs.size(); ++r) {
    const Colour fill = colour_of(r).with_alpha(0.5);
    for (std::size_t i = 0; i < std::min(ours[r].size(), peers[r].size()); ++i) {
      figure.canvas.circle(axes.at(peers[r][i], ours[r][i]), 2.2, fill);
    }
    legend.push_back({runs[r].label, LegendEntry::Mark::kBox, {colour_of(r), 1.0, {}}});
  }
  axes.finish();
  draw_legend(figure.canvas, {58.0, kHeight - 26.0}, kWidth - 60.0, legend);
  return figure;
}

/// Which share of the problems takes no longer than so much.
void draw_shares(Axes& axes, std::vector<double> log_ms, const Stroke& stroke) {
  if (log_ms.empty()) return;
  std::ranges::sort(log_ms);
  std::vector<double> shares;
  for (std::size_t i = 0; i < log_ms.size(); ++i) {
    shares.push_back(static_cast<double>(i + 1) / static_cast<double>(log_ms.size()));
  }
  axes.line(log_ms, shares, stroke);
}

Figure time_figure(const std::vector<PlannerSeries>& runs) {
  Figure figure{"planner_times",
                "Share of the problems that are solved within a time (decimal logarithm of "
                "milliseconds); dashed: the peer's CPU times, as recorded.",
                Canvas(kWidth, kHeight)};
  std::vector<std::vector<double>> all;
  for (const PlannerSeries& run : runs) {
    all.push_back(logarithms(run.solve_ms));
    all.push_back(logarithms(run.peer_solve_ms));
  }
  Axes axes(figure.canvas, {0.0, 0.0, kWidth, kHeight - 30.0}, range_of(all), {0.0, 1.0},
            {"Time of a solve", "log10 of ms", "share of problems"});
  axes.grid();
  std::vector<LegendEntry> legend;
  for (std::size_t r = 0; r < runs.size(); ++r) {
    const Stroke stroke{colour_of(r), 1.6, {}};
    draw_shares(axes, all[2 * r], stroke);
    draw_shares(axes, all[2 * r + 1], {colour_of(r), 1.2, {4.0, 3.0}});
    legend.push_back({runs[r].label, LegendEntry::Mark::kLine, stroke});
  }
  axes.finish();
  draw_legend(figure.canvas, {58.0, kHeight - 26.0}, kWidth - 60.0, legend);
  return figure;
}

}  // namespace

std::vector<Figure> recorded_figures(const std::vector<PlannerSeries>& runs,
                                     bool costs_comparable) {
  std::vector<Figure> figures;
  if (runs.empty()) return figures;
  if (costs_comparable) figures.push_back(cost_figure(runs));
  figures.push_back(time_figure(runs));
  return figures;
}

}  // namespace sidestep
