#include <sidestep/planning/costs.hpp>

#include <cmath>
#include <numbers>
#include <utility>

#include <gtest/gtest.h>

#include "conformance/analytic_models.hpp"
#include "conformance/cost_conformance.hpp"

namespace sidestep {
namespace {

using namespace conformance;

const SpacePolicy kCautious{Space::kOccupied, Space::kOccupied};
const SpacePolicy kOptimistic{Space::kFree, Space::kFree};

std::shared_ptr<const PlanarRobot> arm(int joints, bool mobile = false) {
  return std::make_shared<PlanarRobot>(PlanarRobot::Shape{joints, mobile});
}

States still(std::vector<double> q) {
  const int dof = static_cast<int>(q.size());
  return {dof, std::move(q), std::vector<double>(static_cast<std::size_t>(dof)), {0.0}};
}

TEST(ObstacleCost, IsTheHingeOfTheSphereClearance) {
  // Stretched along x, the spheres of the first link stand at 0.05, 0.15 and 0.25 m.
  const auto field = std::make_shared<BallField>(std::vector<Ball>{{{0.15, 0.4, 0.0}, 0.1}});
  const auto cost = make_obstacle_cost(arm(1), field, kCautious, 0.25, 0.05);
  const Evaluation at = evaluate(*cost, still({0.0}));
  ASSERT_EQ(at.residuals.size(), 3u);
  const double clearance_m = 0.4 - 0.1 - 0.06;  // of the middle sphere
  EXPECT_NEAR(at.residuals[1], (0.25 - clearance_m) / 0.05, 1e-12);
  EXPECT_NEAR(at.jacobian_q[1], 0.15 / 0.05, 1e-12);  // turning by dq lifts it by 0.15 dq
  const double others_m = std::hypot(0.1, 0.4) - 0.1 - 0.06;
  EXPECT_EQ(at.residuals[0], std::max(0.0, (0.25 - others_m) / 0.05));
}

TEST(ObstacleCost, IsExactlyZeroOutOfReach) {
  const auto field = std::make_shared<BallField>(std::vector<Ball>{{{5.0, 5.0, 0.0}, 0.1}});
  const auto cost = make_obstacle_cost(arm(3), field, kCautious, 0.5, 0.05);
  for (const double residual : evaluate(*cost, random_states(3, 20, 3, 1)).residuals) {
    EXPECT_EQ(residual, 0.0);
  }
}

TEST(ObstacleCost, Conforms) {
  const auto field = std::make_shared<BallField>(
      std::vector<Ball>{{{0.4, 0.3, 0.1}, 0.2}, {{-0.5, -0.2, -0.1}, 0.3}});
  expect_conforms(*make_obstacle_cost(arm(4, true), field, kCautious, 0.3, 0.05),
                  random_states(6, 40, 1.5, 1.0), kSinglePrecision);
}

TEST(ObstacleCost, ConformsWhereTheFieldEnds) {
  // A field of +-1 m: most states are outside, where the policy makes the cost.
  const auto field = std::make_shared<BallField>(std::vector<Ball>{{{0.4, 0.3, 0.0}, 0.2}}, 1.0);
  const States states = random_states(4, 40, 2.5, 1.0);
  expect_conforms(*make_obstacle_cost(arm(2, true), field, kCautious, 0.3, 0.05), states,
                  kSinglePrecision);
  expect_conforms(*make_obstacle_cost(arm(2, true), field, kOptimistic, 0.3, 0.05), states,
                  kSinglePrecision);
}

TEST(ObstacleCost, KeepsWhatIsNotANumber) {
  const auto field = std::make_shared<BallField>(std::vector<Ball>{{{0.4, 0.3, 0.1}, 0.2}});
  const auto cost = make_obstacle_cost(arm(1), field, kCautious, std::nan(""), 0.05);
  EXPECT_TRUE(std::isnan(evaluate(*cost, still({0.3}), false).residuals[0]));
}

TEST(SelfCollisionCost, IsTheHingeOfTheClosestSpheres) {
  // Links 1 and 3 of a folded arm lie on each other but for the last joint's turn.
  const auto robot = arm(3);
  const auto cost = make_self_collision_cost(robot, 0.1, 0.02);
  ASSERT_EQ(cost->residual_count(), 3);  // base-2, base-3, 1-3; the base has no spheres
  const States folded = still({0.2, 2.5, 1.8});
  Scratch scratch;
  std::vector<Eigen::Vector3d> centres(9);
  robot->sphere_centres(folded.q, centres, scratch);
  double closest_m = 1e9;
  for (std::size_t a = 0; a < 3; ++a) {
    for (std::size_t b = 6; b < 9; ++b) {
      closest_m = std::min(closest_m, (centres[a] - centres[b]).norm());
    }
  }
  const double expected = (0.1 - (closest_m - 0.12)) / 0.02;
  ASSERT_GT(expected, 0.0);
  const Evaluation at = evaluate(*cost, folded);
  EXPECT_NEAR(at.residuals[2], expected, 1e-12);
  EXPECT_EQ(at.residuals[0], 0.0);
  for (const double residual : evaluate(*cost, still({0.0, 0.1, 0.1})).residuals) {
    EXPECT_EQ(residual, 0.0);
  }
}

TEST(SelfCollisionCost, Conforms) {
  expect_conforms(*make_self_collision_cost(arm(4, true), 0.1, 0.02),
                  random_states(6, 60, 2.8, 1.0));
}

TEST(PositionLimitCost, BeginsAMarginInsideTheLimits) {
  const auto cost = make_position_limit_cost(arm(1), 0.1, 0.02);  // +-2.8 rad
  EXPECT_EQ(evaluate(*cost, still({2.69})).residuals[0], 0.0);
  EXPECT_NEAR(evaluate(*cost, still({2.75})).residuals[0], 0.05 / 0.02, 1e-9);
  EXPECT_NEAR(evaluate(*cost, still({-2.9})).residuals[0], 0.2 / 0.02, 1e-9);
  EXPECT_EQ(evaluate(*cost, still({-2.9})).jacobian_q[0], -1.0 / 0.02);
  expect_conforms(*cost, random_states(1, 50, 4.0, 1.0));
}

TEST(PositionLimitCost, LeavesRoomWhereTheMarginExceedsTheRange) {
  const auto cost = make_position_limit_cost(arm(1), 10.0, 0.02);
  EXPECT_EQ(evaluate(*cost, still({0.0})).residuals[0], 0.0);
}

TEST(VelocityLimitCost, BeginsAtTheShareOfTheLimit) {
  const auto cost = make_velocity_limit_cost(arm(1), 0.5, 0.1);  // 0.5 * 1.5 rad/s
  States moving = still({0.0});
  moving.qdot[0] = 0.74;
  EXPECT_EQ(evaluate(*cost, moving).residuals[0], 0.0);
  moving.qdot[0] = -1.0;
  EXPECT_NEAR(evaluate(*cost, moving).residuals[0], 0.25 / 0.1, 1e-12);
  EXPECT_TRUE(cost->depends_on_velocity());
  expect_conforms(*make_velocity_limit_cost(arm(2, true), 0.5, 0.1),
                  random_states(4, 30, 1.0, 3.0));
}

TEST(SidewaysCost, IsTheSpeedAcrossTheWheels) {
  RobotDescription robot;
  robot.name = "cart";
  EXPECT_FALSE(make_sideways_cost(robot, 0.01));
  robot.rolling = RollingBase{1, 2, 0};
  EXPECT_FALSE(make_sideways_cost(robot, 0.0));
  const auto cost = make_sideways_cost(robot, 0.01);
  ASSERT_TRUE(cost) << cost.error().describe();
  States moving = still({0.5 * std::numbers::pi, 3.0, 4.0});  // it looks along y
  moving.qdot = {1.0, 0.2, 0.7};
  EXPECT_NEAR(evaluate(**cost, moving).residuals[0], -0.2 / 0.01, 1e-12);
  EXPECT_TRUE((*cost)->depends_on_velocity());
  expect_conforms(**cost, random_states(3, 50, 3.0, 2.0));
}

TEST(StatePrior, IsTheWhitenedDifference) {
  RobotState target{Eigen::Vector2d(0.5, -1.0), Eigen::Vector2d(0.1, 0.2)};
  const auto cost = make_state_prior("goal", std::move(target), 0.01);
  EXPECT_EQ(cost->name(), "goal");
  States at = still({0.6, -1.0});
  const Evaluation evaluation = evaluate(*cost, at);
  ASSERT_EQ(evaluation.residuals.size(), 4u);
  EXPECT_NEAR(evaluation.residuals[0], 10.0, 1e-9);
  EXPECT_NEAR(evaluation.residuals[1], 0.0, 1e-9);
  EXPECT_NEAR(evaluation.residuals[2], -10.0, 1e-9);
  EXPECT_NEAR(evaluation.residuals[3], -20.0, 1e-9);
  expect_conforms(*cost, random_states(2, 5, 1.0, 1.0));
}

}  // namespace
}  // namespace sidestep
