#pragma once

#include <filesystem>
#include <memory>

#include <sidestep/runtime/yaml_document.hpp>

#include "../simulator.hpp"
#include "conformance/test_host.hpp"

namespace sidestep::simulator::testing {

/// The folder of the project's scenes.
inline std::filesystem::path scenes() {
  return std::filesystem::path(SIDESTEP_SOURCE_DIR) / "configs" / "scenes";
}

/// What a host has that knows the project's scenes.
inline conformance::TestHostParts host_parts() {
  return {.scene_paths = {scenes()}, .documents = std::make_shared<YamlDocumentReader>()};
}

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
