#include <map>

#include "pair_statistics.hpp"
#include "robot_testing.hpp"
#include "sphere_cover.hpp"

namespace sidestep {
namespace {

using testing_robot::Loader;

/// What docs/reference/robot_profiles.md says of a profile.
struct Stated {
  std::size_t spheres;
  double protrusion_m;
  double volume_ratio;
};

const std::map<std::string, Stated> kStated = {
    {"fetch", {102, 0.101, 1.75}},       {"hsr", {110, 0.091, 1.69}},
    {"mobile_panda", {83, 0.070, 1.56}}, {"panda", {62, 0.049, 1.6}},
    {"planar", {1, 1e-9, 1.001}},        {"ur5e", {31, 0.055, 1.55}},
};

std::vector<std::string> profiles() {
  std::vector<std::string> names;
  for (const auto& entry : std::filesystem::directory_iterator(SIDESTEP_SOURCE_DIR "/robots")) {
    if (entry.is_directory()) names.push_back(entry.path().filename().string());
  }
  std::ranges::sort(names);
  return names;
}

class EveryProfile : public ::testing::TestWithParam<std::string> {
 protected:
  void SetUp() override {
    robot_ = loader_.load_or_fail("{profile: " + GetParam() + "}");
    ASSERT_NE(robot_, nullptr);
  }
  Loader loader_;
  std::unique_ptr<KinematicTree> robot_;
};

// A motion whose spheres are clear is then clear by its shapes, too.
TEST_P(EveryProfile, CoversItsShapesAsCloselyAsStated) {
  ASSERT_TRUE(kStated.contains(GetParam())) << "say above how closely it does";
  const Stated& stated = kStated.at(GetParam());
  const auto report = testing_robot::measure_cover(*robot_);
  EXPECT_EQ(robot_->description().spheres.size(), stated.spheres);
  EXPECT_LE(report.deepest_gap_m, 1e-9) << "on " << report.gap_link;
  EXPECT_LE(report.protrusion_m, stated.protrusion_m) << "on " << report.protrusion_link;
  EXPECT_LE(report.volume_ratio, stated.volume_ratio);
  std::cout << "spheres " << robot_->description().spheres.size() << ", largest protrusion "
            << report.protrusion_m << " m (" << report.protrusion_link << "), volume x "
            << report.volume_ratio << "\n";
}

TEST_P(EveryProfile, HasPosesFreeOfSelfCollision) {
  const RobotDescription& robot = robot_->description();
  ASSERT_FALSE(robot.poses.empty());
  for (const NamedPose& pose : robot.poses) {
    const auto q = testing_robot::pose_of(robot, pose.name);
    std::string where;
    EXPECT_GT(testing_robot::self_clearance_m(*robot_, q, &where), 0.01)
        << pose.name << " between " << where;
    for (const auto& pair : touching_pairs(*robot_, q)) {
      EXPECT_EQ(std::ranges::count(robot.self_collision_pairs, pair), 0)
          << pose.name << ": " << robot.links[static_cast<std::size_t>(pair.first)].name << " - "
          << robot.links[static_cast<std::size_t>(pair.second)].name;
    }
    for (std::size_t j = 0; j < q.size(); ++j) {
      EXPECT_GE(q[j], robot.joints[j].lower) << pose.name << ", " << robot.joints[j].name;
      EXPECT_LE(q[j], robot.joints[j].upper) << pose.name << ", " << robot.joints[j].name;
    }
  }
}

INSTANTIATE_TEST_SUITE_P(Robots, EveryProfile, ::testing::ValuesIn(profiles()),
                         [](const auto& test) { return test.param; });

}  // namespace
}  // namespace sidestep
