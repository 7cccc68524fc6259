#pragma once

#include <sidestep/runtime/experiment.hpp>
#include <sidestep/runtime/results_store.hpp>

namespace sidestep {

/// The provenance of this build on this machine, and of a run.
[[nodiscard]] inline RunProvenance provenance_of(const ExperimentContext& context) {
  RunProvenance provenance = current_provenance();
  provenance.configuration = context.configuration.name;
  provenance.seed = context.seed;
  provenance.threads = context.threads;
  return provenance;
}

}  // namespace sidestep
