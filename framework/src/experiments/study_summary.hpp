#pragma once

#include <filesystem>
#include <optional>
#include <string>

#include <sidestep/experiments/experiment.hpp>

#include "study_rows.hpp"

namespace sidestep {

/// Table, verdict and summary.json of what a store holds.
[[nodiscard]] ExperimentOutcome summarise_study(const StudyRecord& study, bool interrupted,
                                                const std::optional<Error>& fault);

/// table.csv: one line for each robot and field.
[[nodiscard]] std::string study_csv(const std::string& summary_json);

/// Sums up the store in `run` and writes table.csv beside it.
[[nodiscard]] Result<ExperimentOutcome> conclude_study(const std::filesystem::path& run,
                                                       bool interrupted,
                                                       const std::optional<Error>& fault);

}  // namespace sidestep
