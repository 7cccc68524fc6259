#pragma once

#include <string_view>
#include <vector>

#include <sidestep/core/worker_pool.hpp>
#include <sidestep/runtime/host.hpp>
#include <sidestep/runtime/yaml_document.hpp>

#include "conformance/test_host.hpp"

namespace sidestep::testing_support {

/// A host over the given search path, and what it needs to live.
struct HostFixture {
  explicit HostFixture(std::vector<std::filesystem::path> plugin_paths)
      : host({.plugin_paths = std::move(plugin_paths)}, log, clock, workers, documents) {}

  /// A block as a configuration would hold it.
  static Node block(std::string_view yaml) {
    std::vector<Error> errors;
    return parse_yaml(yaml, "test.yaml", errors).value();
  }

  conformance::RecordingLog log;
  conformance::StoppedClock clock;
  WorkerPool workers{2};
  YamlDocumentReader documents;
  Host host;
};

}  // namespace sidestep::testing_support
