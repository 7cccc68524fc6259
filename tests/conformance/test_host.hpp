#pragma once

#include <cstdint>
#include <filesystem>
#include <memory>
#include <mutex>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include <sidestep/plugin/context.hpp>

namespace sidestep::conformance {

/// Keeps every message. [any] thread.
class RecordingLog final : public Log {
 public:
  void write(LogLevel level, std::string_view message) override {
    const std::lock_guard lock(mutex_);
    entries_.emplace_back(level, message);
  }
  [[nodiscard]] std::vector<std::string> messages() const {
    const std::lock_guard lock(mutex_);
    std::vector<std::string> all;
    for (const auto& [level, message] : entries_) all.push_back(message);
    return all;
  }
  [[nodiscard]] int count(LogLevel level) const {
    const std::lock_guard lock(mutex_);
    int n = 0;
    for (const auto& [its, message] : entries_) n += its == level ? 1 : 0;
    return n;
  }

 private:
  mutable std::mutex mutex_;
  std::vector<std::pair<LogLevel, std::string>> entries_;
};

/// Stands at 0.
class StoppedClock final : public Clock {
 public:
  [[nodiscard]] Stamp now() const noexcept override { return {}; }
};

/// Every file is one that is not there.
class NoDocuments final : public DocumentReader {
 public:
  [[nodiscard]] Result<Node> read_leniently(const std::filesystem::path& file,
                                            std::vector<Error>&) const override {
    return fail(ErrorCode::kNotFound, "there are no documents here", file.string());
  }
};

/// What a test's host has beside threads.
struct TestHostParts {
  std::shared_ptr<const RobotModel> robot;
  std::vector<std::filesystem::path> robot_paths;
  std::vector<std::filesystem::path> scene_paths;
  /// With Sidestep::runtime a YamlDocumentReader reads files.
  std::shared_ptr<const DocumentReader> documents = std::make_shared<NoDocuments>();
  const Clock* clock = nullptr;         ///< Null: one that stands at 0.
  std::shared_ptr<RobotMotion> motion;  ///< Null: no robot moves.
};

/// What a host lends to plugins, for tests that create them without loading a library. Outlives
/// the objects that are created with its contexts.
class TestHost {
 public:
  explicit TestHost(int threads = 1, TestHostParts parts = {})
      : workers_(threads), parts_(std::move(parts)) {}

  [[nodiscard]] HostContext context(std::uint64_t seed = 0) { return context(workers_, seed); }
  /// The same with threads of the caller's, as the suites of this folder lend them.
  [[nodiscard]] HostContext context(WorkerPool& workers, std::uint64_t seed = 0) {
    return {log_,
            parts_.clock != nullptr ? *parts_.clock : clock_,
            workers,
            *parts_.documents,
            seed,
            parts_.robot_paths,
            parts_.scene_paths,
            parts_.robot,
            parts_.motion};
  }
  [[nodiscard]] RecordingLog& log() noexcept { return log_; }
  [[nodiscard]] WorkerPool& workers() noexcept { return workers_; }

 private:
  RecordingLog log_;
  StoppedClock clock_;
  WorkerPool workers_;
  TestHostParts parts_;
};

}  // namespace sidestep::conformance
