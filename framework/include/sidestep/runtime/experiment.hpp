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
#include <sidestep/core/export.hpp>
#include <sidestep/plugin/plugin.hpp>
#include <sidestep/runtime/configuration.hpp>
#include <sidestep/runtime/host.hpp>

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
  Shard shard;          ///< The whole, unless the experiment is divisible.
  bool resume = false;  ///< Go on with what `out` holds; for experiments that can.
  /// May be null. Experiments that show nothing while they run never call it.
  RunObserver* observer = nullptr;
  Node effective;  ///< The configuration with every default filled in; set by run_experiment().
};

/// How it ended.
struct ExperimentOutcome {
  bool success = false;  ///< The task succeeded (exit code 0 or 1).
  bool interrupted = false;
  std::optional<Error> fault;  ///< That ended it early (exit codes 3 and 4); the rest is saved.
  std::string verdict;         ///< In plain words, one or two sentences.
  std::string summary_json;    ///< What summary.json holds (results/summary.hpp).
  std::string table;           ///< For the terminal.
  std::string table_csv;       ///< What table.csv holds; empty where the experiment has none.
};

/// What an experiment reads of a configuration, and what can be done with its runs.
struct ExperimentFacts {
  std::vector<std::string> blocks;  ///< Top-level blocks that it needs, e.g. "robot", "mapper".
  /// Top-level blocks that it reads where they are given. Any block that is neither here nor in
  /// `blocks` is refused.
  std::vector<std::string> optional_blocks = {};
  /// Keys of the `planning` block that have no effect: refused where they are given, and no part
  /// of the effective configuration.
  std::vector<std::string> unused_of_planning = {};
  /// Parameters of the optimiser that it sets itself: no part of the effective configuration.
  std::vector<std::string> set_of_optimiser = {};
  bool is_resumable = false;  ///< It can go on where an earlier run ended.
  bool is_divisible = false;  ///< It has shards, merge() and, so, resumable runs.
};

/// What the `experiment` block of every experiment says; an experiment's settings derive from it.
struct ExperimentSettings {
  std::string type;
  std::int64_t seed = 0;
  int threads = 0;
};
/// Declares that; an experiment adds its own parameters.
template <class Settings>
[[nodiscard]] Parameters<Settings> experiment_parameters(
    const char* seed_doc = "Seed of everything random in the run.",
    const char* threads_doc = "Threads to work with; 0 for one per core.") {
  return Parameters<Settings>()
      .add("type", &Settings::type, "Type of the experiment.", {.required = true})
      .add("seed", &Settings::seed, seed_doc, {.min = 0})
      .add("threads", &Settings::threads, threads_doc, {.min = 0, .max = 1024});
}

/// A protocol that a configuration parameterises: the interface of plugins of kind `experiment`.
/// The `experiment` block names the plugin by its `type`; the rest of the block are its parameters.
/// An object has no state of its own. [main]
class SIDESTEP_EXPORT Experiment {
 public:
  virtual ~Experiment() = default;

  [[nodiscard]] virtual ExperimentFacts facts() const = 0;
  /// How its runs are shown; lives as long as the library.
  [[nodiscard]] virtual const report::RunReport& report() const = 0;
  /// Appends the mistakes that no schema knows of. Blocks that do not fit their schemas have been
  /// reported, and are passed over here.
  virtual void check(const Configuration& configuration, Host& host,
                     std::vector<Error>& errors) const = 0;
  /// Measures, and saves to context.out/results.sqlite (results/recorder.hpp). The configuration
  /// has passed check(). Fails where the experiment could not be done at all; a task that fails is
  /// an outcome.
  [[nodiscard]] virtual Result<ExperimentOutcome> run(ExperimentContext& context) const = 0;
  /// Puts the runs of shards together in `out`. Where there can be none: kUnsupported, and why not.
  [[nodiscard]] virtual Result<ExperimentOutcome> merge(
      const std::vector<std::filesystem::path>& shards, const std::filesystem::path& out) const {
    (void)shards;
    return fail(ErrorCode::kUnsupported, "runs of this experiment have no shards", out.string());
  }
};

template <>
struct PluginTraits<Experiment> {
  static constexpr PluginKind kKind = PluginKind::kExperiment;
  static constexpr std::uint32_t kVersion = kExperimentInterface;
};

namespace detail {

/// Experiments read their block with the whole configuration: the host checks it against its
/// schema, and creates them without.
template <class Settings,
          Result<std::unique_ptr<Experiment>> (*kCreate)(const Settings&, const HostContext&)>
struct PluginGlue<Experiment, Settings, kCreate> {
  static void check(const Node&, std::vector<Error>&) {}
  static void* create(const Node&, const HostContext& context, Error*) {
    return kCreate({}, context)->release();
  }
  static void destroy(void* object) { delete static_cast<Experiment*>(object); }
};

template <class Protocol>
struct ExperimentMaker {
  template <class Settings>
  static Result<std::unique_ptr<Experiment>> make(const Settings&, const HostContext&) {
    return std::make_unique<Protocol>();
  }
};

}  // namespace detail
}  // namespace sidestep

/// Exports an experiment. EXPERIMENT: a class that implements sidestep::Experiment and can be made
/// of nothing. SETTINGS: a struct that derives from ExperimentSettings and has `static
/// Parameters<SETTINGS> parameters()`, all of the `experiment` block (experiment_parameters()).
/// Link Sidestep::runtime.
#define SIDESTEP_EXPERIMENT(EXPERIMENT, SETTINGS, NAME, VERSION, DOC)                             \
  SIDESTEP_PLUGIN(::sidestep::Experiment, SETTINGS,                                               \
                  ::sidestep::detail::ExperimentMaker<EXPERIMENT>::make<SETTINGS>, NAME, VERSION, \
                  DOC)
