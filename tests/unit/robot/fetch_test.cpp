#include <sidestep/robot/base_joints.hpp>

#include "conformance/robot_conformance.hpp"
#include "robot_testing.hpp"

namespace sidestep {
namespace {

using testing_robot::link_pose;

class Fetch : public ::testing::Test {
 protected:
  void SetUp() override {
    robot_ = loader_.load_or_fail("{profile: fetch}");
    ASSERT_NE(robot_, nullptr);
  }
  testing_robot::Loader loader_;
  std::unique_ptr<KinematicTree> robot_;
};

/// The arm lies in a plane that the shoulder's pan turns, as long as nothing rolls: the gripper by
/// plane trigonometry, from fetch_description's distances between joints.
Transform gripper_without_roll(double torso_m, double pan, double lift, double elbow,
                               double wrist) {
  const Eigen::Vector3d shoulder(-0.086875 + 0.119525, 0.0, 0.37743 + 0.34858 + torso_m);
  double x = 0.117, z = 0.06;
  double down = 0.0;  // from the horizontal
  for (const auto& [turn, length_m] :
       {std::pair(lift, 0.219 + 0.133), {elbow, 0.197 + 0.1245}, {wrist, 0.1385 + 0.16645}}) {
    down += turn;
    x += length_m * std::cos(down);
    z -= length_m * std::sin(down);
  }
  Transform T = Transform::Identity();
  T.translation() = shoulder + Eigen::Vector3d(x * std::cos(pan), x * std::sin(pan), z);
  T.rotate(Eigen::AngleAxisd(pan, Eigen::Vector3d::UnitZ()));
  T.rotate(Eigen::AngleAxisd(down, Eigen::Vector3d::UnitY()));
  return T;
}

TEST_F(Fetch, Conforms) {
  conformance::check_robot(*robot_);
  EXPECT_EQ(robot_->description().dof(), 8);
}

TEST_F(Fetch, FollowsThePublishedDistances) {
  const auto samples = conformance::random_configurations(robot_->description(), 50, 5);
  for (auto sample = samples.begin(); sample != samples.end(); sample += 8) {
    std::vector<double> q(sample, sample + 8);
    q[3] = q[5] = q[7] = 0.0;
    const Transform expected = gripper_without_roll(q[0], q[1], q[2], q[4], q[6]);
    EXPECT_LT((link_pose(*robot_, q, "gripper_link").matrix() - expected.matrix()).norm(), 1e-9);
  }
}

// A roll turns all that comes after it about the axis of the link before.
TEST_F(Fetch, RollsAboutItsLinks) {
  const std::vector<double> q = {0.1, 0.3, 0.4, 0.0, 0.5, 0.0, 0.6, 0.0};
  const std::pair<std::size_t, const char*> rolls[] = {
      {3, "upperarm_roll_link"}, {5, "forearm_roll_link"}, {7, "wrist_roll_link"}};
  for (const auto& [joint, link] : rolls) {
    const Transform before = link_pose(*robot_, q, link);
    std::vector<double> turned = q;
    turned[joint] = 0.7;
    const Eigen::AngleAxisd roll(0.7, before.linear().col(0));
    const Transform expected = Eigen::Translation3d(before.translation()) * roll *
                               Eigen::Translation3d(-before.translation()) *
                               link_pose(*robot_, q, "gripper_link");
    EXPECT_LT((link_pose(*robot_, turned, "gripper_link").matrix() - expected.matrix()).norm(),
              1e-12)
        << link;
  }
}

TEST_F(Fetch, HasThePublishedLimits) {
  struct Row {
    double lower, upper, velocity, acceleration;
  };
  constexpr double kEndless = std::numeric_limits<double>::infinity();
  const std::map<std::string, Row> table = {
      {"torso_lift_joint", {0.0, 0.38615, 0.1, 0.5}},
      {"shoulder_pan_joint", {-1.6056, 1.6056, 1.256, 1.5}},
      {"shoulder_lift_joint", {-1.221, 1.518, 1.454, 1.0}},
      {"upperarm_roll_joint", {-kEndless, kEndless, 1.571, 1.5}},
      {"elbow_flex_joint", {-2.251, 2.251, 1.521, 1.5}},
      {"forearm_roll_joint", {-kEndless, kEndless, 1.571, 1.5}},
      {"wrist_flex_joint", {-2.16, 2.16, 2.268, 2.5}},
      {"wrist_roll_joint", {-kEndless, kEndless, 2.268, 2.5}}};
  for (const Joint& joint : robot_->description().joints) {
    const Row& row = table.at(joint.name);
    EXPECT_EQ(joint.lower, row.lower) << joint.name;
    EXPECT_EQ(joint.upper, row.upper) << joint.name;
    EXPECT_EQ(joint.max_velocity, row.velocity) << joint.name;
    EXPECT_EQ(joint.max_acceleration, row.acceleration) << joint.name;
  }
}

TEST_F(Fetch, ReachPosesReachWhatTheirNamesSay) {
  const auto pose = [&](const char* name) {
    return link_pose(*robot_, testing_robot::pose_of(robot_->description(), name), "gripper_link");
  };
  const Transform ahead = pose("reach_ahead");
  EXPECT_LT((ahead.linear().col(0) - Eigen::Vector3d::UnitX()).norm(), 0.01);
  EXPECT_NEAR(ahead.translation().x(), 0.92, 0.01);
  EXPECT_NEAR(ahead.translation().z(), 0.92, 0.01);
  const Transform down = pose("reach_table");
  EXPECT_LT((down.linear().col(0) + Eigen::Vector3d::UnitZ()).norm(), 0.1);
  EXPECT_NEAR(down.translation().x(), 0.77, 0.01);
  EXPECT_NEAR(down.translation().z(), 0.68, 0.01);
}

TEST_F(Fetch, DrivesOnTwoWheelsAsAWholeBody) {
  const auto whole = loader_.load_or_fail("{profile: fetch, group: whole_body}");
  ASSERT_NE(whole, nullptr);
  conformance::check_robot(*whole);
  const RobotDescription& robot = whole->description();
  EXPECT_EQ(robot.dof(), 11);
  ASSERT_TRUE(robot.rolling);
  EXPECT_EQ(robot.joints[static_cast<std::size_t>(robot.rolling->yaw)].name, "odom_t");
  std::vector<double> q(11, 0.0);
  q[0] = 1.5;
  q[1] = -0.5;
  q[2] = 1.0;
  const Transform base = link_pose(*whole, q, "base_link");
  EXPECT_LT((base.translation() - Eigen::Vector3d(1.5, -0.5, 0.0)).norm(), 1e-12);
  EXPECT_NEAR(yaw_of(base), 1.0, 1e-12);
  // Standing, it is held where it is: nothing rolls.
  EXPECT_FALSE(robot_->description().rolling);
}

}  // namespace
}  // namespace sidestep
