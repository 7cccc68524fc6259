#include "scissor_lift.hpp"

#include <numbers>

#include <gtest/gtest.h>

namespace {

using namespace sidestep;

TEST(ScissorLift, RisesWithTheSineOfItsAngle) {
  const scissor_lift::ScissorLift robot({.arm_m = 0.5, .stages = 3});
  std::vector<Transform> poses(robot.description().links.size());
  ASSERT_EQ(poses.size(), 5U);  // base, three stages, platform
  Scratch scratch;
  // At 30 degrees an arm spans half of its length: three of them 0.75 m, above a base of 0.5 m.
  const double q[] = {1.0, -2.0, std::numbers::pi / 6.0};
  robot.link_poses(q, poses, scratch);
  EXPECT_LT((poses[0].translation() - Eigen::Vector3d(1.0, -2.0, 0.0)).norm(), 1e-12);
  EXPECT_LT((poses[1].translation() - Eigen::Vector3d(1.0, -2.0, 0.625)).norm(), 1e-12);
  EXPECT_LT((poses[4].translation() - Eigen::Vector3d(1.0, -2.0, 1.25)).norm(), 1e-12);
}

TEST(ScissorLift, HasALoadThatHoldsThePlatform) {
  EXPECT_TRUE(scissor_lift::Options{}.check().empty());
  EXPECT_EQ((scissor_lift::Options{.arm_m = 0.5, .load_radius_m = 0.2}.check().size()), 1U);
}

}  // namespace
