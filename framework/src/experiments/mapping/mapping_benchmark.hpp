#pragma once

#include <sidestep/experiments/experiment.hpp>

namespace sidestep {

/// The `mapping_benchmark` experiment: systems of mapper and field on the same frames, at several
/// resolutions, signed or not (Finean 2021, Table II).
[[nodiscard]] ExperimentType mapping_benchmark_experiment();

}  // namespace sidestep
