#include <algorithm>
#include <cmath>
#include <limits>
#include <memory>
#include <string>
#include <vector>

#include <gtest/gtest.h>

#include <sidestep/planning/costs.hpp>
#include <sidestep/planning/explain.hpp>

#include "conformance/cost_conformance.hpp"
#include "support/ball_robot.hpp"
#include "support/chain_robot.hpp"
#include "support/waypoint_problem.hpp"

namespace sidestep {
namespace {

using namespace conformance;
using testing_support::BallRobot;
using testing_support::mobile_arm;

/// One who walks along x at 1 m/s from the origin, growing by 0.1 m/s from 0.3 m, for 5 s.
std::shared_ptr<const Prediction> walker() {
  PredictedSet set;
  set.top_m = 1.8;
  set.knots = {{0.0, {0.0, 0.0}, 0.3}, {5.0, {5.0, 0.0}, 0.8}};
  return std::make_shared<const Prediction>(Prediction::create({}, {set}).value());
}

/// Three who cross where the arm is.
std::shared_ptr<const Prediction> crowd() {
  std::vector<PredictedSet> sets(3);
  for (std::size_t i = 0; i < 3; ++i) {
    const double side = static_cast<double>(i) - 1.0;
    sets[i].track = static_cast<std::int64_t>(i);
    sets[i].bottom_m = -0.2 * side;
    sets[i].top_m = 1.0 + 0.3 * side;
    sets[i].knots = {
        {-0.5, {-2.0, side}, 0.25}, {2.0, {0.3, 0.2 * side}, 0.3}, {9.0, {2.5 * side, -1.5}, 0.6}};
  }
  return std::make_shared<const Prediction>(Prediction::create({}, sets).value());
}

States ball_at(const Eigen::Vector3d& p_m, double time_s) {
  return {3, {p_m.x(), p_m.y(), p_m.z()}, std::vector<double>(3), {time_s}};
}

TEST(MovingObstacleCost, IsTheHingeOfTheDistanceAtTheStatesTime) {
  // The motion begins when the walker has gone for 1.5 s.
  const auto cost =
      make_moving_obstacle_cost(std::make_shared<BallRobot>(0.2), walker(), 1.5, 0.3, 0.05);
  EXPECT_EQ(cost->name(), "moving");
  ASSERT_EQ(cost->residual_count(), 1);
  EXPECT_FALSE(cost->depends_on_velocity());
  // After 0.5 s more the walker is at (2, 0), 0.5 m wide; the ball 0.25 m from it.
  const States beside = ball_at({2.0, -0.95, 1.0}, 0.5);
  EXPECT_NEAR(evaluate(*cost, beside).residuals[0], (0.3 - 0.25) / 0.05, 1e-9);
  EXPECT_NEAR(evaluate(*cost, beside).jacobian_q[1], 1.0 / 0.05, 1e-9);
  const States before_it = ball_at({3.0, 0.0, 1.0}, 0.5);
  EXPECT_EQ(evaluate(*cost, before_it).residuals[0], 0.0);
  EXPECT_EQ(evaluate(*cost, before_it).jacobian_q, std::vector<double>(3));
  // 0.6 s later it is 0.56 m wide and has come over the ball, the centre of which is 0.4 m off.
  EXPECT_NEAR(evaluate(*cost, ball_at({3.0, 0.0, 1.0}, 1.1)).residuals[0],
              (0.3 + 0.56 - 0.4 + 0.2) / 0.05, 1e-9);
  EXPECT_EQ(evaluate(*cost, ball_at({5.0, 0.0, 1.0}, 3.6)).residuals[0], 0.0);  // gone
  EXPECT_EQ(evaluate(*cost, ball_at({2.0, 0.0, 2.4}, 0.5)).residuals[0], 0.0);  // above
}

TEST(MovingObstacleCost, KeepsWhatIsNotANumber) {
  const auto cost =
      make_moving_obstacle_cost(std::make_shared<BallRobot>(0.2), walker(), 0.0, 0.3, 0.05);
  for (int axis = 0; axis < 3; ++axis) {
    Eigen::Vector3d p_m(50.0, 0.0, 1.0);
    p_m[axis] = std::nan("");
    EXPECT_TRUE(std::isnan(evaluate(*cost, ball_at(p_m, 0.0), false).residuals[0])) << axis;
  }
}

TEST(MovingObstacleCost, Conforms) {
  const auto cost = make_moving_obstacle_cost(mobile_arm(), crowd(), 0.3, 0.3, 0.05);
  const States states = random_states(7, 80, 1.5, 1.0);
  expect_conforms(*cost, states);
  EXPECT_GT(states_next_to_kinks(*cost, states).count(), 20);
}

TEST(StandardTerms, HaveATermOfWhatMovesOnlyWhereSomethingMayBe) {
  Problem problem = disc_problem(11, {-1.0, 0.0}, {1.0, 0.0});
  const auto moving_terms = [&] {
    const auto terms = standard_terms(problem, {});
    return std::ranges::count_if(terms, [](const CostTerm& term) {
      return term.cost->name() == "moving" && term.placement == Placement::kSupportAndInterpolated;
    });
  };
  EXPECT_EQ(moving_terms(), 0);
  problem.prediction = std::make_shared<const Prediction>();
  EXPECT_EQ(moving_terms(), 0);
  problem.prediction = walker();
  EXPECT_EQ(moving_terms(), 1);
  EXPECT_TRUE(problem.validate());
  CostSettings left_out;
  left_out.epsilon_moving_m = 0.0;
  EXPECT_EQ(standard_terms(problem, left_out).size() + 1, standard_terms(problem, {}).size());
  // It begins at the margin that is to be kept, at least: here 0.5 m from a ball of 0.15 m.
  problem.prediction_margin_m = 0.5;
  for (const CostTerm& term : standard_terms(problem, {})) {
    if (term.cost->name() != "moving") continue;
    const States beside{2, {0.0, 0.3 + 0.15 + 0.4}, {0.0, 0.0}, {0.0}};
    EXPECT_NEAR(evaluate(*term.cost, beside).residuals[0], 0.1 / 0.05, 1e-9);
  }
  problem.prediction_margin_m = -0.1;
  EXPECT_FALSE(problem.validate());
  problem.prediction_margin_m = 0.0;
  problem.prediction_from_s = std::nan("");
  EXPECT_FALSE(problem.validate());
}

TEST(Explain, NamesTheLinkThatComesNearToWhatMoves) {
  Problem problem = disc_problem(11, {-1.0, 0.0}, {1.0, 0.0});
  PredictedSet stands;
  stands.bottom_m = -1.0;
  stands.top_m = 1.0;
  stands.knots = {{0.0, {0.0, 0.3}, 0.3}, {9.0, {0.0, 0.3}, 0.3}};
  problem.prediction = std::make_shared<const Prediction>(Prediction::create({}, {stands}).value());
  problem.terms = standard_terms(problem, {});
  const auto explanation =
      explain(problem, straight_line(problem.start, problem.goal, 11, problem.dt_s));
  ASSERT_TRUE(explanation) << explanation.error().describe();
  const auto of_moving = std::ranges::find(explanation->hindrances, "moving", &Hindrance::term);
  ASSERT_NE(of_moving, explanation->hindrances.end());
  EXPECT_EQ(of_moving->subject, "base");
  EXPECT_EQ(of_moving->other, "its distance to what moves");
  EXPECT_EQ(of_moving->unit, "m");
  EXPECT_NEAR(of_moving->worst_s, 2.0, 1e-9);  // halfway, where it is 0.15 m within
  EXPECT_NEAR(of_moving->amount, 0.3 + 0.15, 1e-6);
}

}  // namespace
}  // namespace sidestep
