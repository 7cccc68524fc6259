#pragma once

#include <sidestep/experiments/experiment.hpp>

namespace sidestep {

/// The `plan` experiment: a map from a source, and one or more plans through it.
[[nodiscard]] ExperimentType plan_experiment();

}  // namespace sidestep
