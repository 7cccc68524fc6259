#pragma once

#include <fstream>
#include <string>
#include <vector>

#include <gtest/gtest.h>

#include <sidestep/plugin/plugin.hpp>
#include <sidestep/runtime/yaml_document.hpp>

#include "conformance/test_host.hpp"
#include "load_robot.hpp"

namespace sidestep::testing_robot {

/// A host that knows the project's robots, and the loading of one.
struct Loader {
  conformance::TestHost host{1,
                             {.robot_paths = {SIDESTEP_SOURCE_DIR "/robots"},
                              .documents = std::make_shared<YamlDocumentReader>()}};
  HostContext context = host.context();

  /// From a configuration's robot block.
  Result<std::unique_ptr<KinematicTree>> load(const std::string& yaml) {
    std::vector<Error> errors;
    const auto block = parse_yaml(yaml, "config.yaml", errors);
    if (!block) return tl::make_unexpected(block.error());
    const auto parameters = urdf_robot::Options::parameters();
    check_against_schema(*block, parameters.schema(), {}, errors);
    urdf_robot::Options options;
    if (errors.empty()) parameters.read(*block, options, errors);
    if (errors.empty()) report_mistakes(*block, options.check(), errors);
    if (!errors.empty()) return tl::make_unexpected(errors.front());
    return urdf_robot::load_robot(options, context);
  }

  std::unique_ptr<KinematicTree> load_or_fail(const std::string& yaml) {
    auto robot = load(yaml);
    if (robot) return std::move(*robot);
    ADD_FAILURE() << robot.error().describe();
    return nullptr;
  }
};

/// A fresh folder of this test.
inline std::filesystem::path test_folder() {
  const auto* test = ::testing::UnitTest::GetInstance()->current_test_info();
  std::filesystem::path folder = ::testing::TempDir();
  folder /= std::string("sidestep_robot_") + test->test_suite_name() + "_" + test->name();
  std::filesystem::remove_all(folder);
  std::filesystem::create_directories(folder);
  return folder;
}

inline std::string write_file(const std::filesystem::path& file, const std::string& text) {
  std::filesystem::create_directories(file.parent_path());
  std::ofstream(file) << text;
  return file.string();
}

/// All joints of a pose; those it leaves open at zero.
inline std::vector<double> pose_of(const RobotDescription& robot, const std::string& name) {
  std::vector<double> q(robot.joints.size(), 0.0);
  const NamedPose* pose = robot.find_pose(name);
  if (pose == nullptr) {
    ADD_FAILURE() << "no pose " << name;
    return q;
  }
  for (std::size_t j = 0; j < q.size(); ++j) q[j] = pose->positions[j].value_or(0.0);
  return q;
}

inline Transform link_pose(const RobotModel& model, const std::vector<double>& q,
                           const std::string& link) {
  std::vector<Transform> poses(model.description().links.size());
  Scratch scratch;
  model.link_poses(q, poses, scratch);
  return poses[static_cast<std::size_t>(model.description().link_index(link).value())];
}

}  // namespace sidestep::testing_robot
