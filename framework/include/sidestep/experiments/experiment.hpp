#pragma once

#include <cstdint>
#include <filesystem>
#include <functional>
#include <memory>
#include <optional>
#include <stop_token>
#include <string>
#include <string_view>
#include <vector>

#include <sidestep/core/error.hpp>
#include <sidestep/runtime/configuration.hpp>
#include <sidestep/runtime/host.hpp>
#include <sidestep/runtime/reference.hpp>
#include <sidestep/runtime/session.hpp>

namespace sidestep {

/// One of `count` parts of a run that several machines share, `index` from 0.
struct Shard {
  int index = 0;
  int count = 1;

  [[nodiscard]] bool is_whole() const noexcept { return count == 1; }
};

class RunObserver;
namespace report {
struct RunReport;
}

/// What an experiment is given.
struct ExperimentContext {
  const Configuration& configuration;
  Host& host;
  Log& log;
  const DocumentReader& documents;
  std::filesystem::path out;  ///< Existing folder for its files.
  std::uint64_t seed = 0;
  int threads = 1;       ///< Of the host's worker pool; for the record.
  std::stop_token stop;  ///< Requested on Ctrl-C: save and return.
  /// Progress for people: done and total work items (0 where unknown), and a word on what is
  /// being done. May be empty.
  std::function<void(std::int64_t done, std::int64_t total, std::string_view what)> progress;
  Shard shard;          ///< The whole, unless the type is divisible.
  bool resume = false;  ///< Go on with what `out` holds; for types that can.
  /// Who looks on; null: nobody. Types that show nothing while they run never call it.
  RunObserver* observer = nullptr;
};

/// How it ended.
struct ExperimentOutcome {
  bool success = false;  ///< The task succeeded (exit code 0 or 1).
  bool interrupted = false;
  std::optional<Error> fault;  ///< That ended it early (exit codes 3 and 4); the rest is saved.
  std::string verdict;         ///< In plain words, one or two sentences.
  std::string summary_json;    ///< What summary.json holds.
  std::string table;           ///< For the terminal.
  std::string table_csv;       ///< What table.csv holds; empty where the type has none.
};

/// One type of experiment: a protocol that a configuration parameterises.
struct ExperimentType {
  std::string name;  ///< As in `experiment: {type: plan}`.
  std::string doc;
  Schema (*schema)();               ///< Of the `experiment` block.
  std::vector<std::string> blocks;  ///< Top-level blocks it needs, e.g. "robot", "mapper".
  /// Appends mistakes that no schema can know of. Blocks that do not fit their schemas have been
  /// reported, and are passed over here.
  void (*check)(const Configuration& configuration, Host& host, std::vector<Error>& errors);
  /// Measures, and saves to context.out/results.sqlite.
  Result<ExperimentOutcome> (*run)(ExperimentContext& context);
  const report::RunReport* report = nullptr;  ///< How its runs are shown.
  /// Fills in, for the effective configuration, what the schema of the `experiment` block cannot
  /// know, e.g. the defaults of plugins that it names; may be null.
  void (*fill)(Node& experiment, Host& host) = nullptr;
  /// Parameters of the optimiser that the experiment sets itself: no part of the effective
  /// configuration.
  std::vector<std::string> set_of_optimiser = {};
  /// Keys of the `planning` block that it has no use for: refused where they are given, and no part
  /// of the effective configuration.
  std::vector<std::string> unused_of_planning = {};
  /// Top-level blocks it reads where they are given. Any block that is neither here nor in `blocks`
  /// is refused.
  std::vector<std::string> optional_blocks = {};
  /// Puts shards of one run together in the folder `out`; null where it cannot be divided. What can
  /// be divided can go on where an earlier run ended, too.
  Result<ExperimentOutcome> (*merge)(const std::vector<std::filesystem::path>& shards,
                                     const std::filesystem::path& out) = nullptr;
  bool is_resumable = false;  ///< Whether it can go on where an earlier run ended.

  [[nodiscard]] bool is_divisible() const noexcept { return merge != nullptr; }

  /// Whether it reads the top-level block.
  [[nodiscard]] bool uses(std::string_view block) const noexcept;
};

[[nodiscard]] const std::vector<ExperimentType>& experiment_types();

/// The blocks that are not plugins', for reference pages.
[[nodiscard]] std::vector<SettingsBlock> settings_blocks();

/// What every experiment's block says of the run itself, read before there is a host; mistakes
/// are left to check_configuration().
[[nodiscard]] RunSettings read_run_settings(const Configuration& configuration);

/// All mistakes in a configuration that can be known without running it: experiment type and
/// its parameters, plugin blocks, planning settings, poses of plans.
[[nodiscard]] std::vector<Error> check_configuration(const Configuration& configuration,
                                                     Host& host);

/// The configuration with every default filled in and every value's origin: what
/// effective_config.yaml holds.
[[nodiscard]] Node effective_configuration(const Configuration& configuration, Host& host);

/// Runs a checked configuration and leaves in context.out: effective_config.yaml,
/// results.sqlite, summary.json, table.csv, report.html and its pictures. Files of an earlier run
/// are removed first, but for its results where context.resume goes on with them. Fails with
/// kConfig where a shard or going on is asked of a type that cannot, and where the
/// experiment could not be done at all (exit codes 2 to 4); a task that fails is an outcome.
[[nodiscard]] Result<ExperimentOutcome> run_experiment(ExperimentContext& context);

}  // namespace sidestep
