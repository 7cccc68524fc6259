#pragma once

#include <sidestep/experiments/experiment.hpp>

namespace sidestep {

/// The `recorded_benchmark` experiment: an optimiser on problems that a peer has solved, under the
/// peer's stopping rules, held against what the peer made of them.
[[nodiscard]] ExperimentType recorded_benchmark_experiment();

}  // namespace sidestep
