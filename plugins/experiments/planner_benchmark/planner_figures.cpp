#include "planner_figures.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <string>

#include <sidestep/report/chart.hpp>

namespace sidestep {
namespace {

constexpr double kWidth = 900.0;
constexpr double kHeight = 400.0;
constexpr double kPanelWidth = 300.0;
constexpr double kPanelHeight = 240.0;
constexpr std::size_t kPanelsInRow = 3;
constexpr double kLegendRow = 20.0;
constexpr double kLegendLeft = 58.0;
constexpr double kLeastTime_ms = 1e-3;  // a logarithm needs one
constexpr std::array kColours = {palette::kBlue,      palette::kOrange, palette::kGreen,
                                 palette::kVermilion, palette::kPurple, palette::kSky,
                                 palette::kBlack};

/// Colours come again with other dashes.
Stroke stroke_of(std::size_t planner) {
  const std::vector<std::vector<double>> dashes = {{}, {6.0, 3.0}, {2.0, 3.0}};
  return {kColours[planner % kColours.size()], 1.8,
          dashes[planner / kColours.size() % dashes.size()]};
}

double log_ms(double time_ms) { return std::log10(std::max(time_ms, kLeastTime_ms)); }

/// From the fastest answer of all to the deadline.
Range time_range(const PlannerBenchmarkRecord& record) {
  Range range{log_ms(1e3 * record.deadline_s), log_ms(1e3 * record.deadline_s)};
  for (const PlannerRecord& planner : record.planners) {
    for (const SetSolve& solve : planner.solves) {
      if (solve.is_solved()) range.include(log_ms(solve.first_ms()));
    }
  }
  return range.padded(0.03);
}

/// Which share of the answers to a family's problems (all for an empty name) is there by a time:
/// a step up at each first valid answer.
void draw_success(Axes& axes, const PlannerRecord& planner, const std::string& family,
                  const Range& range, const Stroke& stroke) {
  std::vector<double> times;
  double all = 0.0;
  for (const SetSolve& solve : planner.solves) {
    if (!family.empty() && solve.family != family) continue;
    ++all;
    if (solve.is_solved()) times.push_back(log_ms(solve.first_ms()));
  }
  if (all == 0.0) return;
  std::ranges::sort(times);
  std::vector<double> x{range.lower}, share{0.0};
  for (const double time : times) {
    x.insert(x.end(), {time, time});
    share.insert(share.end(), {share.back(), share.back() + 1.0 / all});
  }
  x.push_back(range.upper);
  share.push_back(share.back());
  axes.line(x, share, stroke);
}

std::vector<std::string> families_of(const PlannerBenchmarkRecord& record) {
  std::vector<std::string> families;
  for (const ProblemName& name : record.names) {
    if (std::ranges::find(families, name.family) == families.end()) families.push_back(name.family);
  }
  return families;
}

void draw_planner_legend(const PlannerBenchmarkRecord& record, double top, Canvas& canvas) {
  std::vector<LegendEntry> legend;
  for (std::size_t p = 0; p < record.planners.size(); ++p) {
    legend.push_back({record.planners[p].name, LegendEntry::Mark::kLine, stroke_of(p)});
  }
  draw_legend(canvas, {kLegendLeft, top}, canvas.width() - kLegendLeft, legend);
}

/// Rows enough for three planners each, which any names leave room for.
double legend_height(const PlannerBenchmarkRecord& record) {
  return kLegendRow * (1.0 + std::ceil(static_cast<double>(record.planners.size()) / 3.0));
}

void draw_panel(const PlannerBenchmarkRecord& record, const std::string& family, const Area& area,
                const std::string& title, Canvas& canvas) {
  const Range range = time_range(record);
  Axes axes(canvas, area, range, {0.0, 1.02}, {title, "time [ms]", "share solved", true});
  axes.grid();
  for (std::size_t p = 0; p < record.planners.size(); ++p) {
    draw_success(axes, record.planners[p], family, range, stroke_of(p));
  }
  axes.finish();
}

Figure success_figure(const PlannerBenchmarkRecord& record) {
  Figure figure{"planner_success",
                "Share of all problems with a first answer, accepted by the independent check, "
                "within a time.",
                Canvas(kWidth, kHeight + legend_height(record))};
  draw_panel(record, "", {0.0, 0.0, kWidth, kHeight}, "Success against time", figure.canvas);
  draw_planner_legend(record, kHeight, figure.canvas);
  return figure;
}

Figure families_figure(const PlannerBenchmarkRecord& record) {
  const std::vector<std::string> families = families_of(record);
  const double rows = std::ceil(static_cast<double>(families.size()) / kPanelsInRow);
  Figure figure{"planner_families",
                "Times until the first accepted answer, family by family, as cumulative shares of "
                "the family's problems.",
                Canvas(kWidth, rows * kPanelHeight + legend_height(record))};
  for (std::size_t f = 0; f < families.size(); ++f) {
    const Area area{kPanelWidth * static_cast<double>(f % kPanelsInRow),
                    kPanelHeight * static_cast<double>(f / kPanelsInRow), kPanelWidth,
                    kPanelHeight};
    draw_panel(record, families[f], area, families[f], figure.canvas);
  }
  draw_planner_legend(record, rows * kPanelHeight, figure.canvas);
  return figure;
}

}  // namespace

std::vector<Figure> planner_figures(const PlannerBenchmarkRecord& record) {
  std::vector<Figure> figures;
  if (record.solved() == 0) return figures;
  figures.push_back(success_figure(record));
  figures.push_back(families_figure(record));
  return figures;
}

}  // namespace sidestep
