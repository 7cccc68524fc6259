#include "chomp.hpp"

#include <cmath>

#include <gtest/gtest.h>

#include "conformance/analytic_models.hpp"
#include "support/waypoint_problem.hpp"

namespace sidestep {
namespace {

constexpr double kEpsilon_m = 0.3;

Problem ball_problem(int waypoints) {
  Problem problem = disc_problem(waypoints, {-1.0, 0.0}, {1.0, 0.0});
  problem.field = std::make_shared<conformance::BallField>(
      std::vector<conformance::Ball>{{{0.1, 0.3, 0.0}, 0.2}});
  return problem;
}

double value_of(const Problem& problem, const Waypoints& positions) {
  WaypointStates states(problem);
  states.update(positions);
  Waypoints ignored = Waypoints::Zero(positions.rows(), positions.cols());
  return ObstacleFunctional(problem, kEpsilon_m).add_gradient(states, 1.0, ignored);
}

TEST(ClearanceCost, IsSmoothWhereItsPiecesMeet) {
  constexpr double kStep = 1e-7;
  for (const double clearance_m : {-0.2, 0.0, 0.1, 0.3, 0.5}) {
    const auto below = clearance_cost(clearance_m - kStep, 0.3);
    const auto above = clearance_cost(clearance_m + kStep, 0.3);
    const auto [value, slope] = clearance_cost(clearance_m, 0.3);
    EXPECT_NEAR(above.value, below.value, 3.0 * kStep);
    EXPECT_NEAR(slope, (above.value - below.value) / (2.0 * kStep), 1e-6) << clearance_m;
  }
  EXPECT_DOUBLE_EQ(clearance_cost(-0.2, 0.3).value, 0.35);
  EXPECT_DOUBLE_EQ(clearance_cost(0.0, 0.3).value, 0.15);
  EXPECT_DOUBLE_EQ(clearance_cost(0.1, 0.3).value, 0.2 * 0.2 / 0.6);
}

/// By quadrature over the straight line that the disc's centre follows, at two paces.
TEST(ObstacleFunctional, IsTheCostAlongTheWayWhateverThePace) {
  double expected = 0.0;
  constexpr int kSteps = 200000;
  for (int i = 0; i < kSteps; ++i) {
    const double x = -1.0 + 2.0 * (i + 0.5) / kSteps;
    const double clearance_m = std::hypot(x - 0.1, 0.3) - 0.2 - kDiscRadius_m;
    const double within_m = std::max(0.0, kEpsilon_m - clearance_m);
    expected += 2.0 / kSteps *
                (clearance_m < 0.0 ? kEpsilon_m / 2.0 - clearance_m
                                   : within_m * within_m / (2.0 * kEpsilon_m));
  }
  const Problem problem = ball_problem(401);
  Waypoints even = Waypoints::Zero(2, 401), slow_at_ends = even;
  for (int i = 0; i < 401; ++i) {
    even(0, i) = -1.0 + i / 200.0;
    slow_at_ends(0, i) = -std::cos(M_PI * i / 400.0);
  }
  EXPECT_NEAR(value_of(problem, even), expected, 1e-4 * expected);
  EXPECT_NEAR(value_of(problem, slow_at_ends), expected, 1e-4 * expected);
}

TEST(ObstacleFunctional, FeelsTheFloorWhereThatIsNearer) {
  Problem problem = ball_problem(401);
  problem.space.floor = Floor{-0.2, {}};  // 0.05 m beneath the disc
  problem.field = nullptr;
  Waypoints even = Waypoints::Zero(2, 401);
  for (int i = 0; i < 401; ++i) even(0, i) = -1.0 + i / 200.0;
  EXPECT_NEAR(value_of(problem, even), 2.0 * 0.25 * 0.25 / 0.6, 2e-3);
}

TEST(ObstacleFunctional, HasTheGradientOfItsValue) {
  Problem problem;
  problem.robot = std::make_shared<conformance::PlanarRobot>(
      conformance::PlanarRobot::Shape{.rotary_joints = 2, .mobile = true});
  problem.field = std::make_shared<conformance::BallField>(
      std::vector<conformance::Ball>{{{0.2, 0.3, 0.1}, 0.2}, {{-0.4, -0.3, 0.0}, 0.1}});
  problem.start = {Eigen::Vector4d(-0.6, 0.0, 0.3, 0.4), Eigen::Vector4d::Zero()};
  problem.goal = {Eigen::Vector4d(0.5, 0.1, -0.6, 1.0), Eigen::Vector4d::Zero()};
  problem.support_states = 7;
  problem.dt_s = 0.3;
  problem.qc = Eigen::Vector4d::Ones();
  problem.interpolated_checks = 2;
  WaypointStates states(problem);
  Waypoints positions =
      states.positions_of(straight_line(problem.start, problem.goal, 7, problem.dt_s));
  std::srand(4);
  positions.middleCols(1, 5) += 0.1 * Waypoints::Random(4, 5);
  states.update(positions);
  Waypoints gradient = Waypoints::Zero(4, 7);
  const double value = ObstacleFunctional(problem, kEpsilon_m).add_gradient(states, 2.0, gradient);
  ASSERT_GT(value, 0.01);
  for (Eigen::Index i = 4; i < positions.size() - 4; ++i) {
    constexpr double kStep = 1e-6;
    const double at = positions(i);
    positions(i) = at + kStep;
    const double above = value_of(problem, positions);
    positions(i) = at - kStep;
    const double below = value_of(problem, positions);
    positions(i) = at;
    EXPECT_NEAR(gradient(i), 2.0 * (above - below) / (2.0 * kStep), 1e-6) << "value " << i;
  }
}

/// The functional gradient as the paper writes it, for a disc on a circular arc.
TEST(ObstacleFunctional, HasThePapersGradientWhereStepsAreShort) {
  constexpr int kWaypoints = 801;
  constexpr double kRadius_m = 1.0;
  const Problem problem = ball_problem(kWaypoints);
  Waypoints positions(2, kWaypoints);
  const auto at = [](double tau) {
    const double angle = M_PI * (1.0 - tau);
    return Eigen::Vector2d(kRadius_m * std::cos(angle), kRadius_m * std::sin(angle) - 0.75);
  };
  for (int i = 0; i < kWaypoints; ++i) positions.col(i) = at(i / (kWaypoints - 1.0));
  WaypointStates states(problem);
  states.update(positions);
  Waypoints gradient = Waypoints::Zero(2, kWaypoints);
  (void)ObstacleFunctional(problem, kEpsilon_m).add_gradient(states, 1.0, gradient);
  const double speed = M_PI * kRadius_m;  // over tau
  double largest = 0.0;
  for (int i = 2; i + 2 < kWaypoints; ++i) {
    const Eigen::Vector2d x = positions.col(i);
    const Eigen::Vector2d inwards = (Eigen::Vector2d(0.0, -0.75) - x).normalized();
    const Eigen::Vector2d along(-inwards.y(), inwards.x());
    const Eigen::Vector2d from_ball = x - Eigen::Vector2d(0.1, 0.3);
    const double clearance_m = from_ball.norm() - 0.2 - kDiscRadius_m;
    // Away from where the pieces of the cost meet, at which the discrete gradient is between two.
    if (std::abs(clearance_m) < 0.01 || std::abs(clearance_m - kEpsilon_m) < 0.01) continue;
    const auto [cost, slope] = clearance_cost(clearance_m, kEpsilon_m);
    const Eigen::Vector2d by_x = slope * from_ball.normalized();
    const Eigen::Vector2d curvature = inwards / kRadius_m;
    const Eigen::Vector2d expected = speed * (by_x - along * along.dot(by_x) - cost * curvature);
    EXPECT_LT((gradient.col(i) * (kWaypoints - 1.0) - expected).norm(), 5e-3) << "waypoint " << i;
    largest = std::max(largest, expected.norm());
  }
  EXPECT_GT(largest, 0.5);
}

TEST(ObstacleFunctional, DoesNotFeelWhatStandsStill) {
  const Problem problem = ball_problem(9);
  Waypoints positions = Waypoints::Zero(2, 9);
  positions.row(0).setConstant(0.1);
  positions.row(1).setConstant(0.2);
  EXPECT_EQ(value_of(problem, positions), 0.0);
}

}  // namespace
}  // namespace sidestep
