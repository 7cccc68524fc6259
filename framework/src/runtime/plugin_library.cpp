#include "plugin_library.hpp"

#include <cxxabi.h>
#include <dlfcn.h>

#include <algorithm>
#include <cstdlib>
#include <cstring>
#include <exception>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <utility>

#include <sidestep/core/plugin_calls.hpp>
#include <sidestep/plugin/plugin.hpp>
#include <sidestep/runtime/host.hpp>
#include <sidestep/runtime/install_layout.hpp>

#include "process_state.hpp"

namespace sidestep {
namespace {

std::string text_of(const AbiStamp& stamp) {
  return std::string("compiler ABI ") + stamp.compiler_abi + ", libstdc++ cxx11 ABI " +
         std::to_string(stamp.libstdcxx_cxx11_abi) + ", library options " +
         std::to_string(stamp.library_options) + ", __cplusplus " +
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

constexpr const char* kRebuild =
    "rebuild the plugin against this Sidestep: cmake --build BUILD_FOLDER --clean-first";

struct StampDifference {
  std::string field;
  std::string remedy;
};

/// g++ and clang++ share the Itanium ABI; its revisions are about what hardly ever occurs, and
/// distributions mix them.
bool is_compatible_compiler(const AbiStamp& plugin, const AbiStamp& host) {
  constexpr std::string_view kItanium = "itanium-";
  return std::strcmp(plugin.compiler_abi, host.compiler_abi) == 0 ||
         (std::string_view(plugin.compiler_abi).starts_with(kItanium) &&
          std::string_view(host.compiler_abi).starts_with(kItanium));
}

std::optional<StampDifference> difference(const AbiStamp& plugin, const AbiStamp& host) {
  if (!is_compatible_compiler(plugin, host)) {
    return StampDifference{"compiler ABI", "with g++ or clang++"};
  }
  if (plugin.libstdcxx_cxx11_abi != host.libstdcxx_cxx11_abi) {
    return StampDifference{"libstdc++ cxx11 ABI", "without -D_GLIBCXX_USE_CXX11_ABI"};
  }
  const std::uint32_t options = plugin.library_options ^ host.library_options;
  for (const auto& [option, macro] : {std::pair(kGlibcxxDebug, "_GLIBCXX_DEBUG"),
                                      {kEigenRowMajor, "EIGEN_DEFAULT_TO_ROW_MAJOR"},
                                      {kEigenOtherIndex, "EIGEN_DEFAULT_DENSE_INDEX_TYPE"}}) {
    if ((options & option) == 0) continue;
    const bool is_plugins = (plugin.library_options & option) != 0;
    return StampDifference{macro, std::string(is_plugins ? "without -D" : "with -D") + macro};
  }
  // Later standards leave the library's types as they are.
  if (plugin.cplusplus < 202002 || host.cplusplus < 202002) {
    return StampDifference{"__cplusplus", "with -std=c++20 or later"};
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

/// On the board while a library is opened: its constructors run, whatever they do.
struct Opening {
  explicit Opening(const std::filesystem::path& opened) : library(opened) {
    board.opening.set(library.native());
    board.opening_since_ns = board_time_ns();
  }
  ~Opening() {
    board.opening_since_ns = 0;
    board.opening.set("");
  }
  Opening(const Opening&) = delete;
  Opening& operator=(const Opening&) = delete;

  /// Fails where the library did what the process cannot go on with. One that is watched ends.
  [[nodiscard]] Result<void> undo() const {
    const std::string harm = before.restore();
    if (harm.empty()) return {};
    if (!board.is_watched) return refuse(library, harm);
    board.harm.set(harm);
    std::_Exit(EXIT_FAILURE);
  }

  const std::filesystem::path& library;
  PluginBoard& board = plugin_board();
  ProcessState before;
  FloatingPointGuard rounding;  ///< One built with -ffast-math would have it changed for all.
};

Result<void> check_descriptor(const PluginDescriptor& plugin,
                              const std::filesystem::path& library) {
  const std::string rebuild = kRebuild;
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
  const Opening opening(library);
  try {
    auto schema = plugin.schema();
    SIDESTEP_TRY(opening.undo());
    return schema;
  } catch (const std::exception& exception) {
    return refuse(library, std::string("schema() threw: ") + exception.what());
  } catch (...) {
    return refuse(library, "schema() threw something that is not a std::exception");
  }
}

/// Why dlopen() failed, with a symbol as C++ has it.
tl::unexpected<Error> refuse_unloaded(const std::filesystem::path& library,
                                      const std::string& reason) {
  constexpr std::string_view kMissing = "undefined symbol: ";
  const std::size_t at = reason.find(kMissing);
  if (at == std::string::npos) return refuse(library, "cannot be loaded: " + reason);
  const std::string symbol = reason.substr(at + kMissing.size());
  int status = 0;
  const std::unique_ptr<char, decltype(&std::free)> plain(
      abi::__cxa_demangle(symbol.c_str(), nullptr, nullptr, &status), &std::free);
  const std::string name = plain ? plain.get() : symbol;
  if (name.find("sidestep::") != std::string::npos) {
    return refuse(library,
                  "cannot be loaded: it uses " + name + ", which this Sidestep does not have",
                  "it was built for another version: " + std::string(kRebuild));
  }
  return refuse(library, "cannot be loaded: no library has " + name,
                "name the library that has it: sidestep_add_plugin(... LINK ...)");
}

namespace {

Result<std::vector<const PluginDescriptor*>> open_descriptors(
    const std::filesystem::path& library) {
  void* handle = dlopen(library.c_str(), RTLD_NOW | RTLD_LOCAL | RTLD_NODELETE);
  if (handle == nullptr) {
    const char* const reason = dlerror();
    return refuse_unloaded(library, reason != nullptr ? reason : "unknown");
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
  std::vector<const PluginDescriptor*> plugins;
  for (; descriptor != nullptr; descriptor = descriptor->next) {
    SIDESTEP_TRY(check_descriptor(*descriptor, library));
    const auto is_same = [&](const PluginDescriptor* other) {
      return other->kind == descriptor->kind && std::string_view(other->name) == descriptor->name;
    };
    if (std::ranges::any_of(plugins, is_same)) {
      return refuse(library, "holds two plugins that are " +
                                 std::string(to_string(descriptor->kind)) + " '" +
                                 descriptor->name + "'");
    }
    if (plugins.size() == kMostPluginsOfLibrary) {
      return refuse(library,
                    "holds more than " + std::to_string(kMostPluginsOfLibrary) + " plugins");
    }
    plugins.push_back(descriptor);
  }
  return plugins;
}

}  // namespace

Result<std::vector<const PluginDescriptor*>> open_plugin_library(
    const std::filesystem::path& library) {
  const Opening opening(library);
  PluginBoard& board = opening.board;
  for (const PluginBoard::Refusal& refusal :
       std::span(board.refusals).first(static_cast<std::size_t>(board.refusal_count))) {
    if (refusal.library.view() == library.native()) {
      return refuse(library, std::string(refusal.reason.view()));
    }
  }
  const bool is_foreign = library.parent_path() != install_layout().plugins;
  if (is_foreign && board.refuses_foreign) {
    return refuse(library, "is left out: one like it ended the command after it was opened");
  }
  auto plugins = open_descriptors(library);
  SIDESTEP_TRY(opening.undo());
  if (is_foreign) {
    ++board.foreign_count;
    board.last_foreign.set(library.native());
  }
  return plugins;
}

}  // namespace sidestep
