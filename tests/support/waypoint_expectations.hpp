#pragma once

#include <functional>
#include <memory>
#include <string>
#include <utility>
#include <vector>

#include <gtest/gtest.h>

#include "support/waypoint_problem.hpp"

namespace sidestep {

/// An optimiser over waypoints with its settings, from a straight line.
using WaypointSolve = std::function<Solution(const Problem&)>;

/// A cost other than those of obstacles counts as it is: a posture to the side of a line pulls it
/// as far as the prior of `derivative` lets it.
inline void expect_other_costs_count(const WaypointSolve& solve, int derivative) {
  Problem problem = disc_problem(21, {-1.0, 0.0}, {1.0, 0.0});
  const RobotState posture{Eigen::Vector2d(0.0, 0.5), Eigen::Vector2d::Zero()};
  auto pull =
      make_posture_cost(problem.robot->description(), posture.q, Eigen::Vector2d(9.0, 0.05));
  ASSERT_TRUE(pull) << pull.error().describe();
  problem.terms.push_back({std::move(*pull), Placement::kSupport});
  const Solution solution = solve(problem);
  ASSERT_EQ(solution.trajectory.size(), 21) << solution.reason;
  const Eigen::VectorXd expected = pulled_towards(0.5, 0.05, 21, derivative);
  ASSERT_GT(expected[9], 0.3);
  for (int i = 1; i < 20; ++i) {
    EXPECT_NEAR(solution.trajectory.q(i)[1], expected[i - 1], 1e-3) << "waypoint " << i;
  }
}

/// An optimiser that ends by its limit of iterations says so, and how many they were.
inline void expect_iteration_limit(const Solution& solution, int iterations) {
  EXPECT_EQ(solution.status, SolveStatus::kIterationLimit);
  EXPECT_EQ(solution.iterations, iterations);
  const std::string told = std::to_string(iterations) + " iterations";
  EXPECT_NE(solution.reason.find(told), std::string::npos) << solution.reason;
}

/// A disc with a ball in its way, nearer to one side.
inline Problem problem_with_a_ball() {
  Problem problem = disc_problem(41, {-1.0, 0.0}, {1.0, 0.0});
  problem.field = std::make_shared<conformance::BallField>(
      std::vector<conformance::Ball>{{{0.0, 0.1, 0.0}, 0.25}});
  return problem;
}

/// Optimisers that move waypoints between two ends refuse a goal that is left to costs, naming it.
inline void expect_free_goal_is_refused(const WaypointSolve& solve) {
  Problem problem = disc_problem(21, {-1.0, 0.0}, {1.0, 0.0});
  auto there = make_link_position_cost(problem.robot, "base", {1.0, 0.2, 0.0}, 1e-3);
  ASSERT_TRUE(there) << there.error().describe();
  problem.terms.push_back({std::move(*there), Placement::kGoal});
  const Solution solution = solve(problem);
  EXPECT_EQ(solution.status, SolveStatus::kNoPath);
  EXPECT_EQ(solution.trajectory.size(), 0);
  EXPECT_NE(solution.reason.find("'position_base'"), std::string::npos) << solution.reason;
}

}  // namespace sidestep
