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

/// A goal that is left to costs is reached in a configuration that they like; one that cannot be is
/// said to be missed, and by how much.
inline void expect_free_goal_is_reached(const WaypointSolve& solve) {
  Problem problem = disc_problem(21, {-1.0, 0.0}, {1.0, 0.0});
  const auto aim = [&](const Eigen::Vector3d& place_m) {
    auto there = make_link_position_cost(problem.robot, "base", place_m, 1e-3);
    ASSERT_TRUE(there) << there.error().describe();
    problem.terms = {{std::move(*there), Placement::kGoal}};
  };
  aim({1.0, 0.2, 0.0});
  const Solution solution = solve(problem);
  ASSERT_EQ(solution.trajectory.size(), 21) << solution.reason;
  EXPECT_NEAR(solution.trajectory.q(20)[0], 1.0, 3e-3);
  EXPECT_NEAR(solution.trajectory.q(20)[1], 0.2, 3e-3);
  aim({1.0, 0.2, 0.5});  // above the plane in which the disc moves
  const Solution none = solve(problem);
  EXPECT_EQ(none.status, SolveStatus::kNoPath);
  EXPECT_EQ(none.trajectory.size(), 0);
  EXPECT_NE(none.reason.find("position of base 0.5 m off"), std::string::npos) << none.reason;
}

}  // namespace sidestep
