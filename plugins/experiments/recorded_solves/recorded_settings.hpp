#pragma once

#include <cstdint>
#include <filesystem>
#include <string>
#include <vector>

#include <sidestep/plugin/parameters.hpp>
#include <sidestep/problems/recorded_problems.hpp>
#include <sidestep/runtime/experiment.hpp>

namespace sidestep {

/// Of an `experiment` block: which recorded problems are solved, and how often.
struct ProblemChoice {
  std::filesystem::path problems;
  std::vector<std::string> runs;
  int repeats = 1;
  int every = 1;
  std::int64_t limit = 0;
};

/// Settings that derive from ProblemChoice declare it so.
template <class Settings>
Parameters<Settings> declare_choice(Parameters<Settings> parameters) {
  return std::move(parameters)
      .add("problems", &Settings::problems, "File of recorded problems (JSON); needed to run.")
      .add("runs", &Settings::runs, "Labels of the recorded runs whose stopping rules are used.")
      .add("repeats", &Settings::repeats,
           "How often all problems of a run are solved; the least time of each counts.",
           {.min = 1, .max = 1000})
      .add("every", &Settings::every, "Every n-th problem of a run is used.", {.min = 1})
      .add("limit", &Settings::limit, "Most problems of a run; 0 for no limit.", {.min = 0});
}

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
                                                    const ProblemChoice& choice,
                                                    std::vector<Error>& errors);
/// The same for a run: the first mistake, and one where no file is named.
[[nodiscard]] Result<RecordedProblems> read_problems(const Node& experiment,
                                                     const ProblemChoice& choice);

/// Appends every mistake in the configuration of an experiment on recorded problems that sets
/// parameters (`names`) of the optimiser.
template <class Settings>
void check_recorded(const Configuration& configuration, const std::vector<std::string>& names,
                    Host& host, std::vector<Error>& errors) {
  const Node* experiment = configuration.root.find("experiment");
  const Node* optimiser = configuration.root.find("optimiser");
  if (optimiser != nullptr) check_optimiser(*optimiser, names, host, errors);
  std::vector<Error> unfit;
  check_against_schema(*experiment, Settings::parameters().schema(), {}, unfit);
  if (!unfit.empty()) return;  // its schema told
  Settings settings;
  Settings::parameters().read(*experiment, settings, errors);
  if (!settings.problems.empty()) (void)read_chosen_problems(*experiment, settings, errors);
}

}  // namespace sidestep
