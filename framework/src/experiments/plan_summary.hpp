#pragma once

#include <span>
#include <string>

#include <sidestep/experiments/experiment.hpp>
#include <sidestep/runtime/results_store.hpp>

#include "plan_types.hpp"

namespace sidestep {

/// Verdict, summary.json and table of a finished (or interrupted) plan experiment.
[[nodiscard]] ExperimentOutcome summarise_plans(const RunProvenance& provenance,
                                                const MapRecord& map,
                                                std::span<const PlanRecord> plans);

/// The value below which a share of the values lies, linear between two; 0 for no values.
[[nodiscard]] double percentile(std::vector<double> values, double share);

}  // namespace sidestep
