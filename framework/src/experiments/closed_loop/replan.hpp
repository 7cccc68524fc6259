#pragma once

#include <sidestep/experiments/experiment.hpp>

namespace sidestep {

/// The `replan` experiment: the closed loop around moving obstacles (Finean 2021, Algorithm 1).
[[nodiscard]] ExperimentType replan_experiment();

}  // namespace sidestep
