#pragma once

#include <sidestep/experiments/experiment.hpp>

namespace sidestep {

/// The type `deploy`: the closed loop in one map, to one goal after the other as they come to the
/// executor while it runs.
[[nodiscard]] ExperimentType deploy_experiment();

}  // namespace sidestep
