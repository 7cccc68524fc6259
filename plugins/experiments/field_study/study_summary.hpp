#pragma once

#include <cstdint>
#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include <sidestep/report/result_columns.hpp>
#include <sidestep/runtime/experiment.hpp>

#include "study_rows.hpp"

namespace sidestep {

struct ComparisonOptions {
  double confidence = 0.95;
  int bootstrap_samples = 2000;
  std::uint64_t seed = 0;
};

/// Both fields of one robot against each other (numerics: protocol of the paper's Table I): its row
/// of `robots` in summary.json.
[[nodiscard]] nlohmann::ordered_json compare_fields(const StudyRobotRows& robot,
                                                    const ComparisonOptions& options);

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

/// Fills in the tables of terminal and spreadsheet, made of what summary.json tells.
void show_study(const nlohmann::ordered_json& summary, ExperimentOutcome& outcome);

/// How such runs are shown.
[[nodiscard]] const report::RunReport& study_report();

}  // namespace sidestep
