#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include <sidestep/report/canvas.hpp>
#include <sidestep/runtime/results_store.hpp>

namespace sidestep {

/// The pictures of the map: depth images and frame times, as far as they were recorded.
[[nodiscard]] Result<std::vector<Figure>> map_figures(ResultsReader& results);

/// The pictures of one plan: slices, joints, velocities, clearance, as far as they were recorded.
[[nodiscard]] Result<std::vector<Figure>> plan_figures(ResultsReader& results, std::int64_t item,
                                                       const std::string& name);

}  // namespace sidestep
