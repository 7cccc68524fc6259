#pragma once

#include <cstddef>
#include <cstring>
#include <memory>
#include <type_traits>
#include <utility>
#include <vector>

#include <sidestep/field/distance_field.hpp>
#include <sidestep/mapping/field_builder.hpp>
#include <sidestep/mapping/localiser.hpp>
#include <sidestep/mapping/mapper.hpp>
#include <sidestep/planning/executor.hpp>
#include <sidestep/planning/gaze.hpp>
#include <sidestep/planning/optimiser.hpp>
#include <sidestep/planning/prediction.hpp>
#include <sidestep/planning/state_cost.hpp>
#include <sidestep/plugin/descriptor.hpp>
#include <sidestep/plugin/parameters.hpp>
#include <sidestep/robot/robot_model.hpp>
#include <sidestep/sensing/source.hpp>

/// Everything that a plugin's one .cpp needs:
///
///     struct Options {
///       double radius_m = 0.1;
///       static Parameters<Options> parameters() {
///         return Parameters<Options>().add("radius_m", &Options::radius_m, "Radius of the point.",
///                                      {.unit = "m", .min = 0.0});
///       }
///       // Where parameters must fit together; may be left out.
///       std::vector<OptionMistake> check() const;
///     };
///     Result<std::unique_ptr<RobotModel>> create(const Options& options, const HostContext&);
///     SIDESTEP_PLUGIN(RobotModel, Options, create, "point", "0.1.0", "A point in the plane")

namespace sidestep {

/// Describes a plugin; `next` is another one of its library, or null.
using DescriptorFunction = const PluginDescriptor*(const PluginDescriptor* next);

/// Kind and interface version of each interface a plugin can implement.
template <class Interface>
struct PluginTraits;
template <>
struct PluginTraits<Source> {
  static constexpr PluginKind kKind = PluginKind::kSource;
  static constexpr std::uint32_t kVersion = kSourceInterface;
};
template <>
struct PluginTraits<Mapper> {
  static constexpr PluginKind kKind = PluginKind::kMapper;
  static constexpr std::uint32_t kVersion = kMapperInterface;
};
template <>
struct PluginTraits<FieldBuilder> {
  static constexpr PluginKind kKind = PluginKind::kField;
  static constexpr std::uint32_t kVersion = kFieldInterface;
};
template <>
struct PluginTraits<RobotModel> {
  static constexpr PluginKind kKind = PluginKind::kRobot;
  static constexpr std::uint32_t kVersion = kRobotInterface;
};
template <>
struct PluginTraits<Optimiser> {
  static constexpr PluginKind kKind = PluginKind::kOptimiser;
  static constexpr std::uint32_t kVersion = kOptimiserInterface;
};
template <>
struct PluginTraits<Executor> {
  static constexpr PluginKind kKind = PluginKind::kExecutor;
  static constexpr std::uint32_t kVersion = kExecutorInterface;
};
template <>
struct PluginTraits<StateCost> {
  static constexpr PluginKind kKind = PluginKind::kCost;
  static constexpr std::uint32_t kVersion = kCostInterface;
};
template <>
struct PluginTraits<Predictor> {
  static constexpr PluginKind kKind = PluginKind::kPredictor;
  static constexpr std::uint32_t kVersion = kPredictorInterface;
};
template <>
struct PluginTraits<Gaze> {
  static constexpr PluginKind kKind = PluginKind::kGaze;
  static constexpr std::uint32_t kVersion = kGazeInterface;
};
template <>
struct PluginTraits<Localiser> {
  static constexpr PluginKind kKind = PluginKind::kLocaliser;
  static constexpr std::uint32_t kVersion = kLocaliserInterface;
};

namespace detail {

/// The sanitizer that decides how memory is laid out. g++ tells by macro, clang++ by feature.
#if defined(__SANITIZE_ADDRESS__)
inline constexpr const char* kSanitizer = "address";
#elif defined(__SANITIZE_THREAD__)
inline constexpr const char* kSanitizer = "thread";
#elif defined(__has_feature)
inline constexpr const char* kSanitizer = __has_feature(address_sanitizer)  ? "address"
                                          : __has_feature(thread_sanitizer) ? "thread"
                                          : __has_feature(memory_sanitizer) ? "memory"
                                                                            : "none";
#else
inline constexpr const char* kSanitizer = "none";
#endif

}  // namespace detail

/// The stamp of the binary that this is compiled into.
[[nodiscard]] inline AbiStamp abi_stamp() noexcept {
  AbiStamp stamp{};
#if defined(__clang__) || defined(__GNUC__)
  // g++ and clang++ share the Itanium ABI; __GXX_ABI_VERSION tells its revision.
  const char digits[] = {'0' + __GXX_ABI_VERSION / 1000 % 10, '0' + __GXX_ABI_VERSION / 100 % 10,
                         '0' + __GXX_ABI_VERSION / 10 % 10, '0' + __GXX_ABI_VERSION % 10, '\0'};
  std::strcpy(stamp.compiler_abi, "itanium-");
  std::strcat(stamp.compiler_abi, digits);
#endif
  stamp.libstdcxx_cxx11_abi = _GLIBCXX_USE_CXX11_ABI;
#if defined(_GLIBCXX_DEBUG)
  stamp.library_options |= kGlibcxxDebug;
#endif
#if defined(EIGEN_DEFAULT_TO_ROW_MAJOR)
  stamp.library_options |= kEigenRowMajor;
#endif
  if (!std::is_same_v<Eigen::Index, std::ptrdiff_t>) stamp.library_options |= kEigenOtherIndex;
  stamp.cplusplus = __cplusplus;
  stamp.eigen_version =
      EIGEN_WORLD_VERSION * 10000 + EIGEN_MAJOR_VERSION * 100 + EIGEN_MINOR_VERSION;
  stamp.eigen_max_align_bytes = EIGEN_MAX_ALIGN_BYTES;
  std::strcpy(stamp.sanitizers, detail::kSanitizer);
  return stamp;
}

namespace detail {

template <class... Views>
inline constexpr const char* kViewNames[] = {Views::kViewName..., nullptr};

template <class Interface, class Options,
          Result<std::unique_ptr<Interface>> (*kCreate)(const Options&, const HostContext&)>
struct PluginGlue {
  static void check(const Node& parameters, std::vector<Error>& errors) {
    Options options;
    const std::size_t before = errors.size();
    Options::parameters().read(parameters, options, errors);
    if (errors.size() > before) return;
    // Asked of what is not const, so that a check() that forgot to be const is an error.
    if constexpr (requires(Options & own) { own.check(); }) {
      report_mistakes(parameters, std::as_const(options).check(), errors);
    }
  }
  static void* create(const Node& parameters, const HostContext& context, Error* error) {
    Options options;
    std::vector<Error> errors;
    Options::parameters().read(parameters, options, errors);
    if (!errors.empty()) {
      *error = std::move(errors.front());
      return nullptr;
    }
    auto created = kCreate(options, context);
    if (!created) {
      *error = std::move(created.error());
      return nullptr;
    }
    return created->release();
  }
  static void destroy(void* object) { delete static_cast<Interface*>(object); }
};

}  // namespace detail
}  // namespace sidestep

/// Exports a plugin, the only one of its library (for several see SIDESTEP_PLUGINS). INTERFACE:
/// Source, Mapper, FieldBuilder, RobotModel, Optimiser, Executor, StateCost, Predictor, Gaze or
/// Localiser (for experiments see SIDESTEP_EXPERIMENT). OPTIONS: a struct with `static
/// Parameters<OPTIONS> parameters()` and, where its parameters must fit together,
/// `std::vector<OptionMistake> check() const`. CREATE: a function
/// Result<std::unique_ptr<INTERFACE>>(const OPTIONS&, const HostContext&), which is given only
/// options that check() finds nothing wrong with. What follows DOC are the views (types as in
/// mapping/occupancy_view.hpp) that a mapper offers or a field needs: the host tells before a run
/// whether the two fit.
#define SIDESTEP_PLUGIN(...)                                                           \
  namespace {                                                                          \
  SIDESTEP_DESCRIPTOR(sidestep_descriptor, __VA_ARGS__)                                \
  }                                                                                    \
  extern "C" SIDESTEP_EXPORT __attribute__((weak)) const ::sidestep::PluginDescriptor* \
  sidestep_plugin() {                                                                  \
    return sidestep_descriptor(nullptr);                                               \
  }

/// Describes one of several plugins of a library, as SIDESTEP_PLUGIN does: the function FUNCTION, a
/// sidestep::DescriptorFunction.
#define SIDESTEP_DESCRIPTOR(FUNCTION, INTERFACE, OPTIONS, CREATE, NAME, VERSION, DOC, ...) \
  const ::sidestep::PluginDescriptor* FUNCTION(const ::sidestep::PluginDescriptor* next) { \
    using Glue = ::sidestep::detail::PluginGlue<INTERFACE, OPTIONS, CREATE>;               \
    using Traits = ::sidestep::PluginTraits<INTERFACE>;                                    \
    static const ::sidestep::Schema schema = OPTIONS::parameters().schema();               \
    static const ::sidestep::PluginDescriptor descriptor{                                  \
        sizeof(::sidestep::PluginDescriptor),                                              \
        ::sidestep::kPluginMagic,                                                          \
        ::sidestep::kSdkMajor,                                                             \
        ::sidestep::kSdkMinor,                                                             \
        Traits::kVersion,                                                                  \
        ::sidestep::abi_stamp(),                                                           \
        Traits::kKind,                                                                     \
        NAME,                                                                              \
        VERSION,                                                                           \
        DOC,                                                                               \
        ::sidestep::detail::kViewNames<__VA_ARGS__>,                                       \
        []() -> const ::sidestep::Schema& { return schema; },                              \
        &Glue::check,                                                                      \
        &Glue::create,                                                                     \
        &Glue::destroy,                                                                    \
        next};                                                                             \
    return &descriptor;                                                                    \
  }

/// Exports the plugins of a library whose descriptors these functions are, in whatever source
/// files.
#define SIDESTEP_PLUGINS(...)                                                        \
  ::sidestep::DescriptorFunction __VA_ARGS__;                                        \
  extern "C" SIDESTEP_EXPORT const ::sidestep::PluginDescriptor* sidestep_plugin() { \
    const ::sidestep::PluginDescriptor* first = nullptr;                             \
    for (::sidestep::DescriptorFunction* const plugin : {__VA_ARGS__}) {             \
      first = plugin(first);                                                         \
    }                                                                                \
    return first;                                                                    \
  }
