#include "study_figures.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <map>

#include <sidestep/core/index.hpp>
#include <sidestep/report/chart.hpp>
#include <sidestep/results/intervals.hpp>
#include <sidestep/results/statistics.hpp>

namespace sidestep {
namespace {

constexpr double kPanelWidth = 360.0;
constexpr double kPanelHeight = 280.0;
constexpr double kLegend = 26.0;
constexpr int kSizeBins = 6;
constexpr int kCostBins = 40;
/// Iterations beyond this share of all solves go into the last bin.
constexpr double kShownIterations = 0.995;
/// Points of a scatter plot; more hide each other.
constexpr std::size_t kMostPoints = 4000;

const std::array<Colour, 2> kColours = {palette::kBlue, palette::kOrange};

double log_cost(const ProblemOutcome& problem, std::size_t kind) {
  return std::log10(std::max(problem.fields[kind].cost, 1e-9));
}

/// An empty figure with one panel a robot and the legend of both fields.
class Panels {
 public:
  Panels(std::string file, std::string caption, std::size_t count, bool with_legend)
      : figure_{std::move(file), std::move(caption),
                Canvas(kPanelWidth * static_cast<double>(count),
                       kPanelHeight + (with_legend ? kLegend : 0.0))} {
    if (!with_legend) return;
    draw_legend(figure_.canvas, {58.0, kPanelHeight + 8.0}, figure_.canvas.width(),
                {{"unsigned", LegendEntry::Mark::kLine, {kColours[kUnsigned], 2.0, {}}},
                 {"signed", LegendEntry::Mark::kLine, {kColours[kSigned], 2.0, {4.0, 3.0}}}});
  }

  [[nodiscard]] Axes axes(std::size_t panel, const Range& x, const Range& y,
                          const Axes::Labels& labels) {
    const Area area{kPanelWidth * static_cast<double>(panel), 0.0, kPanelWidth, kPanelHeight};
    return {figure_.canvas, area, x, y, labels};
  }
  [[nodiscard]] Canvas& canvas() { return figure_.canvas; }
  [[nodiscard]] Figure take() { return std::move(figure_); }

 private:
  Figure figure_;
};

Stroke stroke_of(std::size_t kind) {
  return {kColours[kind], 2.0,
          kind == kSigned ? std::vector<double>{4.0, 3.0} : std::vector<double>{}};
}

/// Failures among the solvable problems of scenes of about one size.
struct SizeBin {
  double size_m = 0.0;
  std::int64_t solvable = 0;
  std::array<std::int64_t, 2> failures{};
};

std::vector<SizeBin> size_bins(const StudyRobotRows& robot) {
  Range range{0.0, 0.0};
  std::map<std::int64_t, double> size_of;
  for (const SceneRow& scene : robot.drawn) {
    size_of[scene.scene] = scene.mean_side_m;
    range.include(scene.mean_side_m);
  }
  std::vector<SizeBin> bins(kSizeBins);
  const double width = std::max(range.upper, 1e-9) / kSizeBins;
  for (int b = 0; b < kSizeBins; ++b) bins[idx(b)].size_m = (b + 0.5) * width;
  for (const ProblemOutcome& problem : robot.problems) {
    if (!problem.is_solvable()) continue;
    const auto index = static_cast<int>(size_of[robot.scene_of(problem)] / width);
    SizeBin& bin = bins[idx(std::clamp(index, 0, kSizeBins - 1))];
    ++bin.solvable;
    for (const std::size_t kind : {kUnsigned, kSigned}) {
      if (!problem.fields[kind].collision_free) ++bin.failures[kind];
    }
  }
  std::erase_if(bins, [](const SizeBin& bin) { return bin.solvable == 0; });
  return bins;
}

Figure failures_figure(const StudyRecord& study) {
  Panels panels("study_failures",
                "Failures among the problems that at least one field solves, by the size of the "
                "obstacles, with Wilson's intervals.",
                study.robots.size(), true);
  for (std::size_t r = 0; r < study.robots.size(); ++r) {
    const std::vector<SizeBin> bins = size_bins(study.robots[r]);
    Range x{0.0, 0.0}, y{0.0, 0.0};
    for (const SizeBin& bin : bins) {
      x.include(bin.size_m * 1.15);
      for (const std::int64_t failures : bin.failures) {
        y.include(105.0 * wilson_interval(failures, bin.solvable, study.confidence).upper);
      }
    }
    Axes axes = panels.axes(r, x.padded(0.0), y.padded(0.02),
                            {study.robots[r].name, "mean side of the boxes [m]", "failures [%]"});
    axes.grid();
    for (const std::size_t kind : {kUnsigned, kSigned}) {
      std::vector<double> sizes, shares;
      for (const SizeBin& bin : bins) {
        const double shift_m = (kind == kSigned ? 1.0 : -1.0) * 0.008 * x.upper;
        const Interval interval =
            wilson_interval(bin.failures[kind], bin.solvable, study.confidence);
        axes.line({bin.size_m + shift_m, bin.size_m + shift_m},
                  {100.0 * interval.lower, 100.0 * interval.upper}, {kColours[kind], 1.2, {}});
        sizes.push_back(bin.size_m + shift_m);
        shares.push_back(100.0 * static_cast<double>(bin.failures[kind]) /
                         static_cast<double>(bin.solvable));
      }
      axes.line(sizes, shares, stroke_of(kind));
    }
    axes.finish();
  }
  return panels.take();
}

/// A histogram as the outline of its bars: shares of all values, in percent.
struct Outline {
  std::vector<double> x;
  std::vector<double> percent;
};

Outline histogram(const std::vector<double>& values, double lower, double width, int bins) {
  std::vector<double> counts(static_cast<std::size_t>(bins), 0.0);
  for (const double value : values) {
    const double bin = std::floor((value - lower) / width);
    counts[idx(std::clamp(bin, 0.0, bins - 1.0))] += 1.0;
  }
  Outline outline;
  for (int b = 0; b < bins; ++b) {
    const double percent =
        values.empty() ? 0.0 : 100.0 * counts[idx(b)] / static_cast<double>(values.size());
    for (const double edge : {0.0, 1.0}) {
      outline.x.push_back(lower + (b + edge) * width);
      outline.percent.push_back(percent);
    }
  }
  return outline;
}

void draw_histograms(Panels& panels, std::size_t panel, const std::array<Outline, 2>& outlines,
                     const Axes::Labels& labels) {
  Range y{0.0, 0.0};
  for (const Outline& outline : outlines) {
    for (const double percent : outline.percent) y.include(1.05 * percent);
  }
  const Range x{outlines[0].x.front(), outlines[0].x.back()};
  Axes axes = panels.axes(panel, x, {0.0, std::max(y.upper, 1.0)}, labels);
  axes.grid();
  for (const std::size_t kind : {kUnsigned, kSigned}) {
    axes.line(outlines[kind].x, outlines[kind].percent, stroke_of(kind));
  }
  axes.finish();
}

Figure iterations_figure(const StudyRecord& study) {
  Panels panels("study_iterations", "Iterations of every solve; the last bin holds all beyond it.",
                study.robots.size(), true);
  for (std::size_t r = 0; r < study.robots.size(); ++r) {
    std::array<std::vector<double>, 2> values;
    for (const ProblemOutcome& problem : study.robots[r].problems) {
      for (const std::size_t kind : {kUnsigned, kSigned}) {
        if (problem.fields[kind].attempted) values[kind].push_back(problem.fields[kind].iterations);
      }
    }
    const double most = std::max({5.0, percentile(values[kUnsigned], kShownIterations),
                                  percentile(values[kSigned], kShownIterations)});
    const int bins = static_cast<int>(std::min(most, 50.0)) + 1;
    const double width = std::max(1.0, std::ceil(most / bins));
    std::array<Outline, 2> outlines;
    for (const std::size_t kind : {kUnsigned, kSigned}) {
      outlines[kind] = histogram(values[kind], 0.0, width, bins);
    }
    draw_histograms(panels, r, outlines,
                    {study.robots[r].name, "iterations", "share of solves [%]"});
  }
  return panels.take();
}

Range cost_range(const StudyRobotRows& robot) {
  std::vector<double> costs;
  for (const ProblemOutcome& problem : robot.problems) {
    if (!problem.is_solved_by_both()) continue;
    for (const std::size_t kind : {kUnsigned, kSigned}) costs.push_back(log_cost(problem, kind));
  }
  if (costs.empty()) return {0.0, 1.0};
  const auto [least, most] = std::ranges::minmax(costs);
  return Range{least, most}.padded(0.02);
}

Figure costs_figure(const StudyRecord& study) {
  Panels panels("study_costs",
                "Costs of trajectories, where both fields lead to collision-free ones.",
                study.robots.size(), true);
  for (std::size_t r = 0; r < study.robots.size(); ++r) {
    const Range range = cost_range(study.robots[r]);
    const double width = (range.upper - range.lower) / kCostBins;
    std::array<Outline, 2> outlines;
    for (const std::size_t kind : {kUnsigned, kSigned}) {
      std::vector<double> values;
      for (const ProblemOutcome& problem : study.robots[r].problems) {
        if (problem.is_solved_by_both()) values.push_back(log_cost(problem, kind));
      }
      outlines[kind] = histogram(values, range.lower, width, kCostBins);
    }
    draw_histograms(panels, r, outlines,
                    {study.robots[r].name, "log10 of the cost", "share of problems [%]"});
  }
  return panels.take();
}

Figure scatter_figure(const StudyRecord& study) {
  Panels panels("study_scatter",
                "The cost in the signed field against that in the unsigned one, problem by "
                "problem, where both are collision-free.",
                study.robots.size(), false);
  for (std::size_t r = 0; r < study.robots.size(); ++r) {
    const StudyRobotRows& robot = study.robots[r];
    const Range range = cost_range(robot);
    Axes axes = panels.axes(r, range, range, {robot.name, "log10 of the cost, unsigned", "signed"});
    axes.grid();
    axes.line({range.lower, range.upper}, {range.lower, range.upper}, {palette::kGrey, 1.0, {}});
    const std::size_t stride = robot.problems.size() / kMostPoints + 1;
    for (std::size_t i = 0; i < robot.problems.size(); ++i) {
      const ProblemOutcome& problem = robot.problems[i];
      if (!problem.is_solved_by_both()) continue;
      // All that differ are drawn, of those that agree every n-th.
      const double plain = log_cost(problem, kUnsigned), sign = log_cost(problem, kSigned);
      if (std::abs(plain - sign) < 0.01 && i % stride != 0) continue;
      panels.canvas().circle(axes.at(plain, sign), 1.6, palette::kPurple.with_alpha(0.45));
    }
    axes.finish();
  }
  return panels.take();
}

}  // namespace

std::vector<Figure> study_figures(const StudyRecord& study) {
  std::vector<Figure> figures;
  if (study.solved() == 0) return figures;
  figures.push_back(failures_figure(study));
  figures.push_back(iterations_figure(study));
  figures.push_back(costs_figure(study));
  figures.push_back(scatter_figure(study));
  return figures;
}

}  // namespace sidestep
