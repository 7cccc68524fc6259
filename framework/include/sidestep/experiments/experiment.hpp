#pragma once

#include <filesystem>
#include <memory>
#include <stop_token>
#include <string>
#include <vector>

#include <sidestep/core/error.hpp>
#include <sidestep/runtime/configuration.hpp>
#include <sidestep/runtime/host.hpp>

namespace sidestep {

/// What an experiment is given.
struct ExperimentContext {
  const Configuration& configuration;
  Host& host;
  Log& log;
  const DocumentReader& documents;
  std::filesystem::path out;  ///< Existing folder for its files.
  std::uint64_t seed = 0;
  std::stop_token stop;  ///< Requested on Ctrl-C: save and return.
  /// Progress for people: done and total work items, and a word on what is being done.
  std::function<void(std::int64_t done, std::int64_t total, std::string_view what)> progress;
};

/// How it ended.
struct ExperimentOutcome {
  bool success = false;  ///< The task succeeded (exit code 0 or 1).
  bool interrupted = false;
  std::string verdict;       ///< In plain words, one or two sentences.
  std::string summary_json;  ///< What summary.json holds.
  std::string table;         ///< For the terminal.
};

/// One type of experiment: a protocol that a configuration parameterises.
struct ExperimentType {
  std::string name;  ///< As in `experiment: {type: plan}`.
  std::string doc;
  Schema (*schema)();               ///< Of the `experiment` block.
  std::vector<std::string> blocks;  ///< Top-level blocks it needs, e.g. "robot", "mapper".
  Result<ExperimentOutcome> (*run)(ExperimentContext& context);
};

[[nodiscard]] const std::vector<ExperimentType>& experiment_types();

/// All mistakes in a configuration that can be known without running it: experiment type and
/// its parameters, plugin blocks, planning settings, poses of plans.
[[nodiscard]] std::vector<Error> check_configuration(const Configuration& configuration,
                                                     Host& host);

}  // namespace sidestep
