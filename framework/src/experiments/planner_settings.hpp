#pragma once

#include <cstdint>
#include <filesystem>
#include <string>
#include <vector>

#include <sidestep/experiments/recorded_problems.hpp>
#include <sidestep/plugin/parameters.hpp>
#include <sidestep/runtime/host.hpp>

namespace sidestep {

/// The `experiment` block of a planner benchmark.
struct PlannerBenchmarkSettings {
  std::string type;
  std::int64_t seed = 0;
  int threads = 0;
  std::filesystem::path problems;
  std::vector<std::string> runs = {"study", "replan"};
  int repeats = 1;
  int every = 1;
  std::int64_t limit = 0;

  static Parameters<PlannerBenchmarkSettings> parameters();
};

/// What the experiment sets of every optimiser: the stopping rules of each recorded run.
[[nodiscard]] std::vector<std::string> set_of_optimiser();

/// The optimiser's block with a recorded run's stopping rules in it.
[[nodiscard]] Node block_for(const Node& optimiser, const RecordedRun& run);

/// Appends a mistake for each parameter that the experiment sets (`names`) and the block has, too,
/// and for each that the plugin does not have.
void check_optimiser(const Node& optimiser, const std::vector<std::string>& names, Host& host,
                     std::vector<Error>& errors);

/// The recorded problems that an `experiment` block names, and of their runs those to be solved,
/// each with the outcomes that `every` and `limit` leave. Appends every mistake at its position.
[[nodiscard]] RecordedProblems read_chosen_problems(const Node& experiment,
                                                    const PlannerBenchmarkSettings& settings,
                                                    std::vector<Error>& errors);
/// The same for a run: the first mistake, and one where no file is named.
[[nodiscard]] Result<RecordedProblems> read_problems(const Node& experiment,
                                                     const PlannerBenchmarkSettings& settings);

}  // namespace sidestep
