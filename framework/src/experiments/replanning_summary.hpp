#pragma once

#include <array>
#include <string>
#include <vector>

#include <sidestep/experiments/experiment.hpp>
#include <sidestep/runtime/results_store.hpp>

#include "recorded_solves.hpp"
#include "replanning_settings.hpp"

namespace sidestep {

/// How a changed problem is solved.
enum class ReplanWay {
  kAfresh,       ///< From a straight line.
  kWarm,         ///< From the trajectory before, whole.
  kIncremental,  ///< By the optimiser that has found the trajectory before.
};
inline constexpr std::array kReplanWays = {ReplanWay::kAfresh, ReplanWay::kWarm,
                                           ReplanWay::kIncremental};
[[nodiscard]] std::string_view to_string(ReplanWay way) noexcept;

/// A changed problem in all ways.
struct ReplanRecord {
  int scene = 0;
  int pair = 0;
  bool ends_free = false;  ///< Start and goal touch nothing.
  std::array<RecordedSolve, kReplanWays.size()> ways;

  [[nodiscard]] bool solved() const noexcept;
};

/// All problems of a recorded run with one change.
struct ReplanSeries {
  std::string label;
  bool is_signed = false;
  std::string change;  ///< "goal" or "obstacles".
  std::vector<ReplanRecord> problems;
};

/// What a replanning experiment came to.
struct ReplanningRecord {
  RecordedFacts about;
  std::vector<ReplanSeries> series;
  bool interrupted = false;
};

/// Verdict, summary.json and tables of a finished (or interrupted) replanning experiment.
[[nodiscard]] ExperimentOutcome summarise_replanning(const RunProvenance& provenance,
                                                     const ReplanningSettings& settings,
                                                     const ReplanningRecord& record);

}  // namespace sidestep
