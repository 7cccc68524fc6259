#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include <sidestep/runtime/results_store.hpp>

#include "report/canvas.hpp"

namespace sidestep {

/// One picture of a report.
struct Figure {
  std::string file;  ///< Name without suffix.
  std::string caption;
  Canvas canvas;
};

/// The pictures of the map: depth images and frame times, as far as they were recorded.
[[nodiscard]] Result<std::vector<Figure>> map_figures(ResultsReader& results);

/// The pictures of one plan: slices, joints, velocities, clearance, as far as they were recorded.
[[nodiscard]] Result<std::vector<Figure>> plan_figures(ResultsReader& results, std::int64_t item,
                                                       const std::string& name);

/// One bar of the chart of a mapping benchmark.
struct SystemBar {
  std::string label;
  double resolution_m = 0.0;
  bool is_signed = false;
  double mean_ms = 0.0;
  double p50_ms = 0.0;
  double p95_ms = 0.0;
  std::optional<double> published_ms;
};

/// The pictures of a mapping benchmark; `published_as` names where published figures are from.
[[nodiscard]] std::vector<Figure> mapping_figures(const std::vector<SystemBar>& bars,
                                                  const std::string& published_as);

/// What the charts of a benchmark on recorded problems show of one run; one number a problem.
struct PlannerSeries {
  std::string label;
  std::vector<double> cost;
  std::vector<double> peer_cost;
  std::vector<double> solve_ms;
  std::vector<double> peer_solve_ms;
};

/// The pictures of a benchmark on recorded problems: costs, where they can be compared, and times.
[[nodiscard]] std::vector<Figure> recorded_figures(const std::vector<PlannerSeries>& runs,
                                                   bool costs_comparable);

/// What was measured of one quantity.
struct Spread {
  std::string label;  ///< With its unit.
  std::vector<double> values;
};

/// Cumulative shares of what was measured, side by side; nothing where there are not at least five
/// values of anything.
[[nodiscard]] std::vector<Figure> spread_figures(const std::vector<Spread>& spreads);

/// The pictures of one episode of a closed loop, as far as they were recorded: from above, and over
/// time.
[[nodiscard]] Result<std::vector<Figure>> replan_figures(ResultsReader& results,
                                                         std::int64_t episode);

}  // namespace sidestep
