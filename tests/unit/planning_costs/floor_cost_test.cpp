#include <cmath>
#include <limits>

#include <gtest/gtest.h>

#include <sidestep/planning/costs.hpp>

#include "conformance/cost_conformance.hpp"
#include "support/ball_robot.hpp"
#include "support/chain_robot.hpp"

namespace sidestep {
namespace {

using namespace conformance;
using testing_support::BallRobot;
using testing_support::mobile_arm;

States ball_at(double z_m) { return {3, {0.7, -0.4, z_m}, std::vector<double>(3), {0.0}}; }

TEST(FloorCost, IsTheHingeOfTheLowestPoint) {
  const auto cost = make_floor_cost(std::make_shared<BallRobot>(0.2), {0.5, {}}, 0.1, 0.05);
  EXPECT_EQ(cost->name(), "floor");
  ASSERT_EQ(cost->residual_count(), 1);
  EXPECT_FALSE(cost->depends_on_velocity());
  const Evaluation near = evaluate(*cost, ball_at(0.73));  // 0.03 m clear
  EXPECT_NEAR(near.residuals[0], (0.1 - 0.03) / 0.05, 1e-12);
  EXPECT_EQ(near.jacobian_q, (std::vector<double>{0.0, 0.0, -1.0 / 0.05}));
  EXPECT_NEAR(evaluate(*cost, ball_at(-1.0)).residuals[0], (0.1 + 1.7) / 0.05, 1e-12);
  EXPECT_EQ(evaluate(*cost, ball_at(0.81)).residuals[0], 0.0);
  EXPECT_EQ(evaluate(*cost, ball_at(0.81)).jacobian_q, std::vector<double>(3));
}

TEST(FloorCost, KeepsWhatIsNotANumber) {
  const auto cost = make_floor_cost(std::make_shared<BallRobot>(0.2), {0.0, {}}, 0.1, 0.05);
  EXPECT_TRUE(std::isnan(evaluate(*cost, ball_at(std::nan(""))).residuals[0]));
}

TEST(FloorCost, LeavesOutLinksThatMayStandOnTheFloor) {
  const auto robot = mobile_arm();
  const auto& spheres = robot->description().spheres;
  const Floor floor{0.3, {"base", "upper_arm"}};
  const auto cost = make_floor_cost(robot, floor, 0.2, 0.1);
  const States states = random_states(7, 40, 1.5, 1.0);
  const Evaluation all = evaluate(*cost, states, false);
  const auto m = static_cast<std::size_t>(cost->residual_count());
  ASSERT_EQ(m, 6u);  // of 10, two are of the base and two of the upper arm
  std::vector<Eigen::Vector3d> centres(spheres.size());
  Scratch scratch;
  int felt = 0;
  for (std::size_t i = 0; i < 40; ++i) {
    robot->sphere_centres(std::span(states.q).subspan(7 * i, 7), centres, scratch);
    std::size_t row = 0;
    for (std::size_t s = 0; s < spheres.size(); ++s) {
      if (spheres[s].link == 3 || spheres[s].link == 5) continue;
      const double clear_m = centres[s].z() - spheres[s].radius_m - 0.3;
      EXPECT_NEAR(all.residuals[i * m + row], std::max(0.0, 0.2 - clear_m) / 0.1, 1e-9);
      felt += clear_m < 0.2 ? 1 : 0;
      ++row;
    }
  }
  EXPECT_GT(felt, 20);
}

TEST(FloorCost, Conforms) {
  // Most states feel it at some spheres only.
  const auto cost = make_floor_cost(mobile_arm(), {0.1, {"base"}}, 0.2, 0.05);
  const States states = random_states(7, 61, 1.5, 1.0);
  expect_conforms(*cost, states);
  EXPECT_GT(states_next_to_kinks(*cost, states).count(), 20);
}

TEST(FloorClearance, IsTheHeightOfTheLowestPointWhereThereIsAFloor) {
  const auto robot = mobile_arm();
  SpacePolicy space;
  const Eigen::Vector3d centre_m(3.0, -2.0, 0.5);
  EXPECT_TRUE(std::isinf(FloorClearance(space, robot->description())(0, centre_m)));
  space.floor = Floor{0.1, {"base", "of another robot"}};
  const FloorClearance clearance(space, robot->description());
  EXPECT_EQ(clearance(1, centre_m), std::numeric_limits<double>::infinity());  // of the base
  EXPECT_NEAR(clearance(3, centre_m), 0.5 - 0.1 - 0.07, 1e-12);
  EXPECT_NEAR(clearance(9, {0.0, 0.0, -1.0}), -1.0 - 0.1 - 0.04, 1e-12);
}

}  // namespace
}  // namespace sidestep
