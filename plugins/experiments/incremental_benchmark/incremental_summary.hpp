#pragma once

#include <array>
#include <string>
#include <vector>

#include <sidestep/report/result_columns.hpp>
#include <sidestep/runtime/experiment.hpp>
#include <sidestep/runtime/results_store.hpp>

#include "recorded_solves.hpp"

namespace sidestep {

/// The `experiment` block of an incremental benchmark.
struct IncrementalSettings : ProblemChoice, ExperimentSettings {
  double goal_sd = 0.1;
  double obstacle_sd_m = 0.05;

  IncrementalSettings() { runs = {"replan"}; }
  static Parameters<IncrementalSettings> parameters();
};

/// How a changed problem is solved: from a straight line; from the trajectory before, whole; by the
/// optimiser that has found the trajectory before.
enum SolveWay : std::size_t { kAfresh, kWarm, kIncremental };
inline constexpr std::array kSolveWays = {"afresh", "warm", "incremental"};

/// A changed problem in all ways.
struct ChangedSolve {
  int scene = 0;
  int pair = 0;
  bool ends_free = false;  ///< Start and goal touch nothing.
  std::array<RecordedSolve, kSolveWays.size()> ways;

  [[nodiscard]] bool solved() const noexcept;
};

/// All problems of a recorded run with one change.
struct ChangedSeries {
  std::string label;
  bool is_signed = false;
  std::string change;  ///< "goal" or "obstacles".
  std::vector<ChangedSolve> problems;
};

/// Result of an incremental benchmark.
struct IncrementalRecord {
  RecordedFacts about;
  std::vector<ChangedSeries> series;
};

/// Verdict, summary.json and tables of a finished (or interrupted) incremental benchmark.
[[nodiscard]] ExperimentOutcome summarise_incremental(const RunProvenance& provenance,
                                                      const IncrementalSettings& settings,
                                                      const IncrementalRecord& record);

/// How such runs are shown.
[[nodiscard]] const report::RunReport& incremental_report();

}  // namespace sidestep
