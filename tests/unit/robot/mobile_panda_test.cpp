#include <iterator>
#include <numbers>

#include "conformance/robot_conformance.hpp"
#include "robot_testing.hpp"

namespace sidestep {
namespace {

using testing_robot::link_pose;
using testing_robot::Loader;
using testing_robot::pose_of;

class MobilePanda : public ::testing::Test {
 protected:
  void SetUp() override {
    robot_ = loader_.load_or_fail("{profile: mobile_panda}");
    ASSERT_NE(robot_, nullptr);
  }

  /// Where the tips of the fingers are, and where they point to, in a pose at the world's origin.
  Transform tip(const char* pose) const {
    return link_pose(*robot_, pose_of(robot_->description(), pose), "panda_grasptarget");
  }

  Loader loader_;
  std::unique_ptr<KinematicTree> robot_;
};

TEST_F(MobilePanda, Conforms) { conformance::check_robot(*robot_); }

TEST_F(MobilePanda, PlansBaseThenArm) {
  std::vector<std::string> names;
  for (const Joint& joint : robot_->description().joints) names.push_back(joint.name);
  EXPECT_EQ(names, (std::vector<std::string>{"odom_x", "odom_y", "odom_t", "panda_joint1",
                                             "panda_joint2", "panda_joint3", "panda_joint4",
                                             "panda_joint5", "panda_joint6", "panda_joint7"}));
}

/// Of a robot's URDF, what follows where the arm begins.
std::string arm_of(const std::string& robot) {
  std::ifstream file(SIDESTEP_SOURCE_DIR "/robots/" + robot + "/robot.urdf");
  const std::string text((std::istreambuf_iterator<char>(file)), std::istreambuf_iterator<char>());
  const std::size_t begin = text.find("<link name=\"panda_link0\">");
  return begin == std::string::npos ? "" : text.substr(begin);
}

// The arm is a copy, which must not drift from robots/panda.
TEST_F(MobilePanda, HasTheArmOfThePanda) {
  ASSERT_FALSE(arm_of("panda").empty());
  EXPECT_EQ(arm_of("mobile_panda"), arm_of("panda"));
  const auto panda = loader_.load_or_fail("{profile: panda}");
  ASSERT_NE(panda, nullptr);
  const RobotDescription& arm = panda->description();
  const RobotDescription& whole = robot_->description();
  for (std::size_t j = 0; j < arm.joints.size(); ++j) {
    EXPECT_EQ(whole.joints[j + 3].max_acceleration, arm.joints[j].max_acceleration)
        << arm.joints[j].name;
  }
  const auto link_name = [](const RobotDescription& robot, const CollisionSphere& sphere) {
    return robot.links[static_cast<std::size_t>(sphere.link)].name;
  };
  ASSERT_GT(whole.spheres.size(), arm.spheres.size());
  const std::size_t of_base = whole.spheres.size() - arm.spheres.size();
  for (std::size_t s = 0; s < arm.spheres.size(); ++s) {
    const CollisionSphere& sphere = whole.spheres[of_base + s];
    EXPECT_EQ(link_name(whole, sphere), link_name(arm, arm.spheres[s]));
    EXPECT_EQ(sphere.centre_link_m, arm.spheres[s].centre_link_m);
    EXPECT_EQ(sphere.radius_m, arm.spheres[s].radius_m);
  }
}

// The base turns the world, the mount lifts the arm, and the arm is where the Panda would be.
TEST_F(MobilePanda, CarriesTheArmOnItsBase) {
  const auto panda = loader_.load_or_fail("{profile: panda}");
  ASSERT_NE(panda, nullptr);
  const std::vector<double> arm{0.4, -0.9, 0.2, -1.7, 0.6, 2.1, -0.3};
  std::vector<double> q{0.3, -1.2, 2.0};
  q.insert(q.end(), arm.begin(), arm.end());
  Transform T_world_arm(Eigen::Translation3d(0.3, -1.2, 0.33));
  T_world_arm.rotate(Eigen::AngleAxisd(2.0, Eigen::Vector3d::UnitZ()));
  T_world_arm.translate(Eigen::Vector3d(0.1, 0.0, 0.0));
  const Transform expected = T_world_arm * link_pose(*panda, arm, "panda_hand");
  EXPECT_LT((link_pose(*robot_, q, "panda_hand").matrix() - expected.matrix()).norm(), 1e-12);
}

TEST_F(MobilePanda, DrivesAsItsProfileSays) {
  const std::vector<Joint>& joints = robot_->description().joints;
  for (const std::size_t j : {0u, 1u}) {
    EXPECT_EQ(joints[j].max_velocity, 1.0);
    EXPECT_EQ(joints[j].max_acceleration, 1.0);
    EXPECT_EQ(joints[j].braking(), 2.0);
  }
  EXPECT_EQ(joints[2].max_velocity, 1.5);
  EXPECT_EQ(joints[2].max_acceleration, 1.5);
  EXPECT_EQ(joints[2].braking(), 3.0);
}

// A robot that drives with its arm folded is as wide as its base.
TEST_F(MobilePanda, FoldsItsArmWithinItsRim) {
  const RobotDescription& robot = robot_->description();
  const auto q = pose_of(robot, "go");
  std::vector<Eigen::Vector3d> centres_m(robot.spheres.size());
  Scratch scratch;
  robot_->sphere_centres(q, centres_m, scratch);
  const int base = robot.link_index("base_link").value();
  for (std::size_t s = 0; s < centres_m.size(); ++s) {
    if (robot.spheres[s].link == base) continue;
    EXPECT_LT(centres_m[s].head<2>().norm() + robot.spheres[s].radius_m, 0.3)
        << robot.links[static_cast<std::size_t>(robot.spheres[s].link)].name;
  }
}

TEST_F(MobilePanda, ReachPosesReachWhatTheirNamesSay) {
  const Eigen::Vector3d down = -Eigen::Vector3d::UnitZ();
  const Eigen::Vector3d ahead = Eigen::Vector3d::UnitX();
  EXPECT_LT((tip("reach_table").translation() - Eigen::Vector3d(0.65, 0.0, 0.85)).norm(), 0.01);
  EXPECT_LT((tip("reach_table").linear().col(2) - down).norm(), 0.01);
  EXPECT_LT((tip("reach_shelf").translation() - Eigen::Vector3d(0.70, 0.0, 1.10)).norm(), 0.01);
  EXPECT_LT((tip("reach_shelf").linear().col(2) - ahead).norm(), 0.01);
  EXPECT_LT((tip("reach_floor").translation() - Eigen::Vector3d(0.65, 0.0, 0.05)).norm(), 0.01);
  EXPECT_LT((tip("reach_floor").linear().col(2) - down).norm(), 0.01);
}

TEST_F(MobilePanda, LooksAheadOverItsRim) {
  const Transform T = link_pose(*robot_, pose_of(robot_->description(), "go"), "camera_link");
  EXPECT_GT(T.translation().x(), 0.3);
  const double up = 10.0 / 180.0 * std::numbers::pi;
  EXPECT_LT((T.linear().col(2) - Eigen::Vector3d(std::cos(up), 0.0, std::sin(up))).norm(), 1e-9);
  EXPECT_LT((T.linear().col(0) + Eigen::Vector3d::UnitY()).norm(), 1e-9);  // columns to the right
}

}  // namespace
}  // namespace sidestep
