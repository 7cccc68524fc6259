#include <cmath>
#include <memory>
#include <random>

#include <gtest/gtest.h>

#include <sidestep/planning/prediction_check.hpp>
#include <sidestep/trajectory/trajectory.hpp>

#include "space_time.hpp"
#include "support/ball_robot.hpp"

namespace sidestep {
namespace {

constexpr double kRadius_m = 0.3;
constexpr double kMargin_m = 0.1;

Eigen::Vector3d at(double x, double y) { return {x, y, 0.9}; }

/// A ball that moves at 1 m/s and 1 m/s^2 in a plane in which nothing stands.
Problem problem_of(const Eigen::Vector3d& from, const Eigen::Vector3d& to) {
  Problem problem;
  problem.robot = std::make_shared<testing_support::BallRobot>(kRadius_m);
  problem.space = {Space::kFree, Space::kFree};
  problem.start = {from, Eigen::Vector3d::Zero()};
  problem.goal = {to, Eigen::Vector3d::Zero()};
  problem.support_states = 11;
  problem.dt_s = 1.0;
  problem.qc = Eigen::Vector3d::Ones();
  problem.prediction_margin_m = kMargin_m;
  return problem;
}

Solution solve(const Problem& problem) {
  const auto planner = make_space_time({});
  const auto solution = planner->solve(
      problem, straight_line(problem.start, problem.goal, problem.support_states, problem.dt_s),
      Deadline());
  EXPECT_TRUE(solution.has_value());
  return *solution;
}

std::shared_ptr<const Prediction> walkers(std::vector<PredictedSet> sets) {
  return std::make_shared<const Prediction>(*Prediction::create(Stamp{}, std::move(sets)));
}

PredictedSet walker(std::int64_t track, const Eigen::Vector2d& from_m,
                    const Eigen::Vector2d& velocity_mps, double until_s) {
  return {
      track, 1.0, 0.0, 1.8, {{0.0, from_m, 0.3}, {until_s, from_m + until_s * velocity_mps, 0.3}}};
}

/// From the sets' own definition, sampled densely.
double least_clearance_m(const Trajectory& motion, const Prediction& prediction) {
  double least_m = std::numeric_limits<double>::infinity();
  std::vector<double> q(3);
  for (double t = 0.0; t <= motion.duration_s(); t += 1e-3) {
    motion.sample(t, q, {});
    for (const PredictedSet& set : prediction.sets()) {
      const auto &a = set.knots.front(), &b = set.knots.back();
      if (t > b.time_s) continue;
      const Eigen::Vector2d centre_m = a.centre_m + t / b.time_s * (b.centre_m - a.centre_m);
      least_m = std::min(least_m, (Eigen::Vector2d(q[0], q[1]) - centre_m).norm() - 0.3);
    }
  }
  return least_m - kRadius_m;
}

const MotionLimits kLimits{{1.0, 1.0, 1.0}, {1.0, 1.0, 1.0}, {}};

TEST(SpaceTime, GoesStraightAndAsFastAsTheLimitsLetWhereNothingIsInTheWay) {
  const Solution solution = solve(problem_of(at(0, 0), at(6, 0)));
  ASSERT_EQ(solution.status, SolveStatus::kConverged);
  EXPECT_NEAR(solution.trajectory.duration_s(), 6.0 / 1.0 + 1.0, 1e-6);
  EXPECT_TRUE(keeps_limits(solution.trajectory, kLimits));
  // Too short a way for full speed.
  EXPECT_NEAR(solve(problem_of(at(0, 0), at(0, 0.36))).trajectory.duration_s(),
              2.0 * std::sqrt(0.36), 0.002);
  // It is there already, or has to come back.
  EXPECT_EQ(solve(problem_of(at(1, 1), at(1, 1))).status, SolveStatus::kConverged);
  Problem past = problem_of(at(0, 0), at(0.1, 0));
  past.start.qdot.x() = 1.0;
  const Solution back = solve(past);
  EXPECT_TRUE(keeps_limits(back.trajectory, kLimits));
  EXPECT_NEAR(back.trajectory.duration_s(), 1.0 + 2.0 * std::sqrt(0.4), 0.01);
}

TEST(SpaceTime, TakesOverAtTheStartsVelocity) {
  Problem problem = problem_of(at(0, 0), at(5, 0));
  problem.start.qdot = Eigen::Vector3d(0.2, 0.7, 0.0);
  const Solution solution = solve(problem);
  ASSERT_EQ(solution.status, SolveStatus::kConverged);
  EXPECT_NEAR(solution.trajectory.qdot(0)[1], 0.7, 1e-12);
  const int last = solution.trajectory.size() - 1;
  EXPECT_NEAR(solution.trajectory.q(last)[0], 5.0, 1e-12);
  EXPECT_NEAR(solution.trajectory.q(last)[1], 0.0, 1e-12);
  EXPECT_EQ(solution.trajectory.qdot(last)[0], 0.0);
  EXPECT_TRUE(keeps_limits(solution.trajectory, kLimits));
}

TEST(SpaceTime, KeepsClearOfWhoeverWalksThere) {
  std::mt19937 random(3);
  std::uniform_real_distribution<double> angle(-M_PI, M_PI), speed(0.3, 1.4);
  int blocked = 0;
  for (int scene = 0; scene < 40; ++scene) {
    // Five people cross a circle of 4 m, as the robot does.
    std::vector<PredictedSet> sets;
    for (int person = 0; person < 5; ++person) {
      const double a = angle(random);
      const Eigen::Vector2d from = 4.0 * Eigen::Vector2d(std::cos(a), std::sin(a));
      if ((from - Eigen::Vector2d(0, -4)).norm() < 1.5) continue;
      sets.push_back(walker(person, from, -speed(random) / 4.0 * from, 8.0));
    }
    Problem problem = problem_of(at(0, -4), at(0, 4));
    problem.prediction = walkers(std::move(sets));
    const PredictionCheck check(problem.robot, kMargin_m);
    const Solution straight = solve(problem_of(at(0, -4), at(0, 4)));
    const bool is_blocked =
        check.first_conflict(straight.trajectory, 0.0, {problem.prediction, 0.0}).has_value();
    blocked += is_blocked ? 1 : 0;
    const Solution solution = solve(problem);
    ASSERT_EQ(solution.status, SolveStatus::kConverged) << scene << " " << solution.reason;
    EXPECT_GE(least_clearance_m(solution.trajectory, *problem.prediction), kMargin_m) << scene;
    EXPECT_TRUE(keeps_limits(solution.trajectory, kLimits)) << scene;
    if (!is_blocked) {
      EXPECT_NEAR(solution.trajectory.duration_s(), 9.0, 0.5) << scene;
    }
    EXPECT_LT(solution.trajectory.duration_s(), 15.0) << scene;
  }
  EXPECT_GT(blocked, 20) << "the scenes are no test of anything";
}

TEST(SpaceTime, IsTheSameEveryTime) {
  Problem problem = problem_of(at(0, -4), at(0, 4));
  problem.prediction = walkers({walker(1, {0.5, 4.0}, {-0.1, -1.0}, 8.0)});
  const Solution first = solve(problem), second = solve(problem);
  EXPECT_EQ(first.trajectory.positions, second.trajectory.positions);
  EXPECT_EQ(first.iterations, second.iterations);
}

TEST(SpaceTime, SaysWhenItHasNoBaseToMoveOrNoTime) {
  Problem problem = problem_of(at(0, 0), at(1, 0));
  const auto planner = make_space_time({});
  const Trajectory guess =
      straight_line(problem.start, problem.goal, problem.support_states, problem.dt_s);
  const auto late = planner->solve(problem, guess, Deadline::after_s(0.0));
  ASSERT_TRUE(late.has_value());
  EXPECT_EQ(late->status, SolveStatus::kDeadline);
  EXPECT_EQ(late->trajectory.size(), 0);
}

}  // namespace
}  // namespace sidestep
