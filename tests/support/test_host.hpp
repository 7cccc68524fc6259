#pragma once

#include <filesystem>
#include <memory>
#include <string_view>
#include <utility>
#include <vector>

#include <sidestep/plugin/context.hpp>

namespace sidestep::testing_support {

/// What a host lends to plugins, for tests: keeps the log, tells time 0, knows no documents.
class TestHost {
 public:
  explicit TestHost(int threads = 1, std::shared_ptr<const RobotModel> robot = nullptr)
      : workers_(threads), robot_(std::move(robot)) {}

  [[nodiscard]] HostContext context() {
    return {log_, clock_, workers_, documents_, 0, {}, {}, robot_};
  }
  [[nodiscard]] WorkerPool& workers() noexcept { return workers_; }

 private:
  class SilentLog final : public Log {
    void write(LogLevel, std::string_view) override {}
  };
  class ZeroClock final : public Clock {
    [[nodiscard]] Stamp now() const noexcept override { return {}; }
  };
  class NoDocuments final : public DocumentReader {
    [[nodiscard]] Result<Node> read_leniently(const std::filesystem::path& file,
                                              std::vector<Error>&) const override {
      return fail(ErrorCode::kNotFound, "there are no documents here", file.string());
    }
  };

  SilentLog log_;
  ZeroClock clock_;
  NoDocuments documents_;
  WorkerPool workers_;
  std::shared_ptr<const RobotModel> robot_;
};

}  // namespace sidestep::testing_support
