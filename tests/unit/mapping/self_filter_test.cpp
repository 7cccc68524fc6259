#include <sidestep/mapping/self_filter.hpp>

#include <memory>
#include <random>

#include <gtest/gtest.h>

#include "support/ball_robot.hpp"

namespace sidestep {
namespace {

using testing_support::BallRobot;

TEST(SelfFilter, RemovesNothingWithoutRobotOrJointPositions) {
  Frame frame;
  SelfFilter none(nullptr, 0.1);
  frame.joint_positions = Eigen::VectorXd::Zero(3);
  ASSERT_TRUE(none.pose(frame));
  EXPECT_FALSE(none.contains(Eigen::Vector3d::Zero()));

  SelfFilter filter(std::make_shared<BallRobot>(0.5), 0.1);
  ASSERT_TRUE(filter.pose(frame));
  EXPECT_TRUE(filter.contains(Eigen::Vector3d::Zero()));
  frame.joint_positions.reset();
  ASSERT_TRUE(filter.pose(frame));
  EXPECT_FALSE(filter.contains(Eigen::Vector3d::Zero())) << "the pose before must be forgotten";
}

TEST(SelfFilter, ContainsTheInflatedBallAndNoMore) {
  SelfFilter filter(std::make_shared<BallRobot>(0.3), 0.05);
  const Eigen::Vector3d centre(1.0, -2.0, 0.5);
  Frame frame;
  frame.joint_positions = centre;
  ASSERT_TRUE(filter.pose(frame));
  std::mt19937 random(3);
  std::normal_distribution<double> normal;
  for (int i = 0; i < 1000; ++i) {
    const Eigen::Vector3d direction =
        Eigen::Vector3d(normal(random), normal(random), normal(random)).normalized();
    EXPECT_TRUE(filter.contains(centre + 0.3499 * direction));
    EXPECT_FALSE(filter.contains(centre + 0.3501 * direction));
  }
}

TEST(SelfFilter, NamesFrameAndRobotWhenJointPositionsDoNotFit) {
  SelfFilter filter(std::make_shared<BallRobot>(0.3), 0.0);
  Frame frame;
  frame.sequence = 9;
  frame.joint_positions = Eigen::VectorXd::Zero(5);
  const auto posed = filter.pose(frame);
  ASSERT_FALSE(posed);
  EXPECT_EQ(posed.error().code, ErrorCode::kBadFrame);
  EXPECT_EQ(posed.error().describe(),
            "frame 9: it has 5 joint positions, but robot 'ball' has 3 joints");
}

}  // namespace
}  // namespace sidestep
