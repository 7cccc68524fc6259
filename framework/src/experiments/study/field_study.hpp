#pragma once

#include <sidestep/experiments/experiment.hpp>

namespace sidestep {

/// The `field_study` experiment: what signed fields bring to trajectory optimisation, on motions
/// of several robots past random boxes (Finean 2021, Table I).
[[nodiscard]] ExperimentType field_study_experiment();

}  // namespace sidestep
