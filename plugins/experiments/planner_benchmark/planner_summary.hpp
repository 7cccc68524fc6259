#pragma once

#include <filesystem>
#include <optional>

#include <sidestep/report/result_columns.hpp>
#include <sidestep/runtime/experiment.hpp>
#include "planner_rows.hpp"

namespace sidestep {

/// Verdict, summary.json and tables of what a store holds.
[[nodiscard]] ExperimentOutcome summarise_planners(const PlannerBenchmarkRecord& record,
                                                   bool interrupted,
                                                   const std::optional<Error>& fault);

/// The same of the store in `run`, and OMPL's benchmark database beside it.
[[nodiscard]] Result<ExperimentOutcome> conclude_planners(const std::filesystem::path& run,
                                                          bool interrupted,
                                                          const std::optional<Error>& fault);

/// Puts shards of one run together in the folder `out`.
[[nodiscard]] Result<ExperimentOutcome> merge_planners(
    const std::vector<std::filesystem::path>& runs, const std::filesystem::path& out);

/// Of the rows `planners` and `families` of summary.json.
[[nodiscard]] const report::ResultColumns& planner_columns();

/// How such runs are shown.
[[nodiscard]] const report::RunReport& planner_report();

}  // namespace sidestep
