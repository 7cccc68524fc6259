#pragma once

#include "recorded_settings.hpp"

namespace sidestep {

/// The `experiment` block of a replanning experiment.
struct ReplanningSettings : ProblemChoice {
  std::string type;
  std::int64_t seed = 0;
  int threads = 0;
  double goal_sd = 0.1;
  double obstacle_sd_m = 0.05;

  ReplanningSettings() { runs = {"replan"}; }
  static Parameters<ReplanningSettings> parameters();
};

/// What the experiment sets of the optimiser: the stopping rules of each recorded run, and
/// `incremental`.
[[nodiscard]] std::vector<std::string> set_of_replanning_optimiser();

/// The optimiser's block with a recorded run's stopping rules, incremental or not.
[[nodiscard]] Node replanning_block(const Node& optimiser, const RecordedRun& run,
                                    bool is_incremental);

}  // namespace sidestep
