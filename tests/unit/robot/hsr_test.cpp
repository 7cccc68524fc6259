#include <nlohmann/json.hpp>
#include <numbers>

#include "conformance/robot_conformance.hpp"
#include "robot_testing.hpp"
#include "sphere_cover.hpp"

namespace sidestep {
namespace {

using testing_robot::link_pose;
using testing_robot::Loader;

/// The tables have six decimals.
constexpr double kTableTolerance = 1e-6;

nlohmann::json hsr_facts() {
  std::ifstream file(SIDESTEP_SHARED_FACTS "/hsr.json");
  return file ? nlohmann::json::parse(file) : nlohmann::json();
}

Eigen::Vector3d vector3(const nlohmann::json& j) {
  return {j[0].get<double>(), j[1].get<double>(), j[2].get<double>()};
}

class Hsr : public ::testing::Test {
 protected:
  void SetUp() override {
    robot_ = loader_.load_or_fail("{profile: hsr, fixed_joints: {head_tilt_joint: 0.0}}");
    ASSERT_NE(robot_, nullptr);
  }

  std::vector<double> arm(const nlohmann::json& values) const {
    std::vector<double> q(8, 0.0);
    for (const auto& [name, value] : values.items())
      q[static_cast<std::size_t>(robot_->description().joint_index(name).value())] = value;
    return q;
  }

  Loader loader_;
  std::unique_ptr<KinematicTree> robot_;
};

TEST_F(Hsr, Conforms) { conformance::check_robot(*robot_); }

TEST_F(Hsr, PlansBaseThenArm) {
  const RobotDescription& robot = robot_->description();
  std::vector<std::string> names;
  for (const Joint& joint : robot.joints) names.push_back(joint.name);
  EXPECT_EQ(names, (std::vector<std::string>{"odom_x", "odom_y", "odom_t", "arm_lift_joint",
                                             "arm_flex_joint", "arm_roll_joint", "wrist_flex_joint",
                                             "wrist_roll_joint"}));
  EXPECT_EQ(robot.joints[2].type, Joint::Type::kContinuous);
  EXPECT_TRUE(std::isinf(robot.joints[2].upper));
  EXPECT_LE(robot.spheres.size(), 110u);
}

TEST_F(Hsr, HasThePublishedLimits) {
  const nlohmann::json table = hsr_facts();
  if (table.is_null()) GTEST_SKIP() << "no " SIDESTEP_SHARED_FACTS;
  for (const auto& row : table["hsrb_description"]["chain_joints"]) {
    const auto index = robot_->description().joint_index(row["name"].get<std::string>());
    if (!index) continue;
    const Joint& joint = robot_->description().joints[static_cast<std::size_t>(*index)];
    SCOPED_TRACE(joint.name);
    EXPECT_EQ(joint.lower, row["limit"]["lower"].get<double>());
    EXPECT_EQ(joint.upper, row["limit"]["upper"].get<double>());
    EXPECT_EQ(joint.max_velocity, row["limit"]["velocity"].get<double>());
  }
  for (const char* name : {"odom_x", "odom_y", "odom_t"}) {
    const auto& row = table["moveit"]["joint_limits"][name];
    const auto index = robot_->description().joint_index(name);
    const Joint& joint = robot_->description().joints[static_cast<std::size_t>(*index)];
    EXPECT_EQ(joint.max_velocity, row["max_velocity"].get<double>());
    if (row["has_acceleration_limits"].get<bool>()) {
      EXPECT_EQ(joint.max_acceleration, row["max_acceleration"].get<double>());
    }
  }
}

TEST_F(Hsr, ReachesThePublishedHandPoses) {
  const nlohmann::json table = hsr_facts();
  if (table.is_null()) GTEST_SKIP() << "no " SIDESTEP_SHARED_FACTS;
  const auto& check = table["fk_check"];
  const auto hand = [&](const std::vector<double>& q) {
    return link_pose(*robot_, q, "hand_palm_link");
  };
  const auto zero = vector3(check["zero_configuration_hand_palm_link_xyz_in_base_footprint"]);
  EXPECT_LT((hand(std::vector<double>(8, 0.0)).translation() - zero).norm(), kTableTolerance);
  const auto go =
      vector3(check["go_configuration(arm_roll=-1.57,wrist_flex=-1.57)_hand_palm_link_xyz"]);
  const auto go_q = testing_robot::pose_of(robot_->description(), "go");
  EXPECT_LT((hand(go_q).translation() - go).norm(), kTableTolerance);
  ASSERT_EQ(check["random"].size(), 5u);
  for (const auto& row : check["random"]) {
    const Transform T = hand(arm(row["q"]));
    const auto& m = row["hand_palm_link_in_base_footprint_row_major_4x4"];
    for (int i = 0; i < 3; ++i)
      for (int j = 0; j < 4; ++j)
        EXPECT_NEAR(T(i, j), m[static_cast<std::size_t>(4 * i + j)].get<double>(), kTableTolerance);
  }
}

TEST_F(Hsr, HoldsTheCameraWhereItIsPublished) {
  const nlohmann::json table = hsr_facts();
  if (table.is_null()) GTEST_SKIP() << "no " SIDESTEP_SHARED_FACTS;
  const auto expected = vector3(table["fk_check"]["zero_configuration_head_rgbd_sensor_link_xyz"]);
  const Transform T = link_pose(*robot_, std::vector<double>(8, 0.0), "head_rgbd_sensor_link");
  EXPECT_LT((T.translation() - expected).norm(), kTableTolerance);
  EXPECT_LT((T.linear().col(2) - Eigen::Vector3d::UnitX()).norm(), 1e-9);  // looks ahead
  EXPECT_LT((T.linear().col(1) + Eigen::Vector3d::UnitZ()).norm(), 1e-9);  // image rows downwards
}

TEST_F(Hsr, LiftsTheTorsoHalfAsFast) {
  std::vector<double> q(8, 0.0);
  const Transform low = link_pose(*robot_, q, "head_rgbd_sensor_link");
  q[3] = 0.6;
  const Transform high = link_pose(*robot_, q, "head_rgbd_sensor_link");
  EXPECT_LT((high.translation() - low.translation() - Eigen::Vector3d(0, 0, 0.3)).norm(), 1e-12);
}

TEST_F(Hsr, DrivesTheWholeRobot) {
  std::vector<double> q(8, 0.0);
  const Transform still = link_pose(*robot_, q, "hand_palm_link");
  q[0] = 1.5;
  q[1] = -0.5;
  q[2] = 2.0 + 4.0 * M_PI;
  Transform base = Transform::Identity();
  base.translate(Eigen::Vector3d(1.5, -0.5, 0.0));
  base.rotate(Eigen::AngleAxisd(2.0, Eigen::Vector3d::UnitZ()));
  const Transform moved = link_pose(*robot_, q, "hand_palm_link");
  EXPECT_LT((moved.matrix() - (base * still).matrix()).norm(), 1e-12);
}

TEST_F(Hsr, SpheresCoverTheShapes) {
  const auto report = testing_robot::measure_cover(*robot_);
  EXPECT_LE(report.deepest_gap_m, 1e-9) << "on " << report.gap_link;
  EXPECT_LE(report.protrusion_m, 0.091) << "on " << report.protrusion_link;
  // The drive's disc may be topped by more, but drives through doors as it is.
  for (const CollisionSphere& sphere : robot_->description().spheres) {
    if (robot_->description().links[static_cast<std::size_t>(sphere.link)].name != "base_link")
      continue;
    EXPECT_LE(sphere.centre_link_m.head<2>().norm() + sphere.radius_m, 0.215 + 0.04);
  }
  RecordProperty("protrusion_mm", static_cast<int>(1000 * report.protrusion_m));
  RecordProperty("volume_percent", static_cast<int>(100 * report.volume_ratio));
  std::cout << "spheres " << robot_->description().spheres.size() << ", largest protrusion "
            << report.protrusion_m << " m (" << report.protrusion_link << "), volume x "
            << report.volume_ratio << "\n";
}

// What is public of the robot's outside: its diameter of 430 mm and least height of 1.005 m,
// wheels, cameras and finger tips of its description, an Xtion's width of 180 mm, and a point of
// the shell around the column.
TEST_F(Hsr, EnclosesItsPublicDimensions) {
  std::vector<std::pair<std::string, Eigen::Vector3d>> outside;
  for (int i = 0; i < 32; ++i) {
    const double turn = i * std::numbers::pi / 16.0;
    outside.push_back({"base_link", {0.215 * std::cos(turn), 0.215 * std::sin(turn), 0.1}});
  }
  for (const double side : {-1.0, 1.0}) {
    outside.push_back({"base_link", {0.038, 0.183 * side, 0.58}});
    outside.push_back({"base_link", {-0.15, 0.148 * side, 0.04}});   // driven wheels
    outside.push_back({"base_link", {-0.11, 0.148 * side, 0.002}});  // 2 mm above the floor
    outside.push_back({"base_link", {0.1795, 0.055 * side, 0.03}});  // castors
    outside.push_back({"base_link", {0.1495, 0.085 * side, 0.03}});
    outside.push_back({"head_tilt_link", {0.02, 0.07 * side, 0.061}});  // stereo cameras
    outside.push_back({"head_rgbd_sensor_link", {0.022 + 0.09 * side, 0.0, 0.0}});
  }
  // Where the meshes stood out of earlier shapes: the carriage's plate, the forearm's lower end,
  // the wrist.
  outside.push_back({"arm_lift_link", {0.047, -0.075, -0.126}});
  outside.push_back({"arm_lift_link", {0.098, 0.075, -0.126}});
  outside.push_back({"arm_roll_link", {-0.042, 0.049, -0.108}});
  outside.push_back({"arm_roll_link", {0.016, 0.06, -0.103}});
  outside.push_back({"wrist_roll_link", {0.0, 0.043, 0.09}});
  outside.push_back({"wrist_roll_link", {0.0, -0.043, 0.13}});
  outside.push_back({"base_range_sensor_link", {0.0, 0.0, 0.0}});
  outside.push_back({"hand_camera_frame", {0.0, 0.0, 0.0}});
  outside.push_back({"hand_l_finger_tip_frame", {0.0, 0.0, 0.0}});
  outside.push_back({"hand_r_finger_tip_frame", {0.0, 0.0, 0.0}});
  // What holds a point is of its link or of one fixed to it.
  const std::map<std::string, std::string> fixed_to = {
      {"base_link", "base_body_link"},
      {"hand_camera_frame", "hand_palm_link"},
      {"hand_l_finger_tip_frame", "hand_l_distal_link"},
      {"hand_r_finger_tip_frame", "hand_r_distal_link"}};
  const RobotDescription& robot = robot_->description();
  std::vector<Transform> poses(robot.links.size());
  Scratch scratch;
  robot_->link_poses(std::vector<double>(robot.joints.size(), 0.0), poses, scratch);
  for (const auto& [link, p_link] : outside) {
    const auto holds = [&, &name = link](int index) {
      const std::string& other = robot.links[static_cast<std::size_t>(index)].name;
      return other == name || (fixed_to.contains(name) && other == fixed_to.at(name));
    };
    const Eigen::Vector3d p =
        poses[static_cast<std::size_t>(robot.link_index(link).value())] * p_link;
    double shapes_m = 1.0;
    for (const CollisionShape& shape : robot.shapes) {
      if (!holds(shape.link)) continue;
      const Transform T = poses[static_cast<std::size_t>(shape.link)] * shape.T_link_shape;
      shapes_m = std::min(shapes_m, signed_distance_m(shape.shape, T.inverse() * p));
    }
    double spheres_m = 1.0;
    for (const CollisionSphere& sphere : robot.spheres) {
      if (!holds(sphere.link)) continue;
      const Eigen::Vector3d centre =
          poses[static_cast<std::size_t>(sphere.link)] * sphere.centre_link_m;
      spheres_m = std::min(spheres_m, (p - centre).norm() - sphere.radius_m);
    }
    EXPECT_LE(shapes_m, 0.0) << link << " " << p_link.transpose();
    EXPECT_LE(spheres_m, 0.0) << link << " " << p_link.transpose();
  }
}

TEST_F(Hsr, ReachPosesReachWhatTheirNamesSay) {
  const auto q = testing_robot::pose_of(robot_->description(), "reach_table");
  const Transform hand = link_pose(*robot_, q, "hand_palm_link");
  EXPECT_GT(hand.translation().z(), 0.85);
  EXPECT_LT(hand.translation().z(), 0.95);
  EXPECT_GT(hand.translation().x(), 0.5);
  EXPECT_LT(hand.translation().x(), 0.6);
  EXPECT_LT((hand.linear().col(2) - Eigen::Vector3d::UnitX()).norm(), 0.01);
  const auto low = testing_robot::pose_of(robot_->description(), "reach_floor");
  const Transform tip = link_pose(*robot_, low, "hand_l_finger_tip_frame");
  EXPECT_GT(tip.translation().z(), 0.0);
  EXPECT_LT(tip.translation().z(), 0.10);
}

/// What the closed loops keep from the floor: everything but the base.
TEST_F(Hsr, KeepsItsPosesAboveTheFloor) {
  constexpr double kMargin_m = 0.02;
  const RobotDescription& robot = robot_->description();
  std::vector<Eigen::Vector3d> centres_m(robot.spheres.size());
  Scratch scratch;
  for (const NamedPose& pose : robot.poses) {
    robot_->sphere_centres(testing_robot::pose_of(robot, pose.name), centres_m, scratch);
    for (std::size_t s = 0; s < centres_m.size(); ++s) {
      const CollisionSphere& sphere = robot.spheres[s];
      const std::string& link = robot.links[static_cast<std::size_t>(sphere.link)].name;
      if (link == "base_link") continue;
      EXPECT_GT(centres_m[s].z() - sphere.radius_m, kMargin_m) << pose.name << ", " << link;
    }
  }
}

}  // namespace
}  // namespace sidestep
