#pragma once

#include <memory>
#include <stdexcept>
#include <utility>

#include <sidestep/runtime/yaml_document.hpp>

#include "conformance/test_host.hpp"
#include "load_robot.hpp"

namespace sidestep::testing_support {

/// The HSR of robots/hsr. Link sidestep_urdf and Sidestep::runtime.
[[nodiscard]] inline std::shared_ptr<const RobotModel> load_hsr() {
  conformance::TestHost host(1, {.robot_paths = {SIDESTEP_SOURCE_DIR "/robots"},
                                 .documents = std::make_shared<YamlDocumentReader>()});
  urdf_robot::Options options;
  options.profile = Node(Node::Scalar{"hsr", false}, {});
  auto robot = urdf_robot::load_robot(options, host.context());
  if (!robot) throw std::runtime_error(robot.error().describe());
  return std::move(*robot);
}

}  // namespace sidestep::testing_support
