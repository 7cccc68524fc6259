#include "chomp.hpp"

#include <algorithm>

#include <gtest/gtest.h>

#include "conformance/analytic_models.hpp"
#include "conformance/optimiser_conformance.hpp"
#include "support/waypoint_expectations.hpp"

namespace sidestep {
namespace {

using conformance::Ball;
using conformance::BallField;

Solution chomp_solution(const Problem& problem, const ChompSettings& settings) {
  const auto solution =
      make_chomp(settings)->solve(problem, conformance::straight_line_of(problem), Deadline());
  EXPECT_TRUE(solution.has_value());
  return solution.value_or(Solution{});
}

TEST(Chomp, FindsTheCubicWhereNothingIsInTheWay) {
  Problem problem = disc_problem(61, {-1.0, 0.5}, {1.0, -0.3});
  problem.start.qdot << 0.2, -0.1;
  const Solution solution = chomp_solution(problem, {.relative_tolerance = 1e-9});
  ASSERT_EQ(solution.status, SolveStatus::kConverged) << solution.reason;
  Trajectory cubic = make_trajectory(2, 2, 4.0);
  Eigen::Map<Eigen::Vector2d>(cubic.q(0).data()) = problem.start.q;
  Eigen::Map<Eigen::Vector2d>(cubic.qdot(0).data()) = problem.start.qdot;
  Eigen::Map<Eigen::Vector2d>(cubic.q(1).data()) = problem.goal.q;
  std::vector<double> q(2), qdot(2);
  for (int i = 0; i < 61; ++i) {
    cubic.sample(i * problem.dt_s, q, qdot);
    for (std::size_t j = 0; j < 2; ++j) {
      EXPECT_NEAR(solution.trajectory.q(i)[j], q[j], 1e-3);
      EXPECT_NEAR(solution.trajectory.qdot(i)[j], qdot[j], 2e-3);
    }
  }
}

/// Against the shortest way there is, and a dense check of the clearance.
TEST(Chomp, PassesABallCloselyOnTheNearerSide) {
  Problem problem = disc_problem(41, {-1.0, 0.0}, {1.0, 0.0});
  problem.interpolated_checks = 2;
  problem.field = std::make_shared<BallField>(std::vector<Ball>{{{0.0, 0.1, 0.0}, 0.25}});
  const Solution solution =
      chomp_solution(problem, {.smoothness = "velocity", .obstacle_weight = 100.0});
  ASSERT_EQ(solution.status, SolveStatus::kConverged) << solution.reason;
  const double clearance_m = conformance::clearance_m(problem, solution.trajectory);
  EXPECT_GT(clearance_m, 0.0);
  EXPECT_LT(clearance_m, 0.05);  // epsilon
  EXPECT_LT(solution.trajectory.q(20)[1], 0.0);
  const double shortest_m = shortest_around({-1.0, 0.0}, {1.0, 0.0}, {0.0, 0.1}, 0.4);
  EXPECT_GT(length_m(solution.trajectory), shortest_m - 1e-3);
  EXPECT_LT(length_m(solution.trajectory), 1.03 * shortest_m);
}

/// The ball pushes the disc beyond its limit of -5 m; other side blocked by nothing.
TEST(Chomp, KeepsJointLimits) {
  Problem problem = disc_problem(41, {-1.0, -4.6}, {1.0, -4.6});
  problem.interpolated_checks = 2;
  problem.field = std::make_shared<BallField>(std::vector<Ball>{{{0.0, -4.4, 0.0}, 0.6}});
  const Solution solution = chomp_solution(problem, {.limit_margin = 0.02});
  double lowest = 0.0;
  for (int i = 0; i < 41; ++i) lowest = std::min(lowest, solution.trajectory.q(i)[1]);
  EXPECT_GE(lowest, -4.98);
  EXPECT_LT(lowest, -4.97);  // it would go further
}

TEST(Chomp, StartsFromTheTrajectoryThatItIsGiven) {
  Problem problem = disc_problem(41, {-1.0, 0.0}, {1.0, 0.0});
  problem.interpolated_checks = 2;
  problem.field = std::make_shared<BallField>(std::vector<Ball>{{{0.0, 0.05, 0.0}, 0.25}});
  Trajectory above = conformance::straight_line_of(problem);
  for (int i = 0; i < 41; ++i) above.q(i)[1] = 0.8 * std::sin(M_PI * i / 40.0);
  const auto solution = make_chomp({})->solve(problem, above, Deadline());
  ASSERT_TRUE(solution.has_value()) << solution.error().describe();
  EXPECT_GT(solution->trajectory.q(20)[1], 0.4);
  EXPECT_GT(conformance::clearance_m(problem, solution->trajectory), 0.0);
}

TEST(Chomp, HeedsEveryOtherCostOfTheProblem) {
  expect_other_costs_count(
      [](const Problem& problem) {
        return chomp_solution(problem, {.relative_tolerance = 1e-9, .max_iterations = 5000});
      },
      2);
}

TEST(Chomp, SaysThatItRanOutOfIterations) {
  expect_iteration_limit(chomp_solution(problem_with_a_ball(), {.max_iterations = 3}), 3);
}

TEST(Chomp, ReachesAGoalThatOnlyCostsKnow) {
  expect_free_goal_is_reached([](const Problem& problem) { return chomp_solution(problem, {}); });
}

}  // namespace
}  // namespace sidestep
