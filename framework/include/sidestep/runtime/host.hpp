#pragma once

#include <cstdint>
#include <filesystem>
#include <memory>
#include <optional>
#include <string>
#include <type_traits>
#include <utility>
#include <vector>

#include <sidestep/core/error.hpp>
#include <sidestep/core/log.hpp>
#include <sidestep/core/worker_pool.hpp>
#include <sidestep/plugin/plugin.hpp>
#include <sidestep/runtime/call_plugin.hpp>
#include <sidestep/runtime/install_layout.hpp>

namespace sidestep {

/// One plugin that was found and fits this host.
struct PluginInfo {
  PluginKind kind = PluginKind::kSource;
  std::string name;
  std::string version;
  std::string doc;
  std::filesystem::path library;
  Schema schema;
  std::vector<std::string> views;  ///< That a mapper offers, or a field needs of its mapper.
};

/// A library in the search path that is not a usable plugin, and why.
struct PluginRejection {
  std::filesystem::path library;
  Error error;
};

struct HostSettings {
  /// Searched first to last: the configuration's `plugin_paths`, SIDESTEP_PLUGIN_PATH, the
  /// installation's own folder (host_plugin_paths() puts them together).
  std::vector<std::filesystem::path> plugin_paths;
  std::vector<std::filesystem::path> robot_paths;
  std::vector<std::filesystem::path> scene_paths;
  std::uint64_t seed = 0;
};

/// The search path: `configured`, then SIDESTEP_PLUGIN_PATH (colon separated), then `layout`'s.
[[nodiscard]] std::vector<std::filesystem::path> host_plugin_paths(
    const std::vector<std::filesystem::path>& configured, const InstallLayout& layout);

/// Destroys a plugin's object, and knows whose it is.
struct PluginDeleter {
  void (*destroy)(void*) = nullptr;
  std::string plugin;  ///< Kind and name, e.g. "mapper voxel_grid".

  void operator()(void* object) const {
    const PluginCall noted(plugin);
    destroy(object);
  }
};
template <class Interface>
using PluginPtr = std::unique_ptr<Interface, PluginDeleter>;

/// Kind and name of the plugin whose object this is, e.g. "mapper voxel_grid".
template <class Interface>
[[nodiscard]] const std::string& plugin_of(const PluginPtr<Interface>& object) noexcept {
  return object.get_deleter().plugin;
}

/// A plugin's robot whose exceptions leave as PluginThrew, naming the plugin. Robots are called
/// from deep within costs and checks, some of them other plugins', by batches: the detour costs
/// nothing. A KinematicTree, in which no code of the plugin's runs, is returned as it is.
[[nodiscard]] PluginPtr<RobotModel> guard_robot(PluginPtr<RobotModel> robot);

/// A plugin's cost whose exceptions leave as PluginThrew, likewise; it names its residuals
/// (planning/residual_names.hpp) if the plugin's does.
[[nodiscard]] PluginPtr<StateCost> guard_cost(PluginPtr<StateCost> cost);

/// Run-specific resources lent to plugins, beside those of the host.
struct RunLoan {
  std::shared_ptr<const RobotModel> robot;  ///< Null while the robot is created.
  std::shared_ptr<RobotMotion> motion;      ///< Null where no robot moves.
  const Clock* clock = nullptr;             ///< Null: the host's.
  std::optional<std::uint64_t> seed;        ///< From which the plugin's is derived; the host's.
  std::shared_ptr<const Scene> scene = nullptr;  ///< What is truly there; null where not known.
  GroundTruth* truth = nullptr;  ///< Who knows it as the run goes on; null where not known.
};

/// Finds, checks and creates plugins, and lends them what they need. Libraries are loaded with
/// RTLD_NOW | RTLD_LOCAL | RTLD_NODELETE and never unloaded. [main] thread.
class Host {
 public:
  Host(HostSettings settings, Log& log, const Clock& clock, WorkerPool& workers,
       const DocumentReader& documents);
  ~Host();
  Host(const Host&) = delete;
  Host& operator=(const Host&) = delete;

  /// Every usable plugin in the search path, by kind then name; scanned once.
  [[nodiscard]] const std::vector<PluginInfo>& plugins();
  /// Every library in the search path that is not, with the reason.
  [[nodiscard]] const std::vector<PluginRejection>& rejections();

  /// The plugin that a block such as `{plugin: edt, signed: false}` names. Fails with kPlugin,
  /// listing the paths tried and why each failed, what exists, and the nearest name.
  [[nodiscard]] Result<PluginInfo> find(PluginKind kind, const Node& block);

  /// Checks a block against its plugin's schema and, where it fits that, the blocks of plugins in
  /// it and then with the plugin's own check; appends all mistakes.
  void check(PluginKind kind, const Node& block, std::vector<Error>& errors);

  /// Checks that the mapper that one block names offers every view that `needed` lists; `what`
  /// needs them, e.g. "the field 'edt'". Appends one mistake, which names the mappers that would
  /// do. Blocks that name no plugin are passed over.
  void check_views(const Node& mapper_block, const std::vector<std::string>& needed,
                   const std::string& what, std::vector<Error>& errors);

  /// The block with every default that it leaves open filled in, marked as default; for the
  /// effective configuration.
  [[nodiscard]] Node with_defaults(PluginKind kind, const Node& block);
  /// The map with every default of `schema` that it and the blocks of plugins in it leave open.
  [[nodiscard]] Node with_defaults(const Node& map, const Schema& schema);

  /// Creates the object a block describes. An exception that escapes becomes an Error naming
  /// the plugin; one that escapes from a robot or a cost later on leaves it as PluginThrew. `robot`
  /// is lent to the plugin; null while the robot is created.
  template <class Interface>
  [[nodiscard]] Result<PluginPtr<Interface>> create(
      const Node& block, const std::shared_ptr<const RobotModel>& robot = nullptr) {
    return create<Interface>(block, RunLoan{robot, nullptr, nullptr, {}});
  }

  /// The same with all that a run lends. What `loan` points to outlives the object.
  template <class Interface>
  [[nodiscard]] Result<PluginPtr<Interface>> create(const Node& block, const RunLoan& loan) {
    auto made = SIDESTEP_TRY(create_object(PluginTraits<Interface>::kKind, block, loan));
    PluginPtr<Interface> object(static_cast<Interface*>(made.object), std::move(made.deleter));
    if constexpr (std::is_same_v<Interface, RobotModel>) {
      return guard_robot(std::move(object));
    } else if constexpr (std::is_same_v<Interface, StateCost>) {
      return guard_cost(std::move(object));
    } else {
      return object;
    }
  }

 private:
  struct Impl;
  struct Made {
    void* object;
    PluginDeleter deleter;
  };
  [[nodiscard]] Result<Made> create_object(PluginKind kind, const Node& block, const RunLoan& loan);
  std::unique_ptr<Impl> impl_;
};

}  // namespace sidestep
