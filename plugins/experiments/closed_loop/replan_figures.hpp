#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include <sidestep/report/canvas.hpp>
#include <sidestep/runtime/results_store.hpp>

namespace sidestep {

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
