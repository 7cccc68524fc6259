#include <gtest/gtest.h>

#include <sidestep/planning/state_normals.hpp>

#include "conformance/cost_conformance.hpp"
#include "support/allocation_counter.hpp"
#include "support/every_cost.hpp"

namespace sidestep {
namespace {

using namespace conformance;

constexpr int kStates = 200;

TEST(EveryCost, DoesNotAllocateOnceItsScratchIsWarm) {
  const Problem problem = testing_support::problem_of_every_cost();
  const States states = random_states(6, kStates, 2.8, 3.0);
  for (const CostTerm& term : problem.terms) {
    const auto rows = static_cast<std::size_t>(kStates * term.cost->residual_count());
    std::vector<double> residuals(rows), by_q(6 * rows), by_qdot(6 * rows);
    Scratch scratch;
    term.cost->evaluate(states.batch(), {residuals, by_q, by_qdot}, scratch);
    const int before = testing_support::allocations();
    term.cost->evaluate(states.batch(), {residuals, by_q, by_qdot}, scratch);
    EXPECT_EQ(testing_support::allocations() - before, 0) << term.cost->name();
    EXPECT_GT(Eigen::Map<const Eigen::VectorXd>(residuals.data(), residuals.size()).norm(), 0.0)
        << term.cost->name();
  }
}

TEST(MovingObstacleCost, DoesNotAllocateOnceItsScratchIsWarm) {
  Problem problem = testing_support::problem_of_every_cost();
  std::vector<PredictedSet> walkers(2);
  for (std::size_t i = 0; i < 2; ++i) {
    walkers[i].top_m = 1.8;
    walkers[i].knots = {{0.0, {0.5, 0.0}, 0.3}, {9.0, {-1.5, 2.0 * static_cast<double>(i)}, 0.6}};
  }
  problem.prediction =
      std::make_shared<const Prediction>(Prediction::create({}, std::move(walkers)).value());
  const auto cost = make_moving_obstacle_cost(problem.robot, problem.prediction, 0.2, 0.3, 0.05);
  const States states = random_states(6, kStates, 2.8, 3.0);
  const auto rows = static_cast<std::size_t>(kStates * cost->residual_count());
  std::vector<double> residuals(rows), by_q(6 * rows), by_qdot(6 * rows);
  StateNormals normals;
  normals.resize(kStates, 6);
  Scratch scratch;
  int before = 0;
  double felt = 0.0;
  for (int round = 0; round < 2; ++round) {
    before = testing_support::allocations();
    cost->evaluate(states.batch(), {residuals, by_q, by_qdot}, scratch);
    felt = cost->linearise(states.batch(), {}, normals, scratch);
  }
  EXPECT_EQ(testing_support::allocations() - before, 0);
  EXPECT_GT(felt, 0.0);
}

TEST(EveryCost, DoesNotAllocateToLineariseOnceItsScratchIsWarm) {
  const Problem problem = testing_support::problem_of_every_cost();
  const States states = random_states(6, kStates, 2.8, 3.0);
  for (const CostTerm& term : problem.terms) {
    StateNormals normals;
    normals.resize(kStates, 6);
    Scratch scratch;
    const double cost = term.cost->linearise(states.batch(), {}, normals, scratch);
    const int before = testing_support::allocations();
    (void)term.cost->linearise(states.batch(), {}, normals, scratch);
    EXPECT_EQ(testing_support::allocations() - before, 0) << term.cost->name();
    EXPECT_GT(cost, 0.0) << term.cost->name();
  }
}

}  // namespace
}  // namespace sidestep
