#include "trajopt.hpp"

#include <algorithm>

#include <gtest/gtest.h>

#include "conformance/analytic_models.hpp"
#include "conformance/optimiser_conformance.hpp"
#include "support/waypoint_expectations.hpp"

namespace sidestep {
namespace {

using conformance::Ball;
using conformance::BallField;

Solution trajopt_solution(const Problem& problem, const TrajoptSettings& settings) {
  const auto solution =
      make_trajopt(settings)->solve(problem, conformance::straight_line_of(problem), Deadline());
  EXPECT_TRUE(solution.has_value());
  return solution.value_or(Solution{});
}

/// Least squared velocity, under a clearance: the shortest way around, at an even pace.
TEST(Trajopt, TakesTheShortestWayAroundABall) {
  Problem problem = disc_problem(41, {-1.0, 0.0}, {1.0, 0.0});
  problem.field = std::make_shared<BallField>(std::vector<Ball>{{{0.0, 0.1, 0.0}, 0.25}});
  const Solution solution = trajopt_solution(problem, {.keep_m = 0.02});
  ASSERT_EQ(solution.status, SolveStatus::kConverged) << solution.reason;
  EXPECT_GE(conformance::clearance_m(problem, solution.trajectory), 0.02 - 1e-3);
  const double shortest_m = shortest_around({-1.0, 0.0}, {1.0, 0.0}, {0.0, 0.1}, 0.42);
  EXPECT_NEAR(length_m(solution.trajectory), shortest_m, 0.01 * shortest_m);
  EXPECT_LT(solution.trajectory.q(20)[1], 0.0);
}

/// Both waypoints beside the ball are clear of it: only what is swept between them is not.
TEST(Trajopt, DoesNotJumpAThinObstacle) {
  Problem problem = disc_problem(5, {-2.0, 0.0}, {2.0, 0.0});
  problem.field = std::make_shared<BallField>(std::vector<Ball>{{{0.5, 0.05, 0.0}, 0.05}});
  const Trajectory line = conformance::straight_line_of(problem);
  for (int i = 0; i < 5; ++i) {
    ASSERT_GT(Eigen::Vector2d(line.q(i)[0] - 0.5, line.q(i)[1] - 0.05).norm(), 0.4);
  }
  ASSERT_LT(conformance::clearance_m(problem, line), 0.0);
  const Solution solution = trajopt_solution(problem, {});
  ASSERT_EQ(solution.status, SolveStatus::kConverged) << solution.reason;
  EXPECT_GT(conformance::clearance_m(problem, solution.trajectory), 0.0);
}

TEST(Trajopt, KeepsJointLimits) {
  Problem problem = disc_problem(41, {-1.0, -4.6}, {1.0, -4.6});
  problem.field = std::make_shared<BallField>(std::vector<Ball>{{{0.0, -4.4, 0.0}, 0.6}});
  const Solution solution = trajopt_solution(problem, {.limit_margin = 0.02});
  double lowest = 0.0;
  for (int i = 0; i < 41; ++i) lowest = std::min(lowest, solution.trajectory.q(i)[1]);
  EXPECT_GE(lowest, -4.98 - 1e-9);
  EXPECT_LT(lowest, -4.97);
  // Between ball and limit there are 0.02 m less than the disc needs.
  EXPECT_EQ(solution.status, SolveStatus::kIterationLimit);
  EXPECT_NE(solution.reason.find("nearer to an obstacle"), std::string::npos) << solution.reason;
}

TEST(Trajopt, HeedsEveryOtherCostOfTheProblem) {
  expect_other_costs_count([](const Problem& problem) { return trajopt_solution(problem, {}); }, 1);
}

TEST(Trajopt, SaysThatItRanOutOfIterations) {
  expect_iteration_limit(trajopt_solution(problem_with_a_ball(), {.max_iterations = 2}), 2);
}

TEST(Trajopt, ReachesAGoalThatOnlyCostsKnow) {
  expect_free_goal_is_reached([](const Problem& problem) { return trajopt_solution(problem, {}); });
}

}  // namespace
}  // namespace sidestep
