#pragma once

#include <array>
#include <cstdint>
#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include <sidestep/report/result_columns.hpp>
#include <sidestep/results/statistics.hpp>
#include <sidestep/runtime/experiment.hpp>

#include "study_rows.hpp"

namespace sidestep {

/// A mean with the interval that drawing other scenes would leave it in.
struct MeanWithInterval {
  Statistics statistics;
  std::int64_t count = 0;
  Interval interval;
};

/// What one field comes to over all problems of a robot.
struct FieldComparison {
  std::int64_t attempted = 0;
  std::int64_t collision_free = 0;
  std::int64_t failures = 0;  ///< Of the solvable problems: not collision-free in this field.
  double failure_share = 0.0;
  Interval failure_interval;             ///< Wilson's.
  std::array<std::int64_t, 5> ended{};   ///< By SolveStatus.
  MeanWithInterval iterations;           ///< Of every solve.
  MeanWithInterval iterations_solvable;  ///< Of the solvable problems.
  MeanWithInterval steps;                ///< Of every solve, rejected ones included.
  MeanWithInterval valid_cost;           ///< Of problems that both fields solve collision-free.
  Statistics solve_ms;
  Statistics check_ms;
  double solve_s = 0.0;  ///< Sum.
  double check_s = 0.0;
};

/// Both fields of one robot against each other (numerics: protocol of the paper's Table I).
struct RobotComparison {
  std::int64_t problems = 0;
  std::int64_t skipped = 0;
  std::int64_t in_collision = 0;  ///< Start or goal collides: no field can solve it.
  std::int64_t both = 0;
  std::int64_t only_unsigned = 0;
  std::int64_t only_signed = 0;
  std::int64_t neither = 0;
  std::array<FieldComparison, 2> fields;
  /// Signed minus unsigned, with bootstrapped intervals over scenes.
  double failure_difference = 0.0;
  Interval failure_difference_interval;
  MeanWithInterval iterations_difference;  ///< Of every problem attempted.
  MeanWithInterval cost_difference;        ///< Of problems that both solve.

  /// Problems that at least one field solves collision-free.
  [[nodiscard]] std::int64_t solvable() const { return both + only_unsigned + only_signed; }
};

struct ComparisonOptions {
  double confidence = 0.95;
  int bootstrap_samples = 2000;
  std::uint64_t seed = 0;
};

[[nodiscard]] RobotComparison compare_fields(const StudyRobotRows& robot,
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
