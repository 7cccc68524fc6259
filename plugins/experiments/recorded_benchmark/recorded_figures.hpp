#pragma once

#include <string>
#include <vector>

#include <sidestep/report/canvas.hpp>

namespace sidestep {

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

}  // namespace sidestep
