#pragma once

#include <cstdint>
#include <vector>

#include <sidestep/plugin/context.hpp>
#include <sidestep/plugin/schema.hpp>

namespace sidestep {

inline constexpr std::uint32_t kPluginMagic = 0x50534453u;  // "SDSP"
inline constexpr std::uint16_t kSdkMajor = 0;
inline constexpr std::uint16_t kSdkMinor = 9;

/// Versions of the interface of each kind: raised whenever its virtuals or the data they
/// exchange change.
inline constexpr std::uint32_t kSourceInterface = 1;
inline constexpr std::uint32_t kMapperInterface = 1;
inline constexpr std::uint32_t kFieldInterface = 2;
inline constexpr std::uint32_t kRobotInterface = 3;
inline constexpr std::uint32_t kOptimiserInterface = 3;
inline constexpr std::uint32_t kExecutorInterface = 1;
inline constexpr std::uint32_t kCostInterface = 1;
inline constexpr std::uint32_t kExperimentInterface = 1;
inline constexpr std::uint32_t kPredictorInterface = 1;
inline constexpr std::uint32_t kGazeInterface = 1;
inline constexpr std::uint32_t kLocaliserInterface = 1;

/// Macros of the standard library and of Eigen that change what objects look like.
enum LibraryOption : std::uint32_t {
  kGlibcxxDebug = 1,     ///< _GLIBCXX_DEBUG
  kEigenRowMajor = 2,    ///< EIGEN_DEFAULT_TO_ROW_MAJOR
  kEigenOtherIndex = 4,  ///< EIGEN_DEFAULT_DENSE_INDEX_TYPE that is not std::ptrdiff_t
};

/// How a binary was built, as far as it decides whether C++ objects may cross between it and
/// the host. Plain data with fixed layout. Filled in by abi_stamp() in the including binary.
struct AbiStamp {
  char compiler_abi[32];                ///< E.g. "itanium-1017".
  std::uint32_t libstdcxx_cxx11_abi;    ///< _GLIBCXX_USE_CXX11_ABI
  std::uint32_t library_options;        ///< Of LibraryOption, with which objects look otherwise.
  std::int64_t cplusplus;               ///< __cplusplus
  std::uint32_t eigen_version;          ///< world * 10000 + major * 100 + minor
  std::uint32_t eigen_max_align_bytes;  ///< EIGEN_MAX_ALIGN_BYTES
  char sanitizers[32];                  ///< "none", "address", "thread", "memory"
};

/// What a plugin's library exports, the first of as many as it holds. The prefix up to `abi` has a
/// layout that never changes; the host reads nothing behind it before the stamp has been found
/// equal.
struct PluginDescriptor {
  std::uint32_t size;   ///< sizeof(PluginDescriptor)
  std::uint32_t magic;  ///< kPluginMagic
  std::uint16_t sdk_major;
  std::uint16_t sdk_minor;
  std::uint32_t interface_version;
  AbiStamp abi;
  PluginKind kind;
  const char* name;
  const char* version;
  const char* doc;  ///< One line.
  /// Names of the views that a mapper offers or a field needs of its mapper; null-terminated.
  const char* const* views;
  /// The parameters, declared once.
  const Schema& (*schema)();
  /// Appends every mistake that the schema cannot know of, with its position. `parameters` has been
  /// checked against the schema. Must not throw; the host catches what does.
  void (*check)(const Node& parameters, std::vector<Error>& errors);
  /// A new object of the kind's interface, or null and *error. `parameters` has been checked
  /// against the schema and with check(). Must not throw; the host catches what does.
  void* (*create)(const Node& parameters, const HostContext& context, Error* error);
  void (*destroy)(void* object);
  const PluginDescriptor* next;  ///< Another plugin of the same library, or null.
};

/// The most plugins that a host takes from one library.
inline constexpr int kMostPluginsOfLibrary = 64;

/// The name of the one function that a plugin's library exports:
/// extern "C" const PluginDescriptor* sidestep_plugin().
inline constexpr const char* kPluginSymbol = "sidestep_plugin";

}  // namespace sidestep
