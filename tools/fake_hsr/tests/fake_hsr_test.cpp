#include <cmath>
#include <limits>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "conversions.hpp"
#include "robot_body.hpp"
#include "settings.hpp"
#include "support/hsr.hpp"

namespace sidestep::fake_hsr {
namespace {

using ::testing::HasSubstr;

Stamp at_s(double seconds) { return Stamp::from_seconds(seconds); }

std::vector<Joint> head() {
  return {{"head_pan_joint", Joint::Type::kRevolute, -3.84, 1.75, 1.0, 2.0},
          {"head_tilt_joint", Joint::Type::kRevolute, -1.57, 0.52, 1.0, 2.0}};
}

std::vector<Transform> links_of(const RobotModel& robot, const Eigen::VectorXd& q) {
  std::vector<Transform> T_world_link(robot.description().links.size());
  Scratch scratch;
  robot.link_poses({q.data(), static_cast<std::size_t>(q.size())}, T_world_link, scratch);
  return T_world_link;
}

TEST(WithJoints, MovesTheHeadAndLeavesAllElseAsItWas) {
  const auto hsr = testing_support::load_hsr();
  const auto& tree = dynamic_cast<const KinematicTree&>(*hsr);
  const auto made = with_joints(tree, head());
  ASSERT_TRUE(made) << made.error().describe();
  Eigen::VectorXd q8(8), q10(10);
  q8 << 0.3, -0.2, 0.5, 0.2, -0.7, 0.4, -0.9, 0.1;
  q10 << q8, 0.0, -0.3;  // as the profile has the head
  const auto wanted = links_of(*hsr, q8);
  const auto found = links_of(**made, q10);
  for (std::size_t i = 0; i < wanted.size(); ++i) {
    EXPECT_TRUE(found[i].isApprox(wanted[i], 1e-12)) << hsr->description().links[i].name;
  }
  // Panned by a quarter, the camera looks to the left of where it did.
  q10[8] = 0.5 * std::acos(-1.0);
  const auto link =
      static_cast<std::size_t>((*made)->description().link_index("head_rgbd_sensor_link").value());
  const Eigen::Vector3d before = found[link].linear().col(2);
  const Eigen::Vector3d after = links_of(**made, q10)[link].linear().col(2);
  EXPECT_NEAR(after.x(), -before.y(), 1e-9);
  EXPECT_NEAR(after.y(), before.x(), 1e-9);
  EXPECT_NEAR(after.z(), before.z(), 1e-9);
  EXPECT_FALSE(with_joints(tree, {{"arm_lift_joint"}})) << "it is planned";
  EXPECT_FALSE(with_joints(tree, {{"tail_joint"}}));
}

class Group : public ::testing::Test {
 protected:
  Group() {
    robot_.name = "arm";
    for (const char* name : {"a", "b"}) {
      robot_.joints.push_back({name, Joint::Type::kRevolute, -3.0, 3.0, 1.0, 2.0});
    }
    state_ = {Eigen::Vector2d::Zero(), Eigen::Vector2d::Zero()};
  }

  /// From rest to `to` of joint b in 2 s, in a message that has the joints the other way round.
  static ros_messages::JointTrajectory command(double to) {
    ros_messages::JointTrajectory message;
    message.header.stamp = ros_messages::to_ros_time(at_s(100.0));
    message.joint_names = {"b", "a"};
    for (const double t : {0.0, 2.0}) {
      auto& point = message.points.emplace_back();
      point.time_from_start = ::ros::Duration(t);
      point.positions = {0.5 * t * to, 0.0};
      point.velocities = {0.0, 0.0};
    }
    return message;
  }

  RobotDescription robot_;
  RobotState state_;
};

TEST_F(Group, FollowsACommandAndHoldsItsEnd) {
  JointGroup group(robot_, {"a", "b"}, state_.q, at_s(100.0));
  ASSERT_TRUE(group.follow(command(0.8), at_s(100.0)));
  group.advance(at_s(101.0), state_);
  EXPECT_NEAR(state_.q[1], 0.4, 0.01);  // Half of the way, by symmetry.
  EXPECT_EQ(state_.q[0], 0.0);
  group.advance(at_s(103.0), state_);
  EXPECT_NEAR(state_.q[1], 0.8, 1e-4);
  EXPECT_NEAR(state_.qdot[1], 0.0, 1e-3);
}

TEST_F(Group, StopsWithinItsLimitsAtACommandWithoutPoints) {
  JointGroup group(robot_, {"a", "b"}, state_.q, at_s(100.0));
  ASSERT_TRUE(group.follow(command(1.2), at_s(100.0)));
  group.advance(at_s(101.0), state_);
  const double speed = state_.qdot[1];
  ASSERT_GT(speed, 0.5);
  const double q = state_.q[1];
  ros_messages::JointTrajectory stop;
  stop.joint_names = {"a", "b"};
  ASSERT_TRUE(group.follow(stop, at_s(101.0)));
  group.advance(at_s(102.0), state_);
  EXPECT_EQ(state_.qdot[1], 0.0);
  EXPECT_NEAR(state_.q[1] - q, 0.5 * speed * speed / 2.0, 2e-3);  // v^2 / 2a
}

/// A base along x and y and about z.
TEST(BaseGroup, FollowsSpeedsInItsOwnFrameForAQuarterOfASecondAndThenBrakes) {
  RobotDescription robot;
  robot.name = "base";
  for (const char* name : {"x", "y", "yaw"}) {
    robot.joints.push_back({name, Joint::Type::kPrismatic, -10.0, 10.0, 1.0, 4.0});
  }
  constexpr double kYaw_rad = 0.7;
  for (const bool rolls : {false, true}) {
    if (rolls) robot.rolling = RollingBase{};
    RobotState state{Eigen::Vector3d(0.0, 0.0, kYaw_rad), Eigen::Vector3d::Zero()};
    JointGroup group(robot, {"x", "y", "yaw"}, state.q, at_s(100.0));
    ros_messages::Twist twist;
    twist.linear.x = 0.4;
    twist.linear.y = 0.2;
    for (int i = 0; i < 50; ++i) {
      group.drive(twist, at_s(100.0 + 0.02 * i));
      group.advance(at_s(100.0 + 0.02 * i), state);
    }
    const Eigen::Vector2d v =
        Eigen::Rotation2Dd(kYaw_rad) * Eigen::Vector2d(0.4, rolls ? 0.0 : 0.2);
    EXPECT_LT((state.qdot.head<2>() - v).norm(), 0.01) << rolls;
    EXPECT_LT((state.q.head<2>() - 0.98 * v).norm(), 0.02) << rolls;
    group.advance(at_s(102.0), state);  // long after the last
    EXPECT_EQ(state.qdot, Eigen::Vector3d::Zero());
    // A quarter of a second at speed, and v^2 / 2a: of each joint, or along the wheels.
    const Eigen::Vector2d stop = rolls ? Eigen::Vector2d(v * v.norm() / 8.0)
                                       : Eigen::Vector2d(v.cwiseProduct(v.cwiseAbs()) / 8.0);
    EXPECT_LT((state.q.head<2>() - (0.98 + 0.25) * v - stop).norm(), 0.02) << rolls;
  }
}

TEST(BaseGroup, TurnsOnAnArc) {
  RobotDescription robot;
  robot.name = "base";
  for (const char* name : {"x", "y", "yaw"}) {
    robot.joints.push_back({name, Joint::Type::kPrismatic, -10.0, 10.0, 1.0, 40.0});
  }
  robot.rolling = RollingBase{};
  RobotState state{Eigen::Vector3d::Zero(), Eigen::Vector3d::Zero()};
  JointGroup group(robot, {"x", "y", "yaw"}, state.q, at_s(100.0));
  ros_messages::Twist twist;  // a circle of half a metre
  twist.linear.x = 0.4;
  twist.angular.z = 0.8;
  for (int i = 0; i <= 100; ++i) {
    group.drive(twist, at_s(100.0 + 0.02 * i));
    group.advance(at_s(100.0 + 0.02 * i), state);
  }
  EXPECT_NEAR(state.q[2], 1.6, 0.02);
  EXPECT_NEAR(state.q[0], 0.5 * std::sin(state.q[2]), 0.01);
  EXPECT_NEAR(state.q[1], 0.5 * (1.0 - std::cos(state.q[2])), 0.01);
}

TEST_F(Group, RefusesWhatAControllerWould) {
  JointGroup group(robot_, {"a", "b"}, state_.q, at_s(100.0));
  auto message = command(0.8);
  message.joint_names[1] = "c";
  EXPECT_THAT(group.follow(message, at_s(100.0)).error().message,
              HasSubstr("does not command joint 'a'"));
  message = command(0.8);
  message.points[1].velocities.clear();
  EXPECT_THAT(group.follow(message, at_s(100.0)).error().message, HasSubstr("a velocity"));
  message = command(0.8);
  message.points[1].time_from_start = message.points[0].time_from_start;
  EXPECT_FALSE(group.follow(message, at_s(100.0)));
  message = command(std::numeric_limits<double>::quiet_NaN());
  EXPECT_FALSE(group.follow(message, at_s(100.0)));
}

TEST(Silence, IsReadAndLastsAsLongAsItSays) {
  const auto passing = parse_silence("camera@5+3");
  ASSERT_TRUE(passing);
  const auto lasting = parse_silence("tf@2.5");
  ASSERT_TRUE(lasting);
  const std::vector<Silence> both{*passing, *lasting};
  EXPECT_FALSE(is_silent(both, "camera", std::nullopt));
  EXPECT_FALSE(is_silent(both, "camera", 4.99));
  EXPECT_TRUE(is_silent(both, "camera", 5.0));
  EXPECT_TRUE(is_silent(both, "camera", 7.99));
  EXPECT_FALSE(is_silent(both, "camera", 8.0));
  EXPECT_TRUE(is_silent(both, "tf", 1e6));
  EXPECT_FALSE(is_silent(both, "odom", 6.0));
  for (const char* wrong : {"", "camera", "camera@", "lidar@3", "camera@3+", "camera@3s"}) {
    EXPECT_FALSE(parse_silence(wrong)) << wrong;
  }
}

}  // namespace
}  // namespace sidestep::fake_hsr
