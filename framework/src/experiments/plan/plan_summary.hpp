#pragma once

#include <span>
#include <string>

#include <sidestep/experiments/experiment.hpp>
#include <sidestep/runtime/results_store.hpp>

#include "plan/plan_types.hpp"
#include "report/result_columns.hpp"

namespace sidestep {

/// Verdict, summary.json and table of a finished (or interrupted) plan experiment.
[[nodiscard]] ExperimentOutcome summarise_plans(const RunProvenance& provenance,
                                                const MapRecord& map,
                                                std::span<const PlanRecord> plans);

/// Of the rows `plans` of summary.json.
[[nodiscard]] const report::ResultColumns& plan_columns();

/// How such runs are shown.
[[nodiscard]] const report::RunReport& plan_report();

}  // namespace sidestep
