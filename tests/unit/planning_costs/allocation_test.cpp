#include <gtest/gtest.h>

#include <sidestep/planning/costs.hpp>
#include <sidestep/planning/problem.hpp>

#include "conformance/analytic_models.hpp"
#include "conformance/cost_conformance.hpp"
#include "support/allocation_counter.hpp"

namespace sidestep {
namespace {

using namespace conformance;

TEST(StandardCosts, DoNotAllocateOnceTheScratchIsWarm) {
  Problem problem;
  problem.robot = std::make_shared<PlanarRobot>(PlanarRobot::Shape{4, true});
  problem.field = std::make_shared<BallField>(std::vector<Ball>{{{0.3, 0.2, 0.0}, 0.4}});
  problem.start = {Eigen::VectorXd::Zero(6), Eigen::VectorXd::Zero(6)};
  problem.goal = {Eigen::VectorXd::Ones(6), Eigen::VectorXd::Zero(6)};
  const auto terms = standard_terms(problem, {});
  ASSERT_EQ(terms.size(), 6u);
  const States states = random_states(6, 200, 2.8, 3.0);
  for (const CostTerm& term : terms) {
    const auto rows = static_cast<std::size_t>(200 * term.cost->residual_count());
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

}  // namespace
}  // namespace sidestep
