#pragma once

#include <string>
#include <string_view>
#include <vector>

#include <sidestep/core/worker_pool.hpp>
#include <sidestep/runtime/host.hpp>
#include <sidestep/runtime/yaml_document.hpp>

namespace sidestep::testing_support {

/// Keeps every message.
class RecordingLog final : public Log {
 public:
  void write(LogLevel, std::string_view message) override { messages.emplace_back(message); }
  std::vector<std::string> messages;
};

class ZeroClock final : public Clock {
 public:
  [[nodiscard]] Stamp now() const noexcept override { return {}; }
};

/// A host over the given search path, and what it needs to live.
struct HostFixture {
  explicit HostFixture(std::vector<std::filesystem::path> plugin_paths)
      : host({.plugin_paths = std::move(plugin_paths)}, log, clock, workers, documents) {}

  /// A block as a configuration would hold it.
  static Node block(std::string_view yaml) {
    std::vector<Error> errors;
    return parse_yaml(yaml, "test.yaml", errors).value();
  }

  RecordingLog log;
  ZeroClock clock;
  WorkerPool workers{2};
  YamlDocumentReader documents;
  Host host;
};

}  // namespace sidestep::testing_support
