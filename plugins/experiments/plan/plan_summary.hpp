#pragma once

#include <span>
#include <string>

#include <sidestep/report/result_columns.hpp>
#include <sidestep/runtime/experiment.hpp>
#include <sidestep/runtime/results_store.hpp>
#include "plan_types.hpp"

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
