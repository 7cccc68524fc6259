#include "robot_link.hpp"

#include <cmath>
#include <limits>
#include <numbers>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "conversions.hpp"

namespace sidestep::ros1_executor {
namespace {

using ::testing::HasSubstr;

Stamp at_s(double seconds) { return Stamp::from_seconds(seconds); }

RobotDescription cart() {
  RobotDescription description;
  description.name = "cart";
  using Type = Joint::Type;
  for (const char* name : {"x", "y"}) {
    description.joints.push_back({name, Type::kPrismatic, -10.0, 10.0, 1.0, 1.0});
  }
  description.joints.push_back({"yaw", Type::kRevolute, -10.0, 10.0, 1.0, 1.0});
  description.joints.push_back({"arm", Type::kRevolute, -2.0, 2.0, 1.0, 1.0});
  return description;
}

Options cart_options() {
  Options options;
  options.joint_state_topics = {"/joints"};
  options.odometry = OdometryOptions{{"x", "y", "yaw"}, "/odom", "base"};
  options.hold = {{"head", -0.3}};
  return options;
}

JointFeed feed_of(const Options& told = cart_options()) {
  auto feed = JointFeed::create(cart(), told);
  EXPECT_TRUE(feed) << feed.error().describe();
  return std::move(*feed);
}

ros_messages::JointState arm(double t, double q, std::optional<double> qdot) {
  ros_messages::JointState message;
  message.header.stamp = ros_messages::to_ros_time(at_s(t));
  message.name = {"finger", "arm"};
  message.position = {0.7, q};
  if (qdot) message.velocity = {0.0, *qdot};
  return message;
}

ros_messages::Odometry odometry(double t, double x, double y, double yaw, double vx = 0.0,
                                double vy = 0.0, double turn = 0.0) {
  ros_messages::Odometry message;
  message.header.stamp = ros_messages::to_ros_time(at_s(t));
  message.pose.pose.position.x = x;
  message.pose.pose.position.y = y;
  message.pose.pose.orientation.z = std::sin(0.5 * yaw);
  message.pose.pose.orientation.w = std::cos(0.5 * yaw);
  message.twist.twist.linear.x = vx;
  message.twist.twist.linear.y = vy;
  message.twist.twist.angular.z = turn;
  return message;
}

TEST(JointFeed, KnowsTheStateAtTheNewestTimeThatAllMessagesCover) {
  JointFeed feed = feed_of();
  EXPECT_FALSE(feed.newest());
  // Everything moves evenly, so that what lies between messages is known.
  for (int i = 0; i <= 10; ++i) feed.add(arm(10.0 + 0.02 * i, 0.5 + 0.1 * (0.02 * i), 0.1), {});
  EXPECT_FALSE(feed.newest());
  for (int i = 0; i <= 3; ++i) feed.add(odometry(10.01 + 0.05 * i, 0.05 * i, 2.0, 0.0, 1.0), {});
  const auto newest = feed.newest();
  ASSERT_TRUE(newest);
  EXPECT_EQ(newest->stamp, at_s(10.16));
  EXPECT_NEAR(newest->state.q[0], 0.15, 1e-9);
  EXPECT_NEAR(newest->state.q[1], 2.0, 1e-9);
  EXPECT_NEAR(newest->state.q[3], 0.516, 1e-9);
  EXPECT_NEAR(newest->state.qdot[0], 1.0, 1e-9);
  EXPECT_NEAR(newest->state.qdot[3], 0.1, 1e-9);
}

TEST(JointFeed, TakesVelocitiesFromPositionsWhereNoneAreTold) {
  JointFeed feed = feed_of();
  for (int i = 0; i <= 4; ++i) feed.add(arm(10.0 + 0.02 * i, 0.3 * 0.02 * i, std::nullopt), {});
  feed.add(odometry(10.08, 0.0, 0.0, 0.0), {});
  ASSERT_TRUE(feed.newest());
  EXPECT_NEAR(feed.newest()->state.qdot[3], 0.3, 1e-6);
}

TEST(JointFeed, TurnsTheTwistOfTheBaseIntoTheWorld) {
  const double yaw = 0.75 * std::numbers::pi;
  for (const char* frame : {"base", "world"}) {
    Options told = cart_options();
    told.odometry->twist_in = frame;
    JointFeed feed = feed_of(told);
    feed.add(arm(10.0, 0.0, 0.0), {});
    feed.add(odometry(10.0, 0.0, 0.0, yaw, 0.2, -0.1, 0.4), {});
    const auto newest = feed.newest();
    ASSERT_TRUE(newest);
    const bool is_base = std::string(frame) == "base";
    EXPECT_NEAR(newest->state.qdot[0], is_base ? 0.2 * std::cos(yaw) + 0.1 * std::sin(yaw) : 0.2,
                1e-9);
    EXPECT_NEAR(newest->state.qdot[1], is_base ? 0.2 * std::sin(yaw) - 0.1 * std::cos(yaw) : -0.1,
                1e-9);
    EXPECT_NEAR(newest->state.qdot[2], 0.4, 1e-9);
  }
}

TEST(PlanarMotionOf, IsNothingWhereAFigureIsNone) {
  const double nan = std::nan("");
  EXPECT_TRUE(planar_motion_of(odometry(10.0, 1.0, 2.0, 0.5, 0.2, 0.0, 0.1), true));
  EXPECT_FALSE(planar_motion_of(odometry(10.0, 1.0, 2.0, 0.5, nan, 0.0, 0.1), true));
  EXPECT_FALSE(planar_motion_of(odometry(10.0, 1.0, 2.0, 0.5, 0.2, 0.0, nan), true));
  EXPECT_FALSE(planar_motion_of(odometry(10.0, nan, 2.0, 0.5, 0.2, 0.0, 0.1), true));
}

TEST(JointFeed, CountsTurnsOfTheBase) {
  JointFeed feed = feed_of();
  // Twice round, in messages that tell yaw within a turn.
  double yaw = 0.0;
  for (int i = 0; i <= 100; ++i) {
    yaw = 4.0 * std::numbers::pi * i / 100.0;
    feed.add(arm(10.0 + 0.02 * i, 0.0, 0.0), {});
    feed.add(odometry(10.0 + 0.02 * i, 0.0, 0.0, std::remainder(yaw, 2.0 * std::numbers::pi)), {});
  }
  ASSERT_TRUE(feed.newest());
  EXPECT_NEAR(feed.newest()->state.q[2], yaw, 1e-9);
}

TEST(JointFeed, NamesWhatIsMissingOldOrAheadOfTheClock) {
  JointFeed feed = feed_of();
  EXPECT_THAT(feed.trouble(at_s(10.0)).value_or(""), HasSubstr("no odometry has come on /odom"));
  feed.add(odometry(10.0, 0.0, 0.0, 0.0), at_s(10.0));
  EXPECT_THAT(feed.trouble(at_s(10.0)).value_or(""),
              HasSubstr("no joint state has come on /joints"));
  feed.add(arm(10.0, 0.0, 0.0), at_s(10.0));
  EXPECT_EQ(feed.trouble(at_s(10.1)), std::nullopt);
  EXPECT_EQ(feed.trouble(at_s(10.2)), std::nullopt);

  EXPECT_THAT(feed.trouble(at_s(10.21)).value_or(""),
              HasSubstr("the newest odometry of joint 'x' on /odom is 0.210 s old"));
  feed.add(odometry(10.21, 0.0, 0.0, 0.0), at_s(10.21));
  EXPECT_THAT(feed.trouble(at_s(10.21)).value_or(""),
              HasSubstr("the newest joint state of joint 'arm' on /joints is 0.210 s old"));
  // Messages come, of long ago.
  feed.add(arm(10.005, 0.0, 0.0), at_s(10.21));
  EXPECT_THAT(feed.trouble(at_s(10.21)).value_or(""), HasSubstr("though messages come"));

  feed.add(arm(10.5, 0.0, 0.0), at_s(10.21));
  EXPECT_THAT(feed.trouble(at_s(10.21)).value_or(""),
              HasSubstr("stamped 0.290 s ahead of this machine's clock"));
}

TEST(JointFeed, WhatIsNotANumberSaysNothing) {
  JointFeed feed = feed_of();
  feed.add(odometry(10.0, 0.0, 0.0, 0.0), at_s(10.0));
  feed.add(arm(10.0, std::numeric_limits<double>::quiet_NaN(), 0.0), at_s(10.0));
  EXPECT_FALSE(feed.newest());
  EXPECT_THAT(feed.trouble(at_s(10.0)).value_or(""), HasSubstr("does not tell of joint 'arm'"));
}

TEST(JointFeed, RefusesOdometryOfJointsThatTheRobotLacks) {
  Options told = cart_options();
  told.odometry->yaw_joint = "turn";
  const auto feed = JointFeed::create(cart(), told);
  ASSERT_FALSE(feed);
  EXPECT_THAT(feed.error().message, HasSubstr("'cart' has no joint 'turn'"));
}

}  // namespace
}  // namespace sidestep::ros1_executor
