#pragma once

#include <filesystem>
#include <optional>
#include <string>

#include <sidestep/report/result_columns.hpp>
#include <sidestep/runtime/experiment.hpp>
#include "study_rows.hpp"

namespace sidestep {

/// Verdict, summary.json and tables of what a store holds.
[[nodiscard]] ExperimentOutcome summarise_study(const StudyRecord& study, bool interrupted,
                                                const std::optional<Error>& fault);

/// The same of the store in `run`.
[[nodiscard]] Result<ExperimentOutcome> conclude_study(const std::filesystem::path& run,
                                                       bool interrupted,
                                                       const std::optional<Error>& fault);

/// Puts shards of one run together in the folder `out`.
[[nodiscard]] Result<ExperimentOutcome> merge_study(const std::vector<std::filesystem::path>& runs,
                                                    const std::filesystem::path& out);

/// Each robot with each field: rows of table.csv, made of `robots` in summary.json.
[[nodiscard]] nlohmann::ordered_json study_fields(const nlohmann::ordered_json& summary);
[[nodiscard]] const report::ResultColumns& study_columns();

/// How such runs are shown.
[[nodiscard]] const report::RunReport& study_report();

}  // namespace sidestep
