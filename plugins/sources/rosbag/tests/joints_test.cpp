// Where the robot stood, by joint states, tf and odometry.

#include <memory>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "bag_writing.hpp"
#include "support/chain_robot.hpp"

namespace sidestep::rosbag::testing {
namespace {

using ::testing::AllOf;
using ::testing::HasSubstr;
using ::testing::IsEmpty;
using ::testing::SizeIs;

/// A mobile base with a lift and a head, its planned joints in an order of their own.
std::shared_ptr<const RobotModel> mobile_robot() {
  RobotDescription description;
  description.name = "butler";
  for (const char* const name : {"odom_t", "lift", "odom_x", "odom_y", "head_pan"}) {
    Joint joint;
    joint.name = name;
    joint.type = std::string(name) == "odom_t" ? Joint::Type::kContinuous : Joint::Type::kRevolute;
    description.joints.push_back(joint);
  }
  return std::make_shared<testing_support::ChainRobot>(
      std::move(description), std::vector<testing_support::ChainRobot::Step>{});
}

double lift_at(double t) { return 0.1 + 0.2 * t; }
double pan_at(double t) { return 1.0 - 0.5 * t; }
Transform T_odom_base(double t) {
  return transform_from_xyz_rpy({0.3 * t, -0.1 * t, 0.0}, {0.0, 0.0, 0.4 * t});
}
const Transform kT_map_odom = transform_from_xyz_rpy({2.0, 1.0, 0.0}, {0.0, 0.0, 1.5});

class RobotInBag : public ::testing::Test {
 protected:
  void SetUp() override {
    BagWriter bag(file_);
    bag.write("/camera/depth/camera_info", after_s(0.0),
              ros_messages::to_camera_info(kCamera, after_s(0.0), "camera"));
    bag.write("/tf_static", after_s(0.0), tf_message(kT_map_odom, after_s(0.0), "map", "odom"));
    bag.write("/tf_static", after_s(0.0),
              tf_message(Transform::Identity(), after_s(0.0), "base_footprint", "camera"));
    const std::vector<Joint> lift{{.name = "lift"}, {.name = "gripper"}};
    const std::vector<Joint> pan{{.name = "head_pan"}};
    for (int i = 0; i <= 20; ++i) {
      const double t = 0.1 * i;
      const Stamp stamp = after_s(t);
      bag.write("/joint_states", stamp,
                ros_messages::to_joint_state(lift, std::vector{lift_at(t), 0.0}, stamp));
      const double later = t + 0.03;
      bag.write("/head/joint_states", after_s(later),
                ros_messages::to_joint_state(pan, std::vector{pan_at(later)}, after_s(later)));
      bag.write("/tf", stamp, tf_message(T_odom_base(t), stamp, "odom", "base_footprint"));
      ros_messages::Odometry odometry;
      const auto told = to_transform(ros_messages::rigid_pose(T_odom_base(t)), stamp, "odom", "");
      odometry.header = told.header;
      odometry.pose.pose.position.x = told.transform.translation.x;
      odometry.pose.pose.position.y = told.transform.translation.y;
      odometry.pose.pose.orientation = told.transform.rotation;
      bag.write("/odom", stamp, odometry);
    }
    bag.write("/camera/depth/image", after_s(0.77), flat_image(1000, after_s(0.77)));
    bag.close();
    options_ = options_of(file_);
    options_.joints.emplace();
    options_.joints->topics = {"/joint_states", "/head/joint_states"};
    options_.joints->base.emplace();
  }

  Outcome read() { return read_all(options_, host_.context()); }

  testing_support::TemporaryFolder folder_;
  std::filesystem::path file_ = folder_.path() / "robot.bag";
  conformance::TestHost host_{1, {.robot = mobile_robot()}};
  Options options_;
};

TEST_F(RobotInBag, StandsAsJointStatesAndTfSay) {
  const Outcome outcome = read();
  EXPECT_THAT(outcome.errors, IsEmpty());
  ASSERT_THAT(outcome.frames, SizeIs(1));
  ASSERT_TRUE(outcome.frames[0].joint_positions);
  const Eigen::VectorXd& q = *outcome.frames[0].joint_positions;
  const Transform base = kT_map_odom * T_odom_base(0.77);
  ASSERT_EQ(q.size(), 5);
  EXPECT_NEAR(q[0], 1.5 + 0.4 * 0.77, 1e-9);
  EXPECT_NEAR(q[1], lift_at(0.77), 1e-6);
  EXPECT_NEAR(q[2], base.translation().x(), 1e-6);
  EXPECT_NEAR(q[3], base.translation().y(), 1e-6);
  EXPECT_NEAR(q[4], pan_at(0.77), 1e-6);
}

TEST_F(RobotInBag, StandsTheSameByOdometry) {
  const Outcome by_tf = read();
  options_.joints->base->from = "odometry";
  options_.joints->base->topic = "/odom";
  const Outcome by_odometry = read();
  ASSERT_THAT(by_odometry.frames, SizeIs(1));
  EXPECT_LT((*by_odometry.frames[0].joint_positions - *by_tf.frames[0].joint_positions).norm(),
            1e-9);
}

/// One topic may tell of the camera and of the base.
TEST_F(RobotInBag, StandsInTheFrameOfTheOdometryThatTheCameraHas) {
  options_.pose.from = "topic";
  options_.pose.topic = "/odom";
  options_.joints->base->from = "odometry";
  options_.joints->base->topic = "/odom";
  const Outcome outcome = read();
  EXPECT_THAT(outcome.errors, IsEmpty());
  ASSERT_THAT(outcome.frames, SizeIs(1));
  const Eigen::VectorXd& q = *outcome.frames[0].joint_positions;
  EXPECT_NEAR(q[0], 0.4 * 0.77, 1e-9);
  EXPECT_NEAR(q[2], 0.3 * 0.77, 1e-6);
  EXPECT_NEAR(outcome.frames[0].T_world_camera.translation().x(), 0.3 * 0.77, 1e-6);
}

TEST_F(RobotInBag, NamesTheJointsThatNoMessageTellsOf) {
  options_.joints->topics = {"/joint_states"};
  options_.joints->base.reset();
  Outcome outcome = read();
  ASSERT_THAT(outcome.errors, SizeIs(1));
  EXPECT_EQ(outcome.errors[0].code, ErrorCode::kConfig);
  EXPECT_THAT(outcome.errors[0].message, HasSubstr("odom_t, odom_x, odom_y, head_pan"));
  EXPECT_THAT(outcome.errors[0].hint, HasSubstr("gripper, lift"));
  options_.joints->base.emplace();
  options_.joints->fixed = {{"head_pan", 0.25}};
  outcome = read();
  ASSERT_THAT(outcome.frames, SizeIs(1));
  EXPECT_EQ((*outcome.frames[0].joint_positions)[4], 0.25);
  options_.joints->fixed = {{"head_tilt", 0.25}};
  outcome = read();
  ASSERT_THAT(outcome.errors, SizeIs(1));
  EXPECT_THAT(outcome.errors[0].message, AllOf(HasSubstr("'butler'"), HasSubstr("head_tilt")));
}

TEST_F(RobotInBag, IsUnknownAcrossAGap) {
  options_.joints->max_gap_s = 0.05;
  const Outcome outcome = read();
  EXPECT_THAT(outcome.frames, IsEmpty());
  ASSERT_THAT(outcome.errors, SizeIs(1));
  EXPECT_EQ(outcome.errors[0].code, ErrorCode::kBadFrame);
  EXPECT_THAT(outcome.errors[0].message, AllOf(HasSubstr("gap"), HasSubstr("'lift'")));
}

TEST_F(RobotInBag, NeedsARobot) {
  const Outcome outcome = read_all(options_);
  ASSERT_THAT(outcome.errors, SizeIs(1));
  EXPECT_THAT(outcome.errors[0].message, HasSubstr("no robot"));
}

}  // namespace
}  // namespace sidestep::rosbag::testing
