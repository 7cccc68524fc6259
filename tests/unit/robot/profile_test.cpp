#include "pair_statistics.hpp"
#include "robot_testing.hpp"

namespace sidestep {
namespace {

using testing_robot::Loader;
using testing_robot::test_folder;
using testing_robot::write_file;

const char* const kUrdf = R"(<robot name="arm">
<link name="base"/><link name="upper"/><link name="lower"/><link name="finger"/><link name="thumb"/>
<joint name="shoulder" type="revolute"><parent link="base"/><child link="upper"/><axis xyz="0 0 1"/>
  <limit lower="-1" upper="1" velocity="2" effort="3"/></joint>
<joint name="elbow" type="revolute"><parent link="upper"/><child link="lower"/><axis xyz="0 1 0"/>
  <origin xyz="1 0 0"/><limit lower="-2" upper="2" velocity="2" effort="3"/></joint>
<joint name="grip" type="prismatic"><parent link="lower"/><child link="finger"/><axis xyz="1 0 0"/>
  <limit lower="0" upper="0.1" velocity="2" effort="3"/></joint>
<joint name="grip_too" type="prismatic"><parent link="lower"/><child link="thumb"/><axis xyz="1 0 0"/>
  <limit lower="0" upper="0.1" velocity="2" effort="3"/><mimic joint="grip"/></joint>
</robot>
)";

const char* const kGood = R"(name: arm
urdf: arm.urdf
joints: [elbow, shoulder]
joint_limits:
  elbow: {lower: -0.5, max_acceleration: 4.0}
fixed_joints: {grip: 0.05}
shapes_from: spheres
spheres:
  - {link: lower, centre_m: [0.1, 0, 0], radius_m: 0.1}
  - {link: base, centre_m: [0, 0, 0], radius_m: 0.2}
self_collision:
  pairs: [[lower, base]]
poses:
  bent: {elbow: 1.0}
  all: [0.1, 0.2]
)";

class ProfileFile : public ::testing::Test {
 protected:
  void SetUp() override {
    folder_ = test_folder();
    write_file(folder_ / "arm/arm.urdf", kUrdf);
  }
  Result<std::unique_ptr<KinematicTree>> load(const std::string& profile) {
    write_file(folder_ / "arm/profile.yaml", profile);
    return loader_.load("{profile: " + (folder_ / "arm/profile.yaml").string() + "}");
  }
  std::filesystem::path folder_;
  Loader loader_;
};

TEST_F(ProfileFile, SaysWhatTheRobotIs) {
  const auto robot = load(kGood);
  ASSERT_TRUE(robot) << robot.error().describe();
  const RobotDescription& arm = (*robot)->description();
  EXPECT_EQ(arm.joints[0].name, "elbow");
  EXPECT_EQ(arm.joints[0].lower, -0.5);
  EXPECT_EQ(arm.joints[0].upper, 2.0);
  EXPECT_EQ(arm.joints[0].max_acceleration, 4.0);
  EXPECT_TRUE(std::isinf(arm.joints[1].max_acceleration));
  EXPECT_EQ(arm.self_collision_pairs,
            (std::vector<std::pair<int, int>>{
                {arm.link_index("base").value(), arm.link_index("lower").value()}}));
  ASSERT_EQ(arm.shapes.size(), arm.spheres.size());
  for (std::size_t i = 0; i < arm.shapes.size(); ++i) {
    EXPECT_EQ(arm.shapes[i].link, arm.spheres[i].link);
    EXPECT_EQ(std::get<Sphere>(arm.shapes[i].shape).radius_m, arm.spheres[i].radius_m);
    EXPECT_EQ(arm.shapes[i].T_link_shape.translation(), arm.spheres[i].centre_link_m);
  }
  EXPECT_EQ(arm.find_pose("bent")->positions[0], 1.0);
  EXPECT_FALSE(arm.find_pose("bent")->positions[1]);
  EXPECT_EQ(arm.find_pose("all")->positions[1], 0.2);
  const Transform thumb = testing_robot::link_pose(**robot, {0.0, 0.0}, "thumb");
  EXPECT_NEAR(thumb.translation().x(), 1.05, 1e-15);
}

TEST_F(ProfileFile, IsFoundByNameFolderOrFile) {
  write_file(folder_ / "arm/profile.yaml", kGood);
  loader_.context.robot_paths = {"/nowhere", folder_};
  EXPECT_TRUE(loader_.load("{profile: arm}"));
  EXPECT_TRUE(loader_.load("{profile: " + (folder_ / "arm").string() + "}"));
  const auto wrong = loader_.load("{profile: arms}");
  ASSERT_FALSE(wrong);
  EXPECT_EQ(wrong.error().code, ErrorCode::kNotFound);
  const std::string text = wrong.error().describe();
  EXPECT_NE(text.find("config.yaml:1:11: there is no robot profile 'arms'"), std::string::npos)
      << text;
  EXPECT_NE(text.find("did you mean 'arm'?"), std::string::npos) << text;
}

TEST_F(ProfileFile, SaysHowHardTheRobotBrakes) {
  const auto robot = load(R"(name: arm
urdf: arm.urdf
joints: [elbow, shoulder]
base: {type: holonomic, max_acceleration_mps2: 0.5, max_braking_mps2: 2.0, max_turn_acceleration_radps2: 1.0}
joint_limits:
  elbow: {max_acceleration: 4.0, max_braking: 4.0}
shapes_from: spheres
spheres: [{link: lower, centre_m: [0, 0, 0], radius_m: 0.1}]
self_collision: {pairs: []}
)");
  ASSERT_TRUE(robot) << robot.error().describe();
  const std::vector<Joint>& joints = (*robot)->description().joints;
  for (const std::size_t j : {0u, 1u}) {
    EXPECT_EQ(joints[j].max_acceleration, 0.5);
    EXPECT_EQ(joints[j].braking(), 2.0);
  }
  EXPECT_FALSE(joints[2].max_braking);
  EXPECT_EQ(joints[2].braking(), 1.0);
  EXPECT_EQ(joints[3].braking(), 4.0);
  EXPECT_FALSE(joints[4].max_braking);
  EXPECT_TRUE(std::isinf(joints[4].braking()));
}

TEST_F(ProfileFile, TellsWhichBrakingMakesNoSense) {
  const auto robot = load(R"(name: arm
urdf: arm.urdf
joints: [elbow, shoulder]
base:
  type: holonomic
  max_acceleration_mps2: 1.0
  max_braking_mps2: 0.5
  max_turn_braking_radps2: 3.0
joint_limits:
  elbow: {max_acceleration: 4.0, max_braking: 3.9}
  shoulder: {max_braking: 5.0}
)");
  ASSERT_FALSE(robot);
  const std::string text = robot.error().describe();
  for (const char* part :
       {"profile.yaml:7:21: 'max_braking_mps2' is 0.5, below 'max_acceleration_mps2', 1.0",
        "profile.yaml:8:28: 'max_turn_braking_radps2' stands without "
        "'max_turn_acceleration_radps2'",
        "profile.yaml:10:47: 'max_braking' is 3.9, below 'max_acceleration', 4.0",
        "profile.yaml:11:27: 'max_braking' stands without 'max_acceleration'"}) {
    EXPECT_NE(text.find(part), std::string::npos) << "no '" << part << "' in:\n" << text;
  }
  for (const char* value : {"0.0", "-1.0", ".nan", ".inf", "fast", "[1, 2]"}) {
    const auto wrong = load(
        "name: arm\nurdf: arm.urdf\njoints: [elbow, shoulder]\n"
        "base:\n  type: holonomic\n  max_acceleration_mps2: 1.0\n"
        "  max_braking_mps2: " +
        std::string(value) +
        "\njoint_limits:\n"
        "  elbow: {max_acceleration: 4.0, max_braking: " +
        value + "}\n");
    ASSERT_FALSE(wrong) << value;
    const std::string why = wrong.error().describe();
    EXPECT_NE(why.find("profile.yaml:7:21: "), std::string::npos) << why;
    EXPECT_NE(why.find("profile.yaml:9:47: "), std::string::npos) << why;
  }
}

/// Poses of links in a configuration are those of the whole robot, with what is held where it is.
TEST_F(ProfileFile, PlansAGroupAndHoldsTheOtherJoints) {
  const auto whole = loader_.load("{profile: hsr}");
  const auto arm = loader_.load(
      "{profile: hsr, group: arm, fixed_joints: {odom_x: 0.7, odom_y: -0.4, odom_t: 1.1}}");
  const auto base = loader_.load("{profile: hsr, group: base, held: reach_table}");
  ASSERT_TRUE(whole) << whole.error().describe();
  ASSERT_TRUE(arm) << arm.error().describe();
  ASSERT_TRUE(base) << base.error().describe();
  EXPECT_EQ((*arm)->description().dof(), 5);
  EXPECT_EQ((*arm)->description().joints[0].name, "arm_lift_joint");
  EXPECT_EQ((*base)->description().dof(), 3);
  EXPECT_TRUE((*base)->description().planar_base());
  EXPECT_EQ((*arm)->description().spheres.size(), (*whole)->description().spheres.size());
  const auto hand = [](const KinematicTree& robot, const std::vector<double>& q) {
    return testing_robot::link_pose(robot, q, "hand_palm_link");
  };
  EXPECT_TRUE(hand(**arm, {0.2, -0.5, 0.3, -0.8, 0.1})
                  .isApprox(hand(**whole, {0.7, -0.4, 1.1, 0.2, -0.5, 0.3, -0.8, 0.1}), 1e-12));
  EXPECT_TRUE(hand(**base, {0.7, -0.4, 1.1})
                  .isApprox(hand(**whole, {0.7, -0.4, 1.1, 0.34, -0.9, 0.0, -0.67, 0.0}), 1e-12));
  const NamedPose* go = (*arm)->description().find_pose("go");
  ASSERT_NE(go, nullptr);
  EXPECT_EQ(go->positions[2], -1.57);
}

/// A pose that lists positions lists them of all joints of the profile.
TEST_F(ProfileFile, TakesFromAPosesListWhatTheGroupHas) {
  write_file(folder_ / "arm/profile.yaml", std::string(kGood) + "groups: {last: [shoulder]}\n");
  const std::string profile = "profile: " + (folder_ / "arm/profile.yaml").string();
  const auto robot = loader_.load("{" + profile + ", group: last, held: all}");
  ASSERT_TRUE(robot) << robot.error().describe();
  const RobotDescription& is = (*robot)->description();
  ASSERT_EQ(is.dof(), 1);
  EXPECT_EQ(is.find_pose("all")->positions[0], 0.2);
  // The elbow, about y, is held at 0.1.
  const Transform lower = testing_robot::link_pose(**robot, {0.0}, "lower");
  EXPECT_NEAR(lower.linear()(0, 0), std::cos(0.1), 1e-12);
}

TEST_F(ProfileFile, SaysWhatIsWrongWithAGroup) {
  write_file(folder_ / "arm/profile.yaml", std::string(kGood) + "groups: {last: [shoulder]}\n");
  const std::string arm = "profile: " + (folder_ / "arm/profile.yaml").string();
  for (const auto& [options, expected] : std::vector<std::pair<std::string, std::string>>{
           {arm + ", group: lats", "has no group 'lats' (did you mean 'last'?)"},
           {arm + ", group: last, held: bend", "has no pose 'bend' (did you mean 'bent'?)"},
           {arm + ", held: bent", "stands without 'group'"},
           {"profile: hsr, group: arm, fixed_joints: {odom_x: 11}",
            "'odom_x' would be fixed outside of its limits"},
           {"profile: hsr, group: base, fixed_joints: {odom_x: 1}",
            "'odom_x' is both planned and fixed"},
           {"profile: hsr, group: arm, fixed_joints: {arm_lift_joint: 0.1}",
            "'arm_lift_joint' is both planned and fixed"}}) {
    const auto robot = loader_.load("{" + options + "}");
    ASSERT_FALSE(robot) << options;
    EXPECT_NE(robot.error().describe().find(expected), std::string::npos)
        << robot.error().describe();
  }
}

/// Whether or not one of them is planned.
TEST_F(ProfileFile, SaysWhatIsWrongWithItsGroups) {
  for (const auto& [groups, expected] : std::vector<std::pair<std::string, std::string>>{
           {"3", "'groups' is a map from names to lists of joints"},
           {"{odd: [sholder]}", "the robot plans no joint 'sholder' (did you mean 'shoulder'?)"},
           {"{odd: [grip]}", "the robot plans no joint 'grip'"},
           {"{odd: [elbow, elbow]}", "joint 'elbow' is in the group twice"},
           {"{odd: []}", "a group is a list of joints"},
           {"{odd: elbow}", "a group is a list of joints"}}) {
    const auto robot = load(std::string(kGood) + "groups: " + groups + "\n");
    ASSERT_FALSE(robot) << groups;
    EXPECT_NE(robot.error().describe().find(expected), std::string::npos)
        << robot.error().describe();
  }
}

/// A pose is checked as a whole, whatever of it is planned; it is none of a robot that holds a
/// joint elsewhere.
TEST_F(ProfileFile, HoldsWhatItsPosesMaySay) {
  const std::string more = "groups: {last: [shoulder]}\n";
  const auto options = [&] {
    return "{profile: " + (folder_ / "arm/profile.yaml").string() + ", group: last, held: bent}";
  };
  for (const std::string elbow : {"9.0", "abc"}) {
    std::string bad = kGood + more;
    bad.replace(bad.find("elbow: 1.0"), 10, "elbow: " + elbow);
    write_file(folder_ / "arm/profile.yaml", bad);
    EXPECT_FALSE(loader_.load(options())) << elbow;
  }
  write_file(folder_ / "arm/profile.yaml", kGood + more);
  const auto robot = loader_.load(options());
  ASSERT_TRUE(robot) << robot.error().describe();
  EXPECT_NE((*robot)->description().find_pose("bent"), nullptr);
  EXPECT_EQ((*robot)->description().find_pose("all"), nullptr);  // its elbow is at 0.1
}

TEST_F(ProfileFile, CouplesJointsThatTheUrdfDoesNot) {
  const std::string free =
      "name: arm\nurdf: arm.urdf\nshapes_from: spheres\nspheres: "
      "[{link: lower, centre_m: [0, 0, 0], radius_m: 0.1}]\n";
  const auto robot = load(free +
                          "coupled_joints: {elbow: {joint: shoulder, multiplier: -2, "
                          "offset: 0.1}}\n");
  ASSERT_TRUE(robot) << robot.error().describe();
  ASSERT_EQ((*robot)->description().dof(), 2);
  EXPECT_EQ((*robot)->description().joints[1].name, "grip");
  // About z by 0.3, then about y by 0.1 - 0.6.
  const Eigen::Matrix3d expected = (Eigen::AngleAxisd(0.3, Eigen::Vector3d::UnitZ()) *
                                    Eigen::AngleAxisd(-0.5, Eigen::Vector3d::UnitY()))
                                       .toRotationMatrix();
  EXPECT_TRUE(testing_robot::link_pose(**robot, {0.3, 0.0}, "lower").linear().isApprox(expected));
  for (const auto& [coupling, expected_text] : std::vector<std::pair<std::string, std::string>>{
           {"{elbow: {joint: sholder}}", "no moving joint 'sholder' (did you mean 'shoulder'?)"},
           {"{elbw: {joint: shoulder}}", "no moving joint 'elbw' (did you mean 'elbow'?)"},
           {"{grip: {joint: grip_too}}", "joint 'grip' would follow itself"},
           {"{elbow: {joint: elbow}}", "joint 'elbow' would follow itself"}}) {
    const auto refused = load(free + "coupled_joints: " + coupling + "\n");
    ASSERT_FALSE(refused) << coupling;
    EXPECT_NE(refused.error().describe().find(expected_text), std::string::npos)
        << refused.error().describe();
  }
}

TEST_F(ProfileFile, StandsWhereItIsMounted) {
  const std::string mount = "mount: {position_m: [1, 2, 0.7], rpy_rad: [0, 0, 1.2]}";
  const auto plain = loader_.load("{profile: panda}");
  const auto mounted = loader_.load("{profile: panda, " + mount + "}");
  ASSERT_TRUE(mounted) << mounted.error().describe();
  const std::vector<double> q{0.1, -0.3, 0.2, -2.0, 0.3, 1.9, 0.5};
  const Transform T_world_root = transform_from_xyz_rpy({1.0, 2.0, 0.7}, {0.0, 0.0, 1.2});
  EXPECT_TRUE(
      testing_robot::link_pose(**mounted, q, "panda_hand")
          .isApprox(T_world_root * testing_robot::link_pose(**plain, q, "panda_hand"), 1e-12));
  const auto driving = loader_.load("{profile: hsr, " + mount + "}");
  ASSERT_FALSE(driving);
  EXPECT_NE(driving.error().describe().find("a robot with a base that drives has no 'mount'"),
            std::string::npos);
}

TEST_F(ProfileFile, TellsAllItsMistakesInOnePass) {
  const auto robot = load(R"(name: arm
urdf: arm.urdf
joints: [elbow, sholder, grip_too, elbow]
joint_limits:
  elbow: {lowest: -0.5}
  wrist: {lower: 0.0}
fixed_joints: {grip: 0.5, grip_too: 0.0}
spheres:
  - {link: lover, centre_m: [0.1, 0, 0], radius_m: 0.1}
  - {link: base, centre_m: [0, 0], radius_m: -0.2}
self_collision:
  pairs: [[lower, bass], [base, base]]
poses:
  bent: {elbow: 9.0, gripp: 0.0}
  long: [0.1, 0.2, 0.3]
colour: red
)");
  ASSERT_FALSE(robot);
  const std::string text = robot.error().describe();
  for (const char* part :
       {"profile.yaml:3:17: the URDF has no moving joint 'sholder' (did you mean 'shoulder'?)",
        "profile.yaml:3:26: joint 'grip_too' cannot be planned: it mimics 'grip'",
        "profile.yaml:3:36: joint 'elbow' is planned twice",
        "profile.yaml:5:11: ", "profile.yaml:6:3: the URDF has no moving joint 'wrist'",
        "profile.yaml:7:22: joint 'grip' would be fixed outside of its limits",
        "profile.yaml:7:27: joint 'grip_too' cannot be fixed: it mimics 'grip'",
        "profile.yaml:9:12: the URDF has no link 'lover' (did you mean 'lower'?)",
        "profile.yaml:10:", "profile.yaml:12:19: the URDF has no link 'bass'",
        "profile.yaml:12:26: a link cannot be checked against itself",
        "profile.yaml:14:17: pose 'bent' has joint 'elbow' outside of its limits",
        "profile.yaml:14:22: pose 'bent' names 'gripp'",
        "profile.yaml:15:9: pose 'long' has 3 positions", "profile.yaml:16:1: "}) {
    EXPECT_NE(text.find(part), std::string::npos) << "no '" << part << "' in:\n" << text;
  }
}

struct BadProfile {
  const char* name;
  const char* text;
  const char* expected;
  friend void PrintTo(const BadProfile& bad, std::ostream* out) { *out << bad.name; }
};
class BadProfiles : public ProfileFile, public ::testing::WithParamInterface<BadProfile> {};

TEST_P(BadProfiles, EndInAClearError) {
  const auto robot = load(GetParam().text);
  ASSERT_FALSE(robot);
  EXPECT_NE(robot.error().describe().find(GetParam().expected), std::string::npos)
      << robot.error().describe();
}

INSTANTIATE_TEST_SUITE_P(
    All, BadProfiles,
    ::testing::Values(
        BadProfile{"empty", "", "profile.yaml"}, BadProfile{"a_list", "[1, 2]", "is a map"},
        BadProfile{"not_yaml", "name: [", "profile.yaml"},
        BadProfile{"no_urdf", "name: arm\n", "urdf"},
        BadProfile{"lost_urdf", "name: arm\nurdf: leg.urdf\n", "leg.urdf: there is no such file"},
        BadProfile{"no_spheres", "name: arm\nurdf: arm.urdf\nshapes_from: spheres\n",
                   "no collision spheres"},
        BadProfile{"no_shapes",
                   "name: arm\nurdf: arm.urdf\nspheres:\n"
                   "  - {link: base, centre_m: [0, 0, 0], radius_m: 1}\n",
                   "arm.urdf: no link of the URDF has a <collision> (give its links some, or, in a "
                   "profile whose spheres are all that there is to collide with, set "
                   "'shapes_from' to spheres)"},
        BadProfile{"fixed_and_fast",
                   "name: arm\nurdf: arm.urdf\nbase: {max_velocity_mps: 1.0}\nspheres:\n"
                   "  - {link: base, centre_m: [0, 0, 0], radius_m: 1}\n",
                   "profile.yaml:3:8: 'max_velocity_mps' says nothing of a base that is fixed"},
        BadProfile{"joints_of_two_kinds",
                   "name: arm\nurdf: arm.urdf\njoints: [elbow]\ntip_link: lower\nspheres:\n"
                   "  - {link: base, centre_m: [0, 0, 0], radius_m: 1}\n",
                   "profile.yaml:4:11: 'tip_link' chooses joints, and 'joints' lists them"},
        BadProfile{"spheres_of_two_kinds",
                   "name: arm\nurdf: arm.urdf\nspheres_from: fit\nspheres:\n"
                   "  - {link: base, centre_m: [0, 0, 0], radius_m: 1}\n",
                   "profile.yaml:3:15: 'spheres_from' is fit, and 'spheres' lists some"},
        BadProfile{"nothing_to_fit_to",
                   "name: arm\nurdf: arm.urdf\nspheres_from: fit\nshapes_from: spheres\n",
                   "profile.yaml:4:14: 'shapes_from' is spheres and 'spheres_from' is fit"},
        BadProfile{
            "bad_base",
            "name: arm\nurdf: arm.urdf\nbase: {type: holonomic, lower_m: [1, 1], upper_m: [0, "
            "0]}\nspheres:\n  - {link: base, centre_m: [0, 0, 0], radius_m: 1}\n",
            "profile.yaml:3:7: 'lower_m' lies above 'upper_m'"},
        BadProfile{"two_base_joints",
                   "name: arm\nurdf: arm.urdf\nbase: {type: holonomic, joints: [x, y]}\nspheres:\n"
                   "  - {link: base, centre_m: [0, 0, 0], radius_m: 1}\n",
                   "three names"},
        BadProfile{"scalar_limits", "name: arm\nurdf: arm.urdf\njoint_limits: 5\n",
                   "'joint_limits' is a map"},
        BadProfile{"planned_and_fixed",
                   "name: arm\nurdf: arm.urdf\njoints: [elbow]\nfixed_joints: {elbow: 0.0}\n",
                   "both planned and fixed"},
        BadProfile{"half_a_head",
                   "name: arm\nurdf: arm.urdf\nhead: {pan_joint: shoulder, tilt_joint: elbow}\n",
                   "camera_link"},
        BadProfile{"planned_head",
                   "name: arm\nurdf: arm.urdf\nhead: {pan_joint: shoulder, tilt_joint: elbow, "
                   "camera_link: lower}\n",
                   "profile.yaml:3:19: joint 'shoulder' is planned, a head cannot turn it"},
        BadProfile{"sliding_head",
                   "name: arm\nurdf: arm.urdf\njoints: [shoulder]\nhead: {pan_joint: elbow, "
                   "tilt_joint: grip, camera_link: finger}\n",
                   "joint 'grip' does not turn a head: it is not revolute"},
        BadProfile{"unknown_head",
                   "name: arm\nurdf: arm.urdf\njoints: [grip]\nhead: {pan_joint: sholder, "
                   "tilt_joint: elbow, camera_link: lower}\n",
                   "no moving joint 'sholder' (did you mean 'shoulder'?)"},
        BadProfile{"pair_twice",
                   "name: arm\nurdf: arm.urdf\nself_collision: {pairs: [[base, lower], [lower, "
                   "base]]}\n",
                   "listed twice"}),
    [](const auto& test) { return test.param.name; });

TEST_F(ProfileFile, SaysWhichJointsTurnTheHead) {
  const std::string rest =
      "joints: [grip]\nshapes_from: spheres\nfixed_joints: {elbow: 0.3}\nspheres:\n"
      "  - {link: base, centre_m: [0, 0, 0], radius_m: 0.2}\n";
  const auto robot = load("name: arm\nurdf: arm.urdf\n" + rest +
                          "head: {pan_joint: shoulder, tilt_joint: elbow, camera_link: lower}\n");
  ASSERT_TRUE(robot) << robot.error().describe();
  const auto& head = (*robot)->description().head;
  ASSERT_TRUE(head);
  EXPECT_EQ((*robot)->description().links[static_cast<std::size_t>(head->pan.link)].name, "upper");
  EXPECT_EQ(head->tilt.joint.lower, -2.0);
  EXPECT_EQ(head->tilt.joint.max_velocity, 2.0);
  // The other way round, nothing is carried.
  const auto upside_down =
      load("name: arm\nurdf: arm.urdf\n" + rest +
           "head: {pan_joint: elbow, tilt_joint: shoulder, camera_link: lower}\n");
  ASSERT_FALSE(upside_down);
  EXPECT_NE(upside_down.error().describe().find("'elbow' does not carry 'shoulder'"),
            std::string::npos)
      << upside_down.error().describe();
}

TEST_F(ProfileFile, AdmitsNothingBesideItThatItSaysItself) {
  write_file(folder_ / "arm/profile.yaml", kGood);
  const std::string file = (folder_ / "arm/profile.yaml").string();
  const auto robot = loader_.load("{profile: " + file + ", base: holonomic}");
  ASSERT_FALSE(robot);
  EXPECT_NE(robot.error().describe().find("'base' cannot stand beside 'profile'"),
            std::string::npos);
  EXPECT_TRUE(loader_.load("{profile: " + file + ", fixed_joints: {grip: 0.1}}"));
}

TEST_F(ProfileFile, FixesJointsWithinTheLimitsItGivesThem) {
  write_file(folder_ / "arm/profile.yaml", kGood);
  const std::string file = (folder_ / "arm/profile.yaml").string();
  const std::string fixed = ", fixed_joints: {grip: 0.15}";
  EXPECT_FALSE(loader_.load("{profile: " + file + fixed + "}"));
  const auto robot =
      loader_.load("{profile: " + file + fixed + ", joint_limits: {grip: {upper: 0.15}}}");
  ASSERT_TRUE(robot) << robot.error().describe();
  const std::vector<double> q(2, 0.0);
  for (const char* finger : {"finger", "thumb"}) {
    EXPECT_NEAR(testing_robot::link_pose(**robot, q, finger).translation().x(), 1.15, 1e-12);
  }
  const auto tighter = loader_.load("{profile: " + file + ", joint_limits: {grip: {upper: 0.04}}}");
  ASSERT_FALSE(tighter);
  EXPECT_NE(tighter.error().describe().find("outside of its limits, 0 to 0.04"), std::string::npos)
      << tighter.error().describe();
}

TEST(ProfileText, ReplacesOnlyTheSelfCollisionBlock) {
  const std::string before = "# top\nname: a\nself_collision:\n  # old\n  pairs:\n    - [x, y]\n";
  const std::string after = "# keep\nposes:\n  p: [1]\n";
  const std::string block = "self_collision:\n  pairs: []\n";
  EXPECT_EQ(with_self_collision(before + after, block), "# top\nname: a\n" + block + after);
  EXPECT_EQ(with_self_collision("name: a\n", block), "name: a\n\n" + block);
  EXPECT_EQ(with_self_collision(with_self_collision(before + after, block), block),
            with_self_collision(before + after, block));
}

}  // namespace
}  // namespace sidestep
