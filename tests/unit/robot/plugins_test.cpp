#include <limits>

#include <sidestep/runtime/host.hpp>

#include "conformance/robot_conformance.hpp"
#include "robot_testing.hpp"

namespace sidestep {
namespace {

using testing_robot::Loader;

/// Robots as a run gets them: from the built plugins, through the host.
class RobotPlugins : public ::testing::Test {
 protected:
  Result<PluginPtr<RobotModel>> create(const std::string& yaml) {
    std::vector<Error> errors;
    const auto block = parse_yaml(yaml, "config.yaml", errors);
    if (!block) return tl::make_unexpected(block.error());
    host_.check(PluginKind::kRobot, *block, errors);
    if (!errors.empty()) return tl::make_unexpected(errors.front());
    return host_.create<RobotModel>(*block);
  }

  Loader loader_;
  Host host_{{{install_layout().plugins}, {SIDESTEP_SOURCE_DIR "/robots"}, {}, 0},
             loader_.context.log,
             loader_.context.clock,
             loader_.context.workers,
             loader_.context.documents};
};

TEST_F(RobotPlugins, EveryProfileConforms) {
  int found = 0;
  for (const auto& entry : std::filesystem::directory_iterator(SIDESTEP_SOURCE_DIR "/robots")) {
    if (!entry.is_directory()) continue;
    const std::string name = entry.path().filename().string();
    SCOPED_TRACE(name);
    const auto robot = create("{plugin: urdf, profile: " + name + "}");
    ASSERT_TRUE(robot) << robot.error().describe();
    EXPECT_EQ((*robot)->description().name, name);
    EXPECT_FALSE((*robot)->description().poses.empty());
    conformance::check_robot(**robot, 5);
    ++found;
  }
  EXPECT_GE(found, 3);
  EXPECT_EQ(loader_.host.log().count(LogLevel::kDebug), found) << "what each robot was read from";
  EXPECT_EQ(std::ssize(loader_.host.log().messages()), found);
}

TEST_F(RobotPlugins, PointIsABallInThePlane) {
  const auto robot = create("{plugin: point, radius_m: 0.4, height_m: 0.5, upper_m: [3, 4]}");
  ASSERT_TRUE(robot) << robot.error().describe();
  conformance::check_robot(**robot);
  const RobotDescription& point = (*robot)->description();
  EXPECT_EQ(point.joints[1].upper, 4.0);
  ASSERT_EQ(point.spheres.size(), 1u);
  EXPECT_EQ(point.spheres[0].radius_m, 0.4);
  std::vector<Eigen::Vector3d> centre(1);
  Scratch scratch;
  (*robot)->sphere_centres(std::vector<double>{1.0, -2.0}, centre, scratch);
  EXPECT_EQ(centre[0], Eigen::Vector3d(1.0, -2.0, 0.5));
}

TEST_F(RobotPlugins, PointBrakesAsHardAsItIsTold) {
  const auto robot = create("{plugin: point, max_acceleration_mps2: 0.5, max_braking_mps2: 2.0}");
  ASSERT_TRUE(robot) << robot.error().describe();
  EXPECT_EQ((*robot)->description().joints[0].max_acceleration, 0.5);
  EXPECT_EQ((*robot)->description().joints[0].braking(), 2.0);
  for (const char* wrong :
       {"max_braking_mps2: 2.0", "max_acceleration_mps2: 3.0, max_braking_mps2: 2.0",
        "max_acceleration_mps2: 3.0, max_braking_mps2: 0.0",
        "max_acceleration_mps2: 3.0, max_braking_mps2: .nan"}) {
    const auto refused = create("{plugin: point, " + std::string(wrong) + "}");
    ASSERT_FALSE(refused) << wrong;
    const std::string column =
        std::to_string(std::string("{plugin: point, ").size() + std::string(wrong).rfind(' ') + 2);
    EXPECT_NE(refused.error().describe().find("config.yaml:1:" + column + ": "), std::string::npos)
        << refused.error().describe();
  }
}

TEST_F(RobotPlugins, LimitsOfAConfigurationGoOverThoseOfTheBase) {
  const auto limited = [&](const std::string& limits) {
    return create("{plugin: urdf, profile: hsr, joint_limits: {" + limits + "}}");
  };
  const auto robot = limited("odom_x: {max_braking: 0.4}, odom_y: {upper: 3.0, max_velocity: 0.1}");
  ASSERT_TRUE(robot) << robot.error().describe();
  const std::vector<Joint>& joints = (*robot)->description().joints;
  EXPECT_EQ(joints[0].braking(), 0.4);
  EXPECT_EQ(joints[0].max_acceleration, 0.05);
  EXPECT_EQ(joints[0].max_velocity, 0.2);
  EXPECT_EQ(joints[1].upper, 3.0);
  EXPECT_EQ(joints[1].lower, -10.0);
  EXPECT_EQ(joints[1].max_velocity, 0.1);
  EXPECT_EQ(joints[1].braking(), 0.05);
  const auto turning = limited("odom_t: {lower: -1.0, upper: 1.0}");
  ASSERT_TRUE(turning) << turning.error().describe();
  EXPECT_EQ((*turning)->description().joints[2].type, Joint::Type::kRevolute);
  for (const auto& [wrong, says] :
       {std::pair{"odom_x: {max_braking: 0.01}", "below its 'max_acceleration', 0.05"},
        std::pair{"odom_t: {max_braking: 2.0}", "stands without 'max_acceleration'"},
        std::pair{"odom_x: {lower: 3.0, upper: 2.0}", "its lower limit above its upper one"},
        std::pair{"odom_z: {upper: 1.0}", "no moving joint 'odom_z'"}}) {
    const auto refused = limited(wrong);
    ASSERT_FALSE(refused) << wrong;
    EXPECT_NE(refused.error().describe().find(says), std::string::npos)
        << refused.error().describe();
  }
}

TEST_F(RobotPlugins, PointAndPlanarProfileAreTheSameRobot) {
  const auto point = create("{plugin: point}");
  const auto planar = create("{plugin: urdf, profile: planar}");
  ASSERT_TRUE(point && planar);
  const auto q = conformance::random_configurations((*point)->description(), 10, 3);
  std::vector<Eigen::Vector3d> a(10), b(10);
  Scratch scratch;
  (*point)->sphere_centres(q, a, scratch);
  (*planar)->sphere_centres(q, b, scratch);
  for (std::size_t i = 0; i < a.size(); ++i) EXPECT_LT((a[i] - b[i]).norm(), 1e-15);
  EXPECT_EQ((*point)->description().spheres[0].radius_m,
            (*planar)->description().spheres[0].radius_m);
}

TEST_F(RobotPlugins, BadParametersAreConfigurationErrors) {
  for (const char* block :
       {"{plugin: point, lower_m: [1, 2, 3]}", "{plugin: point, lower_m: [11, 0]}",
        "{plugin: point, radius_m: -1}", "{plugin: point, radius: 1}",
        "{plugin: urdf, profile: hsr, base: sideways}", "{plugin: urdf}",
        "{plugin: urdf, profile: [hsr]}",
        "{plugin: urdf, profile: hsr, fixed_joints: {head: 0}}"}) {
    const auto robot = create(block);
    ASSERT_FALSE(robot) << block;
    EXPECT_EQ(robot.error().code, ErrorCode::kConfig) << robot.error().describe();
  }
}

}  // namespace
}  // namespace sidestep
