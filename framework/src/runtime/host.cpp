#include <sidestep/runtime/host.hpp>

#include <algorithm>
#include <cstdlib>
#include <set>

#include <sidestep/core/seed.hpp>
#include <sidestep/runtime/not_built.hpp>

#include "plugin_library.hpp"

namespace sidestep {
namespace {

std::vector<std::filesystem::path> split_path_list(const char* list) {
  std::vector<std::filesystem::path> paths;
  std::string_view rest = list != nullptr ? list : "";
  while (!rest.empty()) {
    const std::size_t colon = rest.find(':');
    if (colon != 0) paths.emplace_back(rest.substr(0, colon));
    rest = colon == std::string_view::npos ? std::string_view{} : rest.substr(colon + 1);
  }
  return paths;
}

bool is_library(const std::filesystem::path& path) {
  std::error_code error;
  return path.extension() == ".so" && !std::filesystem::is_directory(path, error);
}

Node default_node(const Parameter& parameter) {
  const SourceMark mark{"default", 0, 0};
  const bool is_optional = parameter.default_text == "null";
  if (parameter.type == ParameterType::kObject && !is_optional) {
    Node::Map map;
    for (const Parameter& field : parameter.parameters) {
      if (!field.required) map.push_back({field.name, mark, default_node(field)});
    }
    return Node(std::move(map), mark);
  }
  const std::string& text = parameter.default_text;
  if (is_optional || text.empty()) {
    Node null;
    null.set_mark(mark);
    return null;
  }
  if (text == "\"\"") return Node(Node::Scalar{"", true}, mark);
  if (text.front() == '[') {
    Node::List list;
    std::string_view rest = std::string_view(text).substr(1, text.size() - 2);
    while (!rest.empty()) {
      const std::size_t comma = rest.find(", ");
      list.emplace_back(Node::Scalar{std::string(rest.substr(0, comma)), false}, mark);
      rest = comma == std::string_view::npos ? std::string_view{} : rest.substr(comma + 2);
    }
    return Node(std::move(list), mark);
  }
  return Node(Node::Scalar{text, false}, mark);
}

/// The key of a block by which it names its plugin.
const char* name_key(PluginKind kind) noexcept {
  return kind == PluginKind::kExperiment ? "type" : "plugin";
}

}  // namespace

std::vector<std::filesystem::path> host_plugin_paths(
    const std::vector<std::filesystem::path>& configured, const InstallLayout& layout) {
  std::vector<std::filesystem::path> paths = configured;
  const auto from_environment = split_path_list(std::getenv("SIDESTEP_PLUGIN_PATH"));
  paths.insert(paths.end(), from_environment.begin(), from_environment.end());
  paths.push_back(layout.plugins);
  return paths;
}

struct Host::Impl {
  struct Found {
    PluginInfo info;
    const PluginDescriptor* descriptor;

    [[nodiscard]] std::string qualified_name() const {
      return std::string(to_string(info.kind)) + " " + info.name;
    }
  };

  HostSettings settings;
  Log& log;
  const Clock& clock;
  WorkerPool& workers;
  const DocumentReader& documents;
  bool scanned = false;
  std::vector<Found> found;
  std::vector<PluginInfo> infos;
  std::vector<PluginRejection> rejections;
  std::vector<std::string> searched;  ///< Each folder, and what came of it.

  void scan() {
    if (std::exchange(scanned, true)) return;
    for (const auto& path : settings.plugin_paths) {
      if (is_library(path)) {
        searched.push_back(path.string());
        add_library(path);
      } else {
        scan_folder(path);
      }
    }
    std::ranges::sort(found, {}, [](const Found& f) {
      return std::pair(static_cast<std::uint32_t>(f.info.kind), f.info.name);
    });
    for (const Found& f : found) infos.push_back(f.info);
  }

  void scan_folder(const std::filesystem::path& folder) {
    std::error_code error;
    std::set<std::filesystem::path> libraries;
    for (const auto& entry : std::filesystem::directory_iterator(folder, error)) {
      if (is_library(entry.path())) libraries.insert(entry.path());
    }
    searched.push_back(folder.string() +
                       (error ? ": " + error.message()
                              : ": " + std::to_string(libraries.size()) +
                                    (libraries.size() == 1 ? " library" : " libraries")));
    for (const auto& library : libraries) add_library(library);
  }

  void reject(const std::filesystem::path& library, Error error) {
    log.debug(error.describe());
    rejections.push_back({library, std::move(error)});
  }

  void add_library(const std::filesystem::path& library) {
    const auto plugins = open_plugin_library(library);
    if (!plugins) return reject(library, plugins.error());
    for (const PluginDescriptor* plugin : *plugins) add_plugin(*plugin, library);
  }

  void add_plugin(const PluginDescriptor& d, const std::filesystem::path& library) {
    const auto same = std::ranges::find_if(
        found, [&](const Found& f) { return f.info.kind == d.kind && f.info.name == d.name; });
    if (same != found.end()) {
      log.info("plugin " + std::string(to_string(d.kind)) + " '" + d.name + "' is taken from " +
               same->info.library.string() + ", not from " + library.string());
      return;
    }
    auto schema = read_schema(d, library);
    if (!schema) return reject(library, schema.error());
    PluginInfo info{d.kind, d.name, d.version, d.doc, library, std::move(*schema), {}};
    for (const char* const* view = d.views; *view != nullptr; ++view) info.views.push_back(*view);
    found.push_back({std::move(info), &d});
  }

  Result<const Found*> find(PluginKind kind, const Node& block) {
    scan();
    const std::string kind_name(to_string(kind));
    if (!block.is_map()) {
      return tl::make_unexpected(
          block.error("'" + kind_name + "' must be a map with a plugin, found " + block.kind(),
                      kind_name + ": {plugin: NAME}"));
    }
    const std::string key = name_key(kind);
    const Node* name = block.find(key);
    if (name == nullptr || !name->is_scalar()) {
      return tl::make_unexpected(block.error("'" + kind_name + "' does not name a plugin",
                                             "add '" + key + ": NAME', one of " + names_of(kind)));
    }
    for (const Found& f : found) {
      if (f.info.kind == kind && f.info.name == name->text()) return &f;
    }
    return tl::make_unexpected(not_found(kind, *name));
  }

  /// Appends the mistakes in a block; those that the plugin finds only where its schema is met.
  void check(const Found& plugin, const Node& block, std::vector<Error>& errors) {
    const std::size_t before = errors.size();
    check_against_schema(block, plugin.info.schema, {name_key(plugin.info.kind)}, errors);
    check_plugin_blocks(block, plugin.info.schema, errors);
    if (errors.size() > before) return;
    const auto done = call_plugin(plugin.qualified_name(), [&]() -> Result<void> {
      plugin.descriptor->check(block, errors);
      return {};
    });
    if (!done) errors.push_back(done.error());
  }

  void check(PluginKind kind, const Node& block, std::vector<Error>& errors) {
    if (const auto plugin = find(kind, block)) {
      check(**plugin, block, errors);
    } else {
      errors.push_back(plugin.error());
    }
  }

  /// Checks the blocks of plugins in a map; passes over what does not fit its schema.
  void check_plugin_blocks(const Node& map, const Schema& schema, std::vector<Error>& errors) {
    for (const Parameter& parameter : schema) {
      const Node* value = map.find(parameter.name);
      if (value == nullptr || value->is_null()) continue;
      if (parameter.plugin && parameter.set_by_owner.empty()) {
        check(*parameter.plugin, *value, errors);
      } else if (parameter.type == ParameterType::kObject) {
        check_plugin_blocks(*value, parameter.parameters, errors);
      } else if (parameter.type == ParameterType::kObjects) {
        for (const Node& item : value->items()) {
          check_plugin_blocks(item, parameter.parameters, errors);
        }
      }
    }
  }

  std::vector<std::string> name_list(PluginKind kind) const {
    std::vector<std::string> names;
    for (const Found& f : found) {
      if (f.info.kind == kind) names.push_back(f.info.name);
    }
    return names;
  }

  std::string names_of(PluginKind kind) const {
    const std::vector<std::string> names = name_list(kind);
    return names.empty() ? "(none found)" : joined(names);
  }

  Error not_found(PluginKind kind, const Node& name) const {
    const std::string kind_name(to_string(kind));
    std::string message = "there is no " + kind_name + " plugin '" + name.text() + "'";
    message += "\n  plugins of this kind: " + names_of(kind) + "\n  searched:";
    for (const std::string& folder : searched) message += "\n    " + folder;
    if (!rejections.empty()) message += "\n  refused:";
    for (const PluginRejection& rejection : rejections) {
      message += "\n    " + rejection.error.describe();
    }
    return Error{ErrorCode::kPlugin, std::move(message), name.mark().to_string(),
                 instead_of(kind_name, kind, name.text()), nullptr};
  }

  /// What to do where there is no plugin of that name: build it, or take the nearest.
  std::string instead_of(const std::string& kind_name, PluginKind kind,
                         const std::string& name) const {
    for (const NotBuiltPlugin& plugin : plugins_not_built(settings.plugin_paths)) {
      if (plugin.kind == kind_name && plugin.name == name) return how_to_build(plugin);
    }
    return did_you_mean(name, name_list(kind));
  }
};

Host::Host(HostSettings settings, Log& log, const Clock& clock, WorkerPool& workers,
           const DocumentReader& documents)
    : impl_(new Impl{std::move(settings), log, clock, workers, documents}) {}

Host::~Host() = default;

const std::vector<PluginInfo>& Host::plugins() {
  impl_->scan();
  return impl_->infos;
}

const std::vector<PluginRejection>& Host::rejections() {
  impl_->scan();
  return impl_->rejections;
}

Result<PluginInfo> Host::find(PluginKind kind, const Node& block) {
  const auto found = SIDESTEP_TRY(impl_->find(kind, block));
  return found->info;
}

void Host::check(PluginKind kind, const Node& block, std::vector<Error>& errors) {
  impl_->check(kind, block, errors);
}

void Host::check_views(const Node& mapper_block, const std::vector<std::string>& needed,
                       const std::string& what, std::vector<Error>& errors) {
  const auto mapper = impl_->find(PluginKind::kMapper, mapper_block);
  if (!mapper) return;
  const auto lacks = [&](const PluginInfo& info) {
    return std::ranges::find_if(needed, [&](const std::string& view) {
      return std::ranges::find(info.views, view) == info.views.end();
    });
  };
  const auto missing = lacks((*mapper)->info);
  if (missing == needed.end()) return;
  std::string would_do;
  for (const PluginInfo& other : impl_->infos) {
    if (other.kind != PluginKind::kMapper || lacks(other) != needed.end()) continue;
    would_do += (would_do.empty() ? "" : ", ") + other.name;
  }
  errors.push_back(mapper_block.find("plugin")->error(
      what + " needs a mapper that offers its " + *missing + ", and '" + (*mapper)->info.name +
          "' does not",
      would_do.empty() ? "no mapper that was found does" : "mappers that do: " + would_do));
}

Node Host::with_defaults(PluginKind kind, const Node& block) {
  const auto found = impl_->find(kind, block);
  return found ? with_defaults(block, (*found)->info.schema) : block;
}

Node Host::with_defaults(const Node& map, const Schema& schema) {
  Node filled = map;
  if (!filled.is_map()) return filled;
  for (const Parameter& parameter : schema) {
    Node* value = filled.find(parameter.name);
    if (value == nullptr || value->is_null()) {
      if (parameter.required) continue;
      Node fallback = default_node(parameter);
      if (value != nullptr) {
        *value = std::move(fallback);
      } else {
        filled.entries().push_back({parameter.name, {"default", 0, 0}, std::move(fallback)});
      }
    } else if (parameter.plugin) {
      Node block = with_defaults(*parameter.plugin, *value);
      std::erase_if(block.entries(), [&](const Node::Entry& entry) {
        return std::ranges::find(parameter.set_by_owner, entry.key) !=
                   parameter.set_by_owner.end() &&
               value->find(entry.key) == nullptr;
      });
      *value = std::move(block);
    } else if (parameter.type == ParameterType::kObject) {
      *value = with_defaults(*value, parameter.parameters);
    } else if (parameter.type == ParameterType::kObjects && value->is_list()) {
      for (Node& item : value->items()) item = with_defaults(item, parameter.parameters);
    }
  }
  return filled;
}

Result<Host::Made> Host::create_object(PluginKind kind, const Node& block, const RunLoan& loan) {
  const auto found = SIDESTEP_TRY(impl_->find(kind, block));
  std::vector<Error> errors;
  // An experiment checks its block with the whole configuration.
  if (kind != PluginKind::kExperiment) impl_->check(*found, block, errors);
  if (!errors.empty()) return tl::make_unexpected(std::move(errors.front()));

  const std::string name = found->qualified_name();
  const HostContext context{impl_->log,
                            loan.clock != nullptr ? *loan.clock : impl_->clock,
                            impl_->workers,
                            impl_->documents,
                            derive_seed(loan.seed.value_or(impl_->settings.seed), name),
                            impl_->settings.robot_paths,
                            impl_->settings.scene_paths,
                            loan.robot,
                            loan.motion,
                            loan.scene,
                            loan.truth};
  const PluginDescriptor& descriptor = *found->descriptor;
  return call_plugin(name, [&]() -> Result<Made> {
    Error error;
    void* object = descriptor.create(block, context, &error);
    if (object != nullptr) return Made{object, {descriptor.destroy, name}};
    if (error.message.empty()) {
      error = {ErrorCode::kPlugin, "could not be created and did not say why", "", "", nullptr};
    }
    // A file, perhaps with a line, is more than the block could add; the plugin's name is not.
    const bool names_a_file = error.where.find_first_of(":/") != std::string::npos;
    if (!names_a_file) {
      error.where =
          block.mark().to_string() + ": " + (error.where.empty() ? "plugin " + name : error.where);
    }
    return tl::make_unexpected(std::move(error));
  });
}

}  // namespace sidestep
