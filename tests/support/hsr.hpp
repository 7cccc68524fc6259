#pragma once

#include <memory>
#include <stdexcept>
#include <string>
#include <utility>

#include <sidestep/runtime/yaml_document.hpp>

#include "conformance/test_host.hpp"
#include "load_robot.hpp"

namespace sidestep::testing_support {

/// A robot of robots/. Link sidestep_urdf and Sidestep::runtime.
[[nodiscard]] inline std::shared_ptr<const RobotModel> load_profile(const std::string& name) {
  conformance::TestHost host(1, {.robot_paths = {SIDESTEP_SOURCE_DIR "/robots"},
                                 .documents = std::make_shared<YamlDocumentReader>()});
  urdf_robot::Options options;
  options.profile = Node(Node::Scalar{name, false}, {});
  auto robot = urdf_robot::load_robot(options, host.context());
  if (!robot) throw std::runtime_error(robot.error().describe());
  return std::move(*robot);
}

[[nodiscard]] inline std::shared_ptr<const RobotModel> load_hsr() { return load_profile("hsr"); }

}  // namespace sidestep::testing_support
