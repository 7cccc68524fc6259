#pragma once

#include <sidestep/experiments/experiment.hpp>

namespace sidestep {

/// The `incremental_benchmark` experiment: recorded problems whose goal, or whose obstacles, change
/// after they are solved; solved again afresh, from the trajectory before, and incrementally.
[[nodiscard]] ExperimentType incremental_benchmark_experiment();

}  // namespace sidestep
