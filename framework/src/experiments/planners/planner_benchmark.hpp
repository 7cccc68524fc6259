#pragma once

#include <sidestep/experiments/experiment.hpp>

namespace sidestep {

/// The `planner_benchmark` experiment: planners on problem sets whose shapes are known exactly,
/// each answer held against the shapes by the independent check.
[[nodiscard]] ExperimentType planner_benchmark_experiment();

}  // namespace sidestep
