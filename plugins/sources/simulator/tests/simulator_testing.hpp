#pragma once

#include <string>
#include <vector>

#include <sidestep/core/worker_pool.hpp>
#include <sidestep/plugin/context.hpp>
#include <sidestep/runtime/yaml_document.hpp>

#include "../options.hpp"

namespace sidestep::simulator::testing {

/// A host of the smallest kind, whose scenes are the project's.
class TestHost {
 public:
  explicit TestHost(int threads) : workers_(threads) {}

  [[nodiscard]] HostContext context(std::uint64_t seed = 1) {
    return {log_, clock_, workers_, documents_, seed, {}, {scenes()}, nullptr};
  }
  static std::filesystem::path scenes() {
    return std::filesystem::path(SIDESTEP_SOURCE_DIR) / "configs" / "scenes";
  }

 private:
  struct NoLog final : Log {
    void write(LogLevel, std::string_view) override {}
  };
  struct StoppedClock final : Clock {
    [[nodiscard]] Stamp now() const noexcept override { return {}; }
  };
  NoLog log_;
  StoppedClock clock_;
  WorkerPool workers_;
  YamlDocumentReader documents_;
};

/// A camera that pans over the room from its south end.
inline Options room_options() {
  Options options;
  options.camera_path = {
      {0.0, {-0.6, -2.2, 1.2}, Eigen::Vector3d(0.9, 0.2, 0.7), {}},
      {2.0, {-0.6, -1.0, 1.2}, Eigen::Vector3d(-0.5, 2.0, 0.7), {}},
      {4.0, {-0.6, 1.0, 1.2}, Eigen::Vector3d(-2.0, 0.0, 0.4), {}},
  };
  return options;
}

}  // namespace sidestep::simulator::testing
