#pragma once

#include <sidestep/experiments/experiment.hpp>

namespace sidestep {

/// The `replanning` experiment: recorded problems whose goal, or whose obstacles, change after they
/// are solved; solved again afresh, from the trajectory before, and incrementally.
[[nodiscard]] ExperimentType replanning_experiment();

}  // namespace sidestep
