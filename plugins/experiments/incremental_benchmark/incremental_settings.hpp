#pragma once

#include "recorded_settings.hpp"

namespace sidestep {

/// The `experiment` block of an incremental benchmark.
struct IncrementalSettings : ProblemChoice, ExperimentSettings {
  double goal_sd = 0.1;
  double obstacle_sd_m = 0.05;

  IncrementalSettings() { runs = {"replan"}; }
  static Parameters<IncrementalSettings> parameters();
};

/// What the experiment sets of the optimiser: the stopping rules of each recorded run, and
/// `incremental`.
[[nodiscard]] std::vector<std::string> set_of_incremental_optimiser();

/// The optimiser's block with a recorded run's stopping rules, incremental or not.
[[nodiscard]] Node incremental_block(const Node& optimiser, const RecordedRun& run,
                                     bool is_incremental);

}  // namespace sidestep
