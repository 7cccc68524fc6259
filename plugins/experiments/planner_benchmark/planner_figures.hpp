#pragma once

#include <vector>

#include <sidestep/report/canvas.hpp>
#include "planner_rows.hpp"

namespace sidestep {

/// The pictures of a planner benchmark: success against time, and times family by family.
[[nodiscard]] std::vector<Figure> planner_figures(const PlannerBenchmarkRecord& record);

}  // namespace sidestep
