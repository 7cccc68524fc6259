#pragma once

#include <filesystem>

#include <sidestep/experiments/experiment.hpp>

namespace sidestep {

/// Writes summary.json and, where there is a table for a spreadsheet, table.csv into the folder of
/// a run, then the report of it, which shows the results and the configuration that lie there.
[[nodiscard]] Result<void> save_outcome(const ExperimentOutcome& outcome,
                                        const std::filesystem::path& run);

}  // namespace sidestep
