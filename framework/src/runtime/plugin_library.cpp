#include "plugin_library.hpp"

#include <dlfcn.h>

#include <cstring>
#include <exception>
#include <optional>
#include <string>
#include <utility>

#include <sidestep/plugin/plugin.hpp>
#include <sidestep/runtime/host.hpp>

namespace sidestep {
namespace {

std::string text_of(const AbiStamp& stamp) {
  return std::string("compiler ABI ") + stamp.compiler_abi + ", libstdc++ cxx11 ABI " +
         std::to_string(stamp.libstdcxx_cxx11_abi) + ", __cplusplus " +
         std::to_string(stamp.cplusplus) + ", Eigen " + std::to_string(stamp.eigen_version) +
         ", EIGEN_MAX_ALIGN_BYTES " + std::to_string(stamp.eigen_max_align_bytes) +
         ", sanitizers " + stamp.sanitizers;
}

/// The stamp with its texts ended, whatever the library wrote there.
AbiStamp terminated(AbiStamp stamp) {
  stamp.compiler_abi[sizeof(stamp.compiler_abi) - 1] = '\0';
  stamp.sanitizers[sizeof(stamp.sanitizers) - 1] = '\0';
  return stamp;
}

struct StampDifference {
  std::string field;
  std::string remedy;
};

std::optional<StampDifference> difference(const AbiStamp& plugin, const AbiStamp& host) {
  if (std::strcmp(plugin.compiler_abi, host.compiler_abi) != 0) {
    return StampDifference{"compiler ABI", "with the compiler that built Sidestep"};
  }
  if (plugin.libstdcxx_cxx11_abi != host.libstdcxx_cxx11_abi) {
    return StampDifference{"libstdc++ cxx11 ABI", "without -D_GLIBCXX_USE_CXX11_ABI"};
  }
  if (plugin.cplusplus != host.cplusplus) {
    return StampDifference{"__cplusplus", "with the C++ standard of Sidestep (-std=c++20)"};
  }
  if (plugin.eigen_version != host.eigen_version) {
    return StampDifference{"Eigen version", "against the Eigen that Sidestep was built with"};
  }
  if (plugin.eigen_max_align_bytes != host.eigen_max_align_bytes) {
    return StampDifference{"EIGEN_MAX_ALIGN_BYTES",
                           "without -march, -mavx and the like; use target_clones per kernel"};
  }
  if (std::strcmp(plugin.sanitizers, host.sanitizers) != 0) {
    return StampDifference{"sanitizers", "with the same -fsanitize as Sidestep"};
  }
  return std::nullopt;
}

tl::unexpected<Error> refuse(const std::filesystem::path& library, std::string message,
                             std::string hint = {}) {
  return fail(ErrorCode::kPlugin, std::move(message), library.string(), std::move(hint));
}

template <class T>
std::string mismatch(const std::string& field, T plugin, T host) {
  return field + " is " + std::to_string(plugin) + ", this host's is " + std::to_string(host);
}

Result<void> check_descriptor(const PluginDescriptor& plugin,
                              const std::filesystem::path& library) {
  const std::string rebuild =
      "rebuild the plugin against this Sidestep: "
      "cmake --build BUILD_FOLDER --clean-first";
  if (plugin.magic != kPluginMagic) {
    return refuse(library, mismatch("the descriptor's magic", plugin.magic, kPluginMagic), rebuild);
  }
  if (plugin.size != sizeof(PluginDescriptor)) {
    return refuse(
        library,
        mismatch<std::size_t>("the descriptor's size", plugin.size, sizeof(PluginDescriptor)),
        rebuild);
  }
  // While the major version is 0, a minor version may change everything.
  if (plugin.sdk_major != kSdkMajor || plugin.sdk_minor != kSdkMinor) {
    const auto version = [](int major, int minor) {
      return std::to_string(major) + "." + std::to_string(minor);
    };
    return refuse(library,
                  "built for SDK " + version(plugin.sdk_major, plugin.sdk_minor) +
                      ", this host has SDK " + version(kSdkMajor, kSdkMinor),
                  rebuild);
  }
  const AbiStamp host_stamp = abi_stamp();
  const AbiStamp plugin_stamp = terminated(plugin.abi);
  if (const auto differs = difference(plugin_stamp, host_stamp)) {
    return refuse(
        library,
        "the ABI stamp differs in " + differs->field + "\n  plugin: " + text_of(plugin_stamp) +
            "\n  host:   " + text_of(host_stamp),
        "rebuild the plugin " + differs->remedy + ": cmake --build BUILD_FOLDER --clean-first");
  }
  const auto version = interface_version(plugin.kind);
  if (!version) {
    return refuse(library, "kind " + std::to_string(static_cast<std::uint32_t>(plugin.kind)) +
                               " is not known to this host");
  }
  if (plugin.interface_version != *version) {
    return refuse(library,
                  mismatch("the interface version of kind " + std::string(to_string(plugin.kind)),
                           plugin.interface_version, *version),
                  rebuild);
  }
  const std::pair<const char*, bool> fields[] = {
      {"name", plugin.name != nullptr && *plugin.name != '\0'},
      {"version", plugin.version != nullptr},
      {"doc", plugin.doc != nullptr},
      {"views", plugin.views != nullptr},
      {"schema", plugin.schema != nullptr},
      {"check", plugin.check != nullptr},
      {"create", plugin.create != nullptr},
      {"destroy", plugin.destroy != nullptr}};
  for (const auto& [field, is_filled] : fields) {
    if (!is_filled) {
      return refuse(library, std::string("the descriptor's ") + field + " is empty",
                    "a plugin ends with SIDESTEP_PLUGIN(...)");
    }
  }
  return {};
}

}  // namespace

std::optional<std::uint32_t> interface_version(PluginKind kind) noexcept {
  switch (kind) {
    case PluginKind::kSource: return kSourceInterface;
    case PluginKind::kMapper: return kMapperInterface;
    case PluginKind::kField: return kFieldInterface;
    case PluginKind::kRobot: return kRobotInterface;
    case PluginKind::kOptimiser: return kOptimiserInterface;
    case PluginKind::kExecutor: return kExecutorInterface;
    case PluginKind::kCost: return kCostInterface;
    case PluginKind::kExperiment: return kExperimentInterface;
    case PluginKind::kPredictor: return kPredictorInterface;
    case PluginKind::kGaze: return kGazeInterface;
    case PluginKind::kLocaliser: return kLocaliserInterface;
  }
  return std::nullopt;
}

Result<Schema> read_schema(const PluginDescriptor& plugin, const std::filesystem::path& library) {
  try {
    return plugin.schema();
  } catch (const std::exception& exception) {
    return refuse(library, std::string("schema() threw: ") + exception.what());
  } catch (...) {
    return refuse(library, "schema() threw something that is not a std::exception");
  }
}

Result<const PluginDescriptor*> open_plugin_library(const std::filesystem::path& library) {
  void* handle = dlopen(library.c_str(), RTLD_NOW | RTLD_LOCAL | RTLD_NODELETE);
  if (handle == nullptr) {
    const char* reason = dlerror();
    return refuse(library, std::string("cannot be loaded: ") + (reason ? reason : "unknown"));
  }
  void* symbol = dlsym(handle, kPluginSymbol);
  if (symbol == nullptr) {
    return refuse(library, std::string("does not export ") + kPluginSymbol + "()",
                  "a plugin ends with SIDESTEP_PLUGIN(...)");
  }
  const PluginDescriptor* descriptor = nullptr;
  try {
    descriptor = reinterpret_cast<const PluginDescriptor* (*)()>(symbol)();
  } catch (...) {
    return refuse(library, std::string(kPluginSymbol) + "() threw");
  }
  if (descriptor == nullptr) {
    return refuse(library, std::string(kPluginSymbol) + "() returned null");
  }
  SIDESTEP_TRY(check_descriptor(*descriptor, library));
  return descriptor;
}

}  // namespace sidestep
