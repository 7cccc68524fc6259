#include <sidestep/experiments/experiments.hpp>

#include <algorithm>
#include <array>
#include <optional>
#include <thread>
#include <utility>

#include <sidestep/core/file.hpp>
#include <sidestep/core/plugin_calls.hpp>
#include <sidestep/report/result_columns.hpp>
#include <sidestep/runtime/blocks.hpp>
#include <sidestep/runtime/planning_settings.hpp>
#include <sidestep/runtime/replanner.hpp>
#include <sidestep/runtime/unused_keys.hpp>
#include <sidestep/runtime/yaml_document.hpp>

#include "find_experiment.hpp"

namespace sidestep {
namespace {

/// Where the results go, for whoever has to say how the process ended.
struct OnBoard {
  explicit OnBoard(const std::filesystem::path& results) {
    plugin_board().run.set(results.native());
  }
  ~OnBoard() {
    plugin_board().run.set("");
    plugin_board().frames = 0;
  }
  OnBoard(const OnBoard&) = delete;
  OnBoard& operator=(const OnBoard&) = delete;
};

/// Names that experiments had before.
constexpr std::array kFormerNames = {std::pair("replanning", "incremental_benchmark")};

namespace fs = std::filesystem;

constexpr std::array kPluginKinds = {
    PluginKind::kSource,    PluginKind::kMapper,    PluginKind::kField,
    PluginKind::kRobot,     PluginKind::kOptimiser, PluginKind::kExecutor,
    PluginKind::kPredictor, PluginKind::kGaze,      PluginKind::kLocaliser};

/// The schema of a top-level block that is neither a plugin's nor the experiment's; nothing for
/// other names. Where an experiment is given, it is without what that has no use for.
std::optional<UsedSchema> settings_schema(std::string_view block,
                                          const FoundExperiment* of = nullptr) {
  const std::string name = of != nullptr ? of->name() : "";
  if (block == "planning") {
    return used_schema(
        name, PlanningSettings::parameters().schema(),
        of != nullptr ? of->experiment->facts().unused_of_planning : std::vector<std::string>{});
  }
  if (block == "check") return used_schema(name, CheckSettings::parameters().schema(), {});
  if (block == "replanner") return used_schema(name, ReplannerSettings::parameters().schema(), {});
  return std::nullopt;
}

/// Which experiments have no use for some keys of `planning`, to follow what it is.
std::string unused_sentence(const std::vector<FoundExperiment>& experiments) {
  std::string text;
  for (const FoundExperiment& found : experiments) {
    const std::vector<std::string> unused = found.experiment->facts().unused_of_planning;
    if (unused.empty()) continue;
    text += (text.empty() ? ". Without effect, and refused: in `" : "; in `") + found.name() + "`";
    const char* separator = " ";
    for (const std::string& key : unused) {
      text += separator + ("`" + key + "`");
      separator = ", ";
    }
  }
  return text;
}

/// The experiment of a configuration; nothing, and why, where it has none.
std::optional<FoundExperiment> experiment_of(const Configuration& configuration, Host& host,
                                             std::vector<Error>& errors) {
  const Node* block = configuration.root.find("experiment");
  if (block == nullptr) {
    errors.push_back(configuration.root.error("there is no `experiment` block",
                                              "add e.g. experiment: {type: plan, ...}"));
    return std::nullopt;
  }
  auto found = find_experiment(*block, host);
  if (found) return *std::move(found);
  errors.push_back(std::move(found.error()));
  return std::nullopt;
}

bool uses(const ExperimentFacts& facts, std::string_view block) {
  return std::ranges::find(facts.blocks, block) != facts.blocks.end() ||
         std::ranges::find(facts.optional_blocks, block) != facts.optional_blocks.end();
}

bool is_block(std::string_view key) {
  constexpr std::array kOthers = {"planning", "check", "replanner", "sampler", "sources"};
  return std::ranges::find(kOthers, key) != kOthers.end() ||
         std::ranges::any_of(kPluginKinds,
                             [&](const PluginKind kind) { return key == to_string(kind); });
}

/// Refuses a block that the experiment never reads: what it says is checked nowhere.
void refuse_unused(const Node::Entry& entry, const std::string& experiment,
                   const ExperimentFacts& facts, std::vector<Error>& errors) {
  std::string used = "its blocks: experiment";
  for (const std::string& name : facts.blocks) used += ", " + name;
  for (const std::string& name : facts.optional_blocks) used += ", " + name;
  const Node key = plain_scalar(entry.key, entry.key_mark);
  errors.push_back(key.error(
      "block `" + entry.key + "` has no effect in an experiment of type '" + experiment + "'",
      used + "; `" + entry.key + ": null` removes a block that a base configuration sets"));
}

/// The block `sources`: further sources by name.
void check_sources(const Node& block, Host& host, std::vector<Error>& errors) {
  if (!block.is_map()) {
    errors.push_back(block.error("expected a map of names to sources, found " + block.kind(),
                                 "e.g. sources: {laser: {plugin: simulator, ...}}"));
    return;
  }
  for (const Node::Entry& entry : block.entries()) {
    if (!entry.value.is_null()) host.check(PluginKind::kSource, entry.value, errors);
  }
}

/// `of` may be null.
void check_blocks(const Configuration& configuration, const FoundExperiment* of, Host& host,
                  std::vector<Error>& errors) {
  const ExperimentFacts facts = of != nullptr ? of->experiment->facts() : ExperimentFacts{};
  for (const std::string& needed : facts.blocks) {
    if (configuration.root.find(needed) != nullptr) continue;
    errors.push_back(configuration.root.error("experiment '" + of->name() + "' needs the block `" +
                                              needed + "`, and there is none"));
  }
  if (of != nullptr) {
    host.check(PluginKind::kExperiment, *configuration.root.find("experiment"), errors);
  }
  for (const Node::Entry& entry : configuration.root.entries()) {
    if (of != nullptr && is_block(entry.key) && !uses(facts, entry.key)) {
      if (!entry.value.is_null()) refuse_unused(entry, of->name(), facts, errors);
      continue;
    }
    if (const auto used = settings_schema(entry.key, of)) {
      check_against_used(entry.value, *used, errors);
    }
    for (const PluginKind kind : kPluginKinds) {
      if (entry.key != to_string(kind)) continue;
      const bool is_optional = kind == PluginKind::kPredictor || kind == PluginKind::kGaze ||
                               kind == PluginKind::kLocaliser;
      const bool is_taken_back = is_optional && entry.value.is_null();
      if (!is_taken_back) host.check(kind, entry.value, errors);
    }
    if (entry.key == "sampler" && !entry.value.is_null()) {
      host.check(PluginKind::kOptimiser, entry.value, errors);
    }
    if (entry.key == "sources" && !entry.value.is_null()) {
      check_sources(entry.value, host, errors);
    }
  }
}

/// Whether the mapper offers what the field needs of it.
void check_field_fits_mapper(const Configuration& configuration, Host& host,
                             std::vector<Error>& errors) {
  const Node* mapper = configuration.root.find("mapper");
  const Node* field = configuration.root.find("field");
  if (mapper == nullptr || field == nullptr) return;
  if (const auto info = host.find(PluginKind::kField, *field)) {
    host.check_views(*mapper, info->views, "the field '" + info->name + "'", errors);
  }
}

/// Removes the defaults of what the experiment sets itself.
void leave_out(const std::vector<std::string>& parameters, Node& block) {
  if (!block.is_map()) return;
  std::erase_if(block.entries(), [&](const Node::Entry& entry) {
    return entry.value.mark().file == "default" &&
           std::ranges::find(parameters, entry.key) != parameters.end();
  });
}

/// Whether a file of this name is one that some experiment leaves in the folder of its run.
bool is_of_run(const std::string& name, const std::vector<FoundExperiment>& experiments) {
  constexpr std::array kAlways = {"effective_config.yaml", "summary.json", "report.html",
                                  "table.csv"};
  return std::ranges::find(kAlways, name) != kAlways.end() || name.starts_with("results.sqlite") ||
         std::ranges::any_of(experiments, [&](const FoundExperiment& found) {
           return found.experiment->report().writes(name);
         });
}

/// Removes what an earlier run left, so that nothing of it can be taken for this run's.
Result<void> clear_results(const fs::path& folder, Host& host) {
  const auto experiments = SIDESTEP_TRY(find_experiments(host));
  std::error_code error;
  std::vector<fs::path> stale;
  for (const auto& entry : fs::directory_iterator(folder, error)) {
    if (is_of_run(entry.path().filename().string(), experiments)) stale.push_back(entry.path());
  }
  for (const fs::path& file : stale) {
    if (!error) fs::remove(file, error);
  }
  if (error)
    return fail(ErrorCode::kIo, "cannot use the folder: " + error.message(), folder.string());
  return {};
}

Result<void> check_division(const ExperimentContext& context, const FoundExperiment& asked) {
  const std::string where = context.configuration.file.string();
  const Shard& shard = context.shard;
  if (shard.count < 1 || shard.index < 0 || shard.index >= shard.count) {
    return fail(ErrorCode::kConfig, "there is no such shard", where, "i/n, with i from 1 to n");
  }
  const bool asks_to_divide = !shard.is_whole();
  if (!asks_to_divide && !context.resume) return {};
  const auto can = [&](const FoundExperiment& found) {
    const ExperimentFacts facts = found.experiment->facts();
    return facts.is_divisible || (!asks_to_divide && facts.is_resumable);
  };
  if (can(asked)) return {};
  const auto merged = asked.experiment->merge({}, context.out);  // says why there are no shards
  const std::string why = merged ? "" : ": " + merged.error().message;
  const auto experiments = SIDESTEP_TRY(find_experiments(context.host));
  std::string able;
  for (const FoundExperiment& found : experiments) {
    if (can(found)) able += (able.empty() ? "" : ", ") + found.name();
  }
  return fail(ErrorCode::kConfig,
              "an experiment of type '" + asked.name() + "' cannot be " +
                  (asks_to_divide ? "divided into shards" : "resumed") + why,
              where, "these can: " + able);
}

}  // namespace

Result<FoundExperiment> find_experiment(const Node& block, Host& host) {
  auto plugin = host.find(PluginKind::kExperiment, block);
  if (!plugin) {
    Error error = std::move(plugin.error());
    error.code = ErrorCode::kConfig;
    const Node* type = block.find("type");
    for (const auto& [before, now] : kFormerNames) {
      if (type == nullptr || !type->is_scalar() || type->text() != before) continue;
      error = type->error("there is no experiment type '" + type->text() + "' any more",
                          "it is called '" + std::string(now) + "' now");
    }
    return tl::make_unexpected(std::move(error));
  }
  auto experiment = SIDESTEP_TRY(host.create<Experiment>(block));
  return FoundExperiment{*std::move(plugin), std::move(experiment)};
}

Result<FoundExperiment> find_experiment(const std::string& name, const std::string& where,
                                        Host& host) {
  const SourceMark mark{where, 0, 0};
  return find_experiment(with_entry(Node(Node::Map{}, mark), "type", plain_scalar(name, mark)),
                         host);
}

Result<std::vector<FoundExperiment>> find_experiments(Host& host) {
  std::vector<FoundExperiment> all;
  for (const PluginInfo& plugin : host.plugins()) {
    if (plugin.kind != PluginKind::kExperiment) continue;
    all.push_back(SIDESTEP_TRY(find_experiment(plugin.name, plugin.library.string(), host)));
  }
  return all;
}

std::vector<SettingsBlock> settings_blocks(Host& host) {
  std::vector<SettingsBlock> blocks;
  std::vector<FoundExperiment> experiments;
  if (auto found = find_experiments(host)) experiments = *std::move(found);
  for (const FoundExperiment& found : experiments) {
    blocks.push_back({"experiment", found.plugin.doc, found.plugin.schema, found.name()});
  }
  const auto add = [&](const char* key, const std::string& doc) {
    blocks.push_back({key, doc, settings_schema(key)->schema, ""});
  };
  add("planning", "How problems are posed, whoever solves them" + unused_sentence(experiments));
  add("check", "What a plan must pass; of a closed loop the allowed contacts alone");
  add("replanner", "How the closed loop behaves");
  return blocks;
}

RunSettings read_run_settings(const Configuration& configuration) {
  RunSettings settings;
  if (const Node* experiment = configuration.root.find("experiment")) {
    const Node* seed = experiment->find("seed");
    const Node* threads = experiment->find("threads");
    if (seed != nullptr) settings.seed = static_cast<std::uint64_t>(seed->as_int().value_or(0));
    if (threads != nullptr) {
      settings.threads =
          static_cast<int>(std::clamp<std::int64_t>(threads->as_int().value_or(0), 0, 1024));
    }
  }
  if (settings.threads == 0) {
    settings.threads = std::max(1, static_cast<int>(std::thread::hardware_concurrency()));
  }
  if (const Node* paths = configuration.root.find("plugin_paths")) {
    for (const Node& path : paths->items()) {
      if (auto read = path.as_path()) settings.plugin_paths.push_back(std::move(*read));
    }
  }
  return settings;
}

std::vector<Error> check_configuration(const Configuration& configuration, Host& host) {
  std::vector<Error> errors;
  const auto found = experiment_of(configuration, host, errors);
  check_blocks(configuration, found ? &*found : nullptr, host, errors);
  check_field_fits_mapper(configuration, host, errors);
  if (found) {
    const auto done = catch_all("experiment " + found->name(), [&]() -> Result<void> {
      found->experiment->check(configuration, host, errors);
      return {};
    });
    if (!done) errors.push_back(done.error());
  }
  return errors;
}

Node effective_configuration(const Configuration& configuration, Host& host) {
  Node root = configuration.root;
  std::vector<Error> ignored;
  const auto found = experiment_of(configuration, host, ignored);
  const FoundExperiment* of = found ? &*found : nullptr;
  const ExperimentFacts facts = found ? found->experiment->facts() : ExperimentFacts{};
  if (uses(facts, "check") && root.find("check") == nullptr) {
    const SourceMark origin{"default", 0, 0};
    root = with_entry(std::move(root), "check", Node(Node::Map{}, origin));
  }
  for (Node::Entry& entry : root.entries()) {
    if (entry.key == "experiment" && found) {
      entry.value = host.with_defaults(entry.value, found->plugin.schema);
    } else if (const auto used = settings_schema(entry.key, of)) {
      entry.value = host.with_defaults(used_part(std::move(entry.value), *used), used->schema);
    }
    for (const PluginKind kind : kPluginKinds) {
      if (entry.key == to_string(kind)) entry.value = host.with_defaults(kind, entry.value);
    }
    if (entry.key == "sampler") {
      entry.value = host.with_defaults(PluginKind::kOptimiser, entry.value);
    }
    if (entry.key == "sources" && entry.value.is_map()) {
      for (Node::Entry& source : entry.value.entries()) {
        source.value = host.with_defaults(PluginKind::kSource, source.value);
      }
    }
    if (entry.key == "optimiser") leave_out(facts.set_of_optimiser, entry.value);
  }
  return root;
}

Result<ExperimentOutcome> run_experiment(ExperimentContext& context) {
  std::vector<Error> errors;
  const auto found = experiment_of(context.configuration, context.host, errors);
  if (!found) return tl::make_unexpected(std::move(errors.front()));
  SIDESTEP_TRY(check_division(context, *found));
  context.effective = effective_configuration(context.configuration, context.host);
  const auto write_configuration = [&] {
    return write_file(context.out / "effective_config.yaml", to_yaml(context.effective, true));
  };
  // A run that goes on may yet find that it does not fit: until then the folder stays as it is.
  Result<void> done;
  if (!context.resume) done = clear_results(context.out, context.host);
  if (done && !context.resume) done = write_configuration();
  if (!done) return error_of(done);
  const OnBoard on_board(context.out / "results.sqlite");
  auto outcome = SIDESTEP_TRY(catch_all("experiment " + found->name(), [&] {
    const PluginCall noted("experiment " + found->name());
    return found->experiment->run(context);
  }));
  if (context.resume) done = write_configuration();
  if (!done) return error_of(done);
  if (context.progress) context.progress(0, 0, "drawing the report");
  SIDESTEP_TRY(save_outcome(outcome, context.out, context.host));
  return outcome;
}

}  // namespace sidestep
