#include "robot_clearance.hpp"

#include <gtest/gtest.h>

#include "support/hsr.hpp"
#include "view_testing.hpp"

namespace sidestep {
namespace {

using testing_support::ball_world;
using testing_support::BallRobot;

std::vector<double> ball_at(double x, double y, double z) { return {x, y, z}; }

TEST(RobotClearance, IsThatToTheNearestObjectAtTheTime) {
  const ObservedWorld world = ball_world();
  RobotClearance clearance(world.robot, world.scene, ball_at(0.0, 0.0, 1.0));
  // The box spans x from 1.5 m; it moves along y by 1 m/s. The floor is 0.8 m below the ball.
  const auto near = clearance.find(ball_at(1.0, 2.0, 1.0), 2.0, nullptr);
  ASSERT_TRUE(near);
  EXPECT_NEAR(near->distance_m, 0.3, 1e-9);
  EXPECT_EQ(near->link, "ball");
  EXPECT_EQ(near->object, "box");
  EXPECT_LT((near->point_m - Eigen::Vector3d(1.2, 2.0, 1.0)).norm(), 1e-6);
  const auto later = clearance.find(ball_at(1.0, 0.0, 1.0), 4.0, nullptr);
  ASSERT_TRUE(later);
  EXPECT_NEAR(later->distance_m, 0.8, 1e-9);
  EXPECT_EQ(later->object, "floor");
  EXPECT_LT((later->point_m - Eigen::Vector3d(1.0, 0.0, 0.8)).norm(), 1e-6);
}

TEST(RobotClearance, WhatARobotStandsOnDoesNotCount) {
  const ObservedWorld world = ball_world();
  RobotClearance clearance(world.robot, world.scene, ball_at(0.0, 0.0, 0.2));
  const auto found = clearance.find(ball_at(0.0, 0.0, 0.2), 0.0, nullptr);
  ASSERT_TRUE(found);
  EXPECT_EQ(found->object, "box");
}

TEST(RobotClearance, ALinkThatKeepsItsHeightDoesNotCountAboveThePlane) {
  const auto hsr = testing_support::load_hsr();
  const SceneObject floor{
      "floor", HalfSpace{}, {{0.0, Transform::Identity()}}, false, std::nullopt};
  RobotClearance clearance(hsr, std::make_shared<const Scene>(std::vector<SceneObject>{floor}),
                           std::vector<double>(8, 0.0));
  EXPECT_EQ(clearance.find(std::vector<double>(8, 0.0), 0.0, nullptr)->link, "torso_lift_link");
  const std::vector<double> reaches_down{0.0, 0.0, 0.0, 0.15, -2.1, 0.0, -1.04, 0.0};
  EXPECT_TRUE(clearance.find(reaches_down, 0.0, nullptr)->link.starts_with("hand_"));
}

TEST(RobotClearance, WithoutASceneTheMapDecides) {
  RobotClearance clearance(std::make_shared<const BallRobot>(0.2), nullptr, ball_at(0, 0, 1));
  const auto field = testing_support::ball_field({0.5, 1.2, 1.1});
  EXPECT_FALSE(clearance.find(ball_at(0.0, 1.2, 1.1), 0.0, nullptr));
  // 0.65 m from the centre of a ball of 0.3 m.
  const auto found = clearance.find(ball_at(-0.15, 1.2, 1.1), 0.0, field.get());
  ASSERT_TRUE(found);
  EXPECT_EQ(found->object, "map");
  EXPECT_NEAR(found->distance_m, 0.15, 0.01);  // interpolated
  EXPECT_LT((found->point_m - Eigen::Vector3d(0.05, 1.2, 1.1)).norm(), 0.03);
  EXPECT_FALSE(clearance.find(ball_at(2.3, 1.2, 1.1), 0.0, field.get())) << "beyond the cut-off";
  EXPECT_FALSE(clearance.find(ball_at(-5.0, 1.2, 1.1), 0.0, field.get())) << "outside";
}

}  // namespace
}  // namespace sidestep
