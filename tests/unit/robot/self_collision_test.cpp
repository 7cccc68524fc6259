#include <nlohmann/json.hpp>

#include "pair_statistics.hpp"
#include "robot_testing.hpp"
#include "sphere_cover.hpp"

namespace sidestep {
namespace {

using testing_robot::Loader;

std::size_t at(int index) { return static_cast<std::size_t>(index); }

std::string names(const RobotDescription& robot, const std::vector<std::pair<int, int>>& pairs) {
  std::string text;
  for (const auto& [a, b] : pairs)
    text += robot.links[at(a)].name + " - " + robot.links[at(b)].name + "; ";
  return text;
}

std::vector<std::pair<int, int>> checked_and_touching(const KinematicTree& tree,
                                                      const std::vector<double>& q) {
  auto touching = touching_pairs(tree, q);
  std::erase_if(touching, [&](const auto& pair) {
    return std::ranges::find(tree.description().self_collision_pairs, pair) ==
           tree.description().self_collision_pairs.end();
  });
  return touching;
}

TEST(HsrSelfCollision, NamedPosesAreFree) {
  Loader loader;
  for (const char* tilt : {"-0.3", "0.0"}) {
    const auto robot = loader.load_or_fail(
        std::string("{profile: hsr, fixed_joints: {head_tilt_joint: ") + tilt + "}}");
    ASSERT_NE(robot, nullptr);
    for (const NamedPose& pose : robot->description().poses) {
      const auto q = testing_robot::pose_of(robot->description(), pose.name);
      std::string where;
      EXPECT_GT(testing_robot::self_clearance_m(*robot, q, &where), 0.01)
          << pose.name << " between " << where << " at tilt " << tilt;
    }
  }
}

// The robot's public test poses, within millimetres of a contact of its meshes. Shapes that enclose
// the robot touch in every pose in collision. Among those free of it only the head may touch: its
// dimensions are not public, so its shapes are larger.
TEST(HsrSelfCollision, AgreesWithThePublicTestPoses) {
  std::ifstream file(SIDESTEP_SHARED_FACTS "/hsr.json");
  if (!file) GTEST_SKIP() << "no " SIDESTEP_SHARED_FACTS;
  const auto table = nlohmann::json::parse(file)["self_collision_test_poses"];
  for (const auto& pose : table["poses"]) {
    std::map<std::string, double> position;
    for (std::size_t j = 0; j < table["joints"].size(); ++j)
      position[table["joints"][j]] = pose["position"][j];
    Loader loader;
    const double motor = std::clamp(position["hand_motor_joint"], -0.798, 1.24);
    const double tilt = std::clamp(position["head_tilt_joint"], -1.57, 0.52);
    const auto robot = loader.load_or_fail("{profile: hsr, fixed_joints: {head_pan_joint: " +
                                           std::to_string(position["head_pan_joint"]) +
                                           ", head_tilt_joint: " + std::to_string(tilt) +
                                           ", hand_motor_joint: " + std::to_string(motor) + "}}");
    ASSERT_NE(robot, nullptr);
    std::vector<double> q(8, 0.0);
    for (std::size_t j = 3; j < q.size(); ++j) q[j] = position[robot->description().joints[j].name];
    auto touching = checked_and_touching(*robot, q);
    const std::string name = pose["name"];
    if (pose["collision"].get<bool>()) {
      EXPECT_FALSE(touching.empty()) << name;
      continue;
    }
    std::erase_if(touching, [&](const auto& pair) {
      return robot->description().links[at(pair.first)].name.starts_with("head_");
    });
    EXPECT_TRUE(touching.empty()) << name << ": " << names(robot->description(), touching);
  }
}

}  // namespace
}  // namespace sidestep
