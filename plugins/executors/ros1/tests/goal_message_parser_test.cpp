#include "goals.hpp"

#include <cmath>
#include <limits>
#include <numbers>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "support/hsr.hpp"

namespace sidestep::ros1_executor {
namespace {

using ::testing::HasSubstr;

class Wishes : public ::testing::Test {
 protected:
  Wishes() {
    options_.odometry = OdometryOptions{};
    options_.goals = GoalOptions{};
    options_.keep_in = KeepInBox{{-1.0, -2.0}, {3.0, 2.0}};
  }
  [[nodiscard]] GoalMessageParser wishes() const {
    auto made = GoalMessageParser::create(robot_, options_);
    EXPECT_TRUE(made) << made.error().describe();
    return std::move(*made);
  }
  static Transform pose(double x, double y, double yaw) {
    return transform_from_xyz_rpy({x, y, 0.0}, {0.0, 0.0, yaw});
  }
  static double joint_of(const Node& wish, const char* name) {
    return *wish.find("goal")->find("joints")->find(name)->as_double();
  }
  /// Near by several turns to the left.
  static Eigen::VectorXd turned_by(double yaw) {
    Eigen::VectorXd q = Eigen::VectorXd::Zero(8);
    q[2] = yaw;
    return q;
  }

  std::shared_ptr<const RobotModel> robot_ = testing_support::load_hsr();
  Options options_;
};

TEST_F(Wishes, OfTheBaseGoTheShorterWayRound) {
  const double pi = std::numbers::pi;
  const auto wish = wishes().base_pose(pose(1.5, -0.5, -3.0), turned_by(2.0 * pi + 3.0));
  ASSERT_TRUE(wish) << wish.error().describe();
  EXPECT_EQ(joint_of(*wish, "odom_x"), 1.5);
  EXPECT_EQ(joint_of(*wish, "odom_y"), -0.5);
  // -3 is 2 pi - 6 = 0.28 on from 3.
  EXPECT_NEAR(joint_of(*wish, "odom_t"), 2.0 * pi + 3.0 + (2.0 * pi - 6.0), 1e-9);
  EXPECT_EQ(wish->find("goal")->find("joints")->entries().size(), 3U);
}

TEST_F(Wishes, OfTheBaseAreLevelAndWithinTheBox) {
  const Eigen::VectorXd q = turned_by(0.0);
  const auto outside = wishes().base_pose(pose(1.0, 2.1, 0.0), q);
  ASSERT_FALSE(outside);
  EXPECT_THAT(outside.error().describe(), HasSubstr("odom_y at 2.1 m, the box is -2 to 2 m"));
  Transform tilted = pose(1.0, 0.0, 0.0);
  tilted.rotate(Eigen::AngleAxisd(0.2, Eigen::Vector3d::UnitY()));
  const auto lying = wishes().base_pose(tilted, q);
  ASSERT_FALSE(lying);
  EXPECT_THAT(lying.error().message, HasSubstr("tilted by 0.2 rad"));
  options_.odometry.reset();
  options_.keep_in.reset();
  EXPECT_FALSE(wishes().base_pose(pose(1.0, 0.0, 0.0), q)) << "there is no base";
}

/// For all turns, those at which roll and yaw are one included.
TEST_F(Wishes, OfTheEndEffectorSayTheRotationTheyWereGiven) {
  const GoalMessageParser made = wishes();
  for (const double roll : {-2.9, 0.0, 1.1}) {
    for (const double pitch : {-std::numbers::pi / 2, -0.4, 0.0, std::numbers::pi / 2}) {
      for (const double yaw : {-3.1, 0.0, 0.7}) {
        const Transform T = transform_from_xyz_rpy({0.4, -0.2, 0.9}, {roll, pitch, yaw});
        const auto wish = made.end_effector(T, turned_by(0.0));
        ASSERT_TRUE(wish);
        const Node& target = *wish->find("end_effector");
        EXPECT_EQ(target.find("link")->text(), "hand_palm_link");
        const auto xyz = target.find("position_m")->as_doubles(3);
        const auto rpy = target.find("rpy_rad")->as_doubles(3);
        ASSERT_TRUE(xyz && rpy);
        const Transform said = transform_from_xyz_rpy({(*xyz)[0], (*xyz)[1], (*xyz)[2]},
                                                      {(*rpy)[0], (*rpy)[1], (*rpy)[2]});
        EXPECT_TRUE(said.isApprox(T, 1e-6)) << roll << " " << pitch << " " << yaw;
      }
    }
  }
  options_.goals->end_effector_turns = false;
  const auto free = wishes().end_effector(pose(0.4, 0.0, 0.3), turned_by(0.0));
  ASSERT_TRUE(free);
  EXPECT_EQ(free->find("end_effector")->find("rpy_rad"), nullptr);
}

TEST_F(Wishes, OfJointsHoldWhatTheMessageSays) {
  ros_messages::JointState message;
  message.name = {"arm_flex_joint", "odom_x"};
  message.position = {-1.25, 2.5};
  const auto wish = wishes().joints(message);
  ASSERT_TRUE(wish) << wish.error().describe();
  EXPECT_EQ(joint_of(*wish, "arm_flex_joint"), -1.25);
  EXPECT_EQ(joint_of(*wish, "odom_x"), 2.5);

  const auto refused = [&](const char* why) {
    const auto made = wishes().joints(message);
    ASSERT_FALSE(made) << why;
    EXPECT_THAT(made.error().describe(), HasSubstr(why));
    EXPECT_EQ(made.error().where, "/sidestep/goal/joints");
  };
  message.position[1] = 3.5;
  refused("odom_x at 3.5 m, the box is -1 to 3 m");
  message.position[1] = std::numeric_limits<double>::infinity();
  refused("joint 'odom_x' is not finite");
  message.position.pop_back();
  refused("it names 2 joints, and has 1 positions");
  message.name = {"odom_x", "odom_x"};
  message.position = {0.0, 0.0};
  refused("names joint 'odom_x' twice");
  message.name.clear();
  message.position.clear();
  refused("it names no joint");
}

TEST_F(Wishes, NeedTheLinkThatOptionsName) {
  options_.goals->end_effector_link = "tail";
  EXPECT_FALSE(GoalMessageParser::create(robot_, options_));
  options_.goals->end_effector_topic.clear();
  EXPECT_TRUE(GoalMessageParser::create(robot_, options_)) << "nobody may ask for it";
}

}  // namespace
}  // namespace sidestep::ros1_executor
