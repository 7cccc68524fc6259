#pragma once

#include <cstdint>
#include <filesystem>
#include <memory>
#include <string>
#include <string_view>
#include <vector>

#include <sidestep/core/log.hpp>
#include <sidestep/core/time.hpp>
#include <sidestep/core/worker_pool.hpp>
#include <sidestep/runtime/host.hpp>
#include <sidestep/runtime/yaml_document.hpp>

namespace sidestep {

class SteadyWallClock final : public Clock {
 public:
  [[nodiscard]] Stamp now() const noexcept override;
};

struct SdkVersion {
  std::uint16_t major, minor;
};

/// What a session begins with.
struct RunSettings {
  std::uint64_t seed = 0;
  int threads = 0;                                  ///< 0 for one per core.
  std::vector<std::filesystem::path> plugin_paths;  ///< The first of the search path.
};

/// A host of the installation's plugins, robots and scenes, and what it lends to them. [main]
class Session {
 public:
  /// `log` outlives the session; null: warnings and errors go to stderr. `headers` is what the
  /// program was built with: throws std::runtime_error where that does not fit the library.
  explicit Session(const RunSettings& settings = {}, Log* log = nullptr,
                   SdkVersion headers = {kSdkMajor, kSdkMinor});

  /// Host::create() of a block as YAML, e.g. "{plugin: edt, max_distance_m: 0.8}".
  template <class Interface>
  [[nodiscard]] Result<PluginPtr<Interface>> create(
      std::string_view yaml, const std::shared_ptr<const RobotModel>& robot = nullptr) {
    std::vector<Error> errors;
    auto block = SIDESTEP_TRY(parse_yaml(yaml, std::string(yaml), errors));
    if (!errors.empty()) return tl::make_unexpected(std::move(errors.front()));
    return host_.create<Interface>(block, robot);
  }

  [[nodiscard]] Host& host() noexcept { return host_; }
  [[nodiscard]] const DocumentReader& documents() const noexcept { return documents_; }

 private:
  SteadyWallClock clock_;
  WorkerPool workers_;
  YamlDocumentReader documents_;
  Host host_;
};

}  // namespace sidestep
