#pragma once

#include <algorithm>
#include <string>
#include <vector>

#include <sidestep/report/result_columns.hpp>
#include <sidestep/runtime/experiment.hpp>
#include <sidestep/runtime/results_store.hpp>
#include "recorded_solves.hpp"

namespace sidestep {

/// The `experiment` block of a benchmark on recorded problems.
struct RecordedBenchmarkSettings : ProblemChoice, ExperimentSettings {
  RecordedBenchmarkSettings() { runs = {"study", "replan"}; }
  static Parameters<RecordedBenchmarkSettings> parameters();
};

/// One problem, solved.
struct SolveRecord : RecordedSolve {
  RecordedOutcome peer;
  double clearance_at_checks_m = 0.0;  ///< Where solved.
  bool ends_free = false;              ///< Start and goal touch nothing.

  /// Per accepted step, which is what GPMP2 counts as an iteration.
  [[nodiscard]] double iteration_us() const noexcept {
    return 1e3 * solve_ms / std::max(1, accepted_iterations);
  }
  [[nodiscard]] bool free_at_checks() const noexcept {
    return solved && clearance_at_checks_m > 0.0;
  }
};

/// All problems of one recorded run, solved.
struct RecordedRunRecord {
  std::string label;
  bool is_signed = false;
  double relative_tolerance = 0.0;
  int max_iterations = 0;
  std::vector<SolveRecord> solves;
};

/// Result of a benchmark on recorded problems.
struct RecordedBenchmarkRecord {
  RecordedFacts about;
  bool costs_comparable = true;
  std::vector<RecordedRunRecord> runs;
};

/// Verdict, summary.json and tables of a finished (or interrupted) planner benchmark.
[[nodiscard]] ExperimentOutcome summarise_recorded(const RunProvenance& provenance,
                                                   const RecordedBenchmarkSettings& settings,
                                                   const RecordedBenchmarkRecord& record);

/// How such runs are shown.
[[nodiscard]] const report::RunReport& recorded_report();

}  // namespace sidestep
