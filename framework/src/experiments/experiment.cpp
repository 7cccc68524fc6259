#include <sidestep/experiments/experiment.hpp>

#include <algorithm>
#include <array>
#include <optional>
#include <thread>
#include <utility>

#include <sidestep/experiments/report.hpp>
#include <sidestep/runtime/planning_settings.hpp>
#include <sidestep/runtime/yaml_document.hpp>

#include "closed_loop/deploy.hpp"
#include "closed_loop/replan.hpp"
#include "closed_loop/replan_settings.hpp"
#include "mapping/mapping_benchmark.hpp"
#include "plan/plan.hpp"
#include "planners/ompl_database.hpp"
#include "planners/planner_benchmark.hpp"
#include "recorded/incremental_benchmark.hpp"
#include "recorded/recorded_benchmark.hpp"
#include "results/text_file.hpp"
#include "settings/unused_keys.hpp"
#include "study/field_study.hpp"

namespace sidestep {
namespace {

namespace fs = std::filesystem;

const std::vector<ExperimentType> kTypes = {plan_experiment(),
                                            mapping_benchmark_experiment(),
                                            field_study_experiment(),
                                            planner_benchmark_experiment(),
                                            recorded_benchmark_experiment(),
                                            incremental_benchmark_experiment(),
                                            replan_experiment(),
                                            deploy_experiment()};

constexpr std::array kPluginKinds = {PluginKind::kSource,    PluginKind::kMapper,
                                     PluginKind::kField,     PluginKind::kRobot,
                                     PluginKind::kOptimiser, PluginKind::kExecutor};

/// The schema of a top-level block that is neither a plugin's nor the experiment's; nothing for
/// other names. Where a type is given, it is without what that has no use for.
std::optional<UsedSchema> settings_schema(std::string_view block,
                                          const ExperimentType* type = nullptr) {
  const std::string name = type != nullptr ? type->name : "";
  if (block == "planning") {
    return used_schema(name, PlanningSettings::parameters().schema(),
                       type != nullptr ? type->unused_of_planning : std::vector<std::string>{});
  }
  if (block == "check") return used_schema(name, CheckSettings::parameters().schema(), {});
  if (block == "replanner") return used_schema(name, ReplannerBlock::parameters().schema(), {});
  return std::nullopt;
}

/// Which types have no use for some keys of `planning`, to follow what it is.
std::string unused_sentence() {
  std::string text;
  for (const ExperimentType& type : kTypes) {
    if (type.unused_of_planning.empty()) continue;
    text += (text.empty() ? ". Without effect, and refused: in `" : "; in `") + type.name + "`";
    const char* separator = " ";
    for (const std::string& key : type.unused_of_planning) {
      text += separator + ("`" + key + "`");
      separator = ", ";
    }
  }
  return text;
}

/// Where a type was called otherwise before.
constexpr std::array kFormerNames = {std::pair("replanning", "incremental_benchmark")};

const ExperimentType* find_type(const Configuration& configuration, std::vector<Error>& errors) {
  const Node* block = configuration.root.find("experiment");
  if (block == nullptr) {
    errors.push_back(configuration.root.error("there is no `experiment` block",
                                              "add e.g. experiment: {type: plan, ...}"));
    return nullptr;
  }
  const Node* type = block->find("type");
  std::vector<std::string> names;
  for (const ExperimentType& known : kTypes) {
    if (type != nullptr && known.name == type->text()) return &known;
    names.push_back(known.name);
  }
  std::string list = "there are:";
  for (const std::string& name : names) list += " " + name;
  if (type == nullptr) {
    errors.push_back(block->error("the experiment has no `type`", list));
    return nullptr;
  }
  for (const auto& [before, now] : kFormerNames) {
    if (type->text() != before) continue;
    errors.push_back(type->error("there is no experiment type '" + type->text() + "' any more",
                                 "it is called '" + std::string(now) + "' now"));
    return nullptr;
  }
  const std::string nearest = nearest_name(type->text(), names);
  errors.push_back(type->error("there is no experiment type '" + type->text() + "'",
                               nearest.empty() ? list : "did you mean '" + nearest + "'?"));
  return nullptr;
}

bool is_block(std::string_view key) {
  constexpr std::array kOthers = {"planning", "check", "replanner", "sampler"};
  return std::ranges::find(kOthers, key) != kOthers.end() ||
         std::ranges::any_of(kPluginKinds,
                             [&](const PluginKind kind) { return key == to_string(kind); });
}

/// Refuses a block that `type` never reads: what it says is checked nowhere.
void refuse_unused(const Node::Entry& entry, const ExperimentType& type,
                   std::vector<Error>& errors) {
  std::string used = "its blocks: experiment";
  for (const std::string& name : type.blocks) used += ", " + name;
  for (const std::string& name : type.optional_blocks) used += ", " + name;
  const Node key(Node::Scalar{entry.key, false}, entry.key_mark);
  errors.push_back(key.error(
      "block `" + entry.key + "` has no effect in an experiment of type '" + type.name + "'",
      used + "; `" + entry.key + ": null` removes a block that a base configuration sets"));
}

void check_blocks(const Configuration& configuration, const ExperimentType* type, Host& host,
                  std::vector<Error>& errors) {
  if (type != nullptr) {
    for (const std::string& needed : type->blocks) {
      if (configuration.root.find(needed) != nullptr) continue;
      errors.push_back(configuration.root.error(
          "experiment '" + type->name + "' needs the block `" + needed + "`, and there is none"));
    }
    check_against_schema(*configuration.root.find("experiment"), type->schema(), {}, errors);
  }
  for (const Node::Entry& entry : configuration.root.entries()) {
    if (type != nullptr && is_block(entry.key) && !type->uses(entry.key)) {
      if (!entry.value.is_null()) refuse_unused(entry, *type, errors);
      continue;
    }
    if (const auto used = settings_schema(entry.key, type)) {
      check_against_used(entry.value, *used, errors);
    }
    for (const PluginKind kind : kPluginKinds) {
      if (entry.key == to_string(kind)) host.check(kind, entry.value, errors);
    }
    if (entry.key == "sampler" && !entry.value.is_null()) {
      host.check(PluginKind::kOptimiser, entry.value, errors);
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

/// Removes what an earlier run left, so that nothing of it can be taken for this run's.
Result<void> clear_results(const fs::path& folder) {
  std::error_code error;
  std::vector<fs::path> stale;
  for (const auto& entry : fs::directory_iterator(folder, error)) {
    const std::string name = entry.path().filename().string();
    const bool fixed = name == "effective_config.yaml" || name == "summary.json" ||
                       name == "report.html" || name == "table.csv" || name == kOmplDatabase ||
                       name.starts_with("results.sqlite");
    if (fixed || is_report_picture(name)) stale.push_back(entry.path());
  }
  for (const fs::path& file : stale) {
    if (!error) fs::remove(file, error);
  }
  if (error)
    return fail(ErrorCode::kIo, "cannot use the folder: " + error.message(), folder.string());
  return {};
}

Result<void> check_division(const ExperimentContext& context, const ExperimentType& type) {
  const std::string where = context.configuration.file.string();
  const Shard& shard = context.shard;
  if (shard.count < 1 || shard.index < 0 || shard.index >= shard.count) {
    return fail(ErrorCode::kConfig, "there is no such shard", where, "i/n, with i from 1 to n");
  }
  const bool asks_to_divide = !shard.is_whole();
  if (type.is_divisible() || (!asks_to_divide && (!context.resume || type.is_resumable))) return {};
  std::string able;
  for (const ExperimentType& known : kTypes) {
    const bool can = known.is_divisible() || (!asks_to_divide && known.is_resumable);
    if (can) able += (able.empty() ? "" : ", ") + known.name;
  }
  return fail(ErrorCode::kConfig,
              "an experiment of type '" + type.name + "' cannot be " +
                  (asks_to_divide ? "divided into shards" : "resumed"),
              where, "these can: " + able);
}

}  // namespace

bool ExperimentType::uses(std::string_view block) const noexcept {
  return std::ranges::find(blocks, block) != blocks.end() ||
         std::ranges::find(optional_blocks, block) != optional_blocks.end();
}

const std::vector<ExperimentType>& experiment_types() { return kTypes; }

std::vector<SettingsBlock> settings_blocks() {
  std::vector<SettingsBlock> blocks;
  for (const ExperimentType& type : kTypes) {
    blocks.push_back({"experiment", type.doc, type.schema(), type.name});
  }
  const auto add = [&](const char* key, const std::string& doc) {
    blocks.push_back({key, doc, settings_schema(key)->schema, ""});
  };
  add("planning", "How problems are posed, whoever solves them" + unused_sentence());
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
  const ExperimentType* type = find_type(configuration, errors);
  check_blocks(configuration, type, host, errors);
  check_field_fits_mapper(configuration, host, errors);
  if (type != nullptr) type->check(configuration, host, errors);
  return errors;
}

Node effective_configuration(const Configuration& configuration, Host& host) {
  Node root = configuration.root;
  std::vector<Error> ignored;
  const ExperimentType* type = find_type(configuration, ignored);
  if (type != nullptr && type->uses("check") && root.find("check") == nullptr) {
    const SourceMark origin{"default", 0, 0};
    root.entries().push_back({"check", origin, Node(Node::Map{}, origin)});
  }
  for (Node::Entry& entry : root.entries()) {
    if (entry.key == "experiment" && type != nullptr) {
      entry.value = fill_defaults(entry.value, type->schema());
      if (type->fill != nullptr) type->fill(entry.value, host);
    } else if (const auto used = settings_schema(entry.key, type)) {
      entry.value = fill_defaults(used_part(std::move(entry.value), *used), used->schema);
    }
    for (const PluginKind kind : kPluginKinds) {
      if (entry.key == to_string(kind)) entry.value = host.with_defaults(kind, entry.value);
    }
    if (entry.key == "sampler") {
      entry.value = host.with_defaults(PluginKind::kOptimiser, entry.value);
    }
    if (entry.key == "optimiser" && type != nullptr) leave_out(type->set_of_optimiser, entry.value);
  }
  return root;
}

Result<ExperimentOutcome> run_experiment(ExperimentContext& context) {
  std::vector<Error> errors;
  const ExperimentType* type = find_type(context.configuration, errors);
  if (type == nullptr) return tl::make_unexpected(std::move(errors.front()));
  if (auto divisible = check_division(context, *type); !divisible) return error_of(divisible);
  const auto write_configuration = [&] {
    const Node effective = effective_configuration(context.configuration, context.host);
    return write_file(context.out / "effective_config.yaml", to_yaml(effective, true));
  };
  // A run that goes on may yet find that it does not fit: until then the folder stays as it is.
  Result<void> done;
  if (!context.resume) done = clear_results(context.out);
  if (done && !context.resume) done = write_configuration();
  if (!done) return error_of(done);
  auto outcome = contained("experiment " + type->name, [&] { return type->run(context); });
  if (!outcome) return outcome;
  if (context.resume) done = write_configuration();
  if (!done) return error_of(done);
  if (context.progress) context.progress(0, 0, "drawing the report");
  if (auto saved = save_outcome(*outcome, context.out); !saved) return error_of(saved);
  return outcome;
}

}  // namespace sidestep
