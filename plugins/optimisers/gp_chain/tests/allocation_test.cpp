#include <gtest/gtest.h>

#include <sidestep/planning/costs.hpp>

#include "conformance/optimiser_conformance.hpp"
#include "gp_chain.hpp"
#include "minimise.hpp"
#include "support/allocation_counter.hpp"
#include "support/every_cost.hpp"

namespace sidestep {
namespace {

class WarmSolve : public testing::TestWithParam<std::string> {
 protected:
  static void expect_no_allocation(const Problem& problem, int least_tried,
                                   const std::optional<BodyChain::Base>& body = {}) {
    const Trajectory initial = conformance::straight_line_of(problem);
    const auto rule = make_step_rule({.method = GetParam()});
    ChainModel model;
    const auto solve = [&] {
      model.reset(problem, initial, body);
      return minimise(model, *rule, {}, Deadline());
    };
    ASSERT_GE(solve().tried, least_tried);
    const int before = testing_support::allocations();
    const Minimisation warm = solve();
    EXPECT_EQ(testing_support::allocations() - before, 0);
    EXPECT_GE(warm.tried, least_tried);
  }
};

TEST_P(WarmSolve, TakesNothingFromTheHeap) {
  expect_no_allocation(conformance::reference_problem(), 2);
}

TEST_P(WarmSolve, TakesNothingFromTheHeapWithEveryCost) {
  // Gauss-Newton gives up after one step.
  expect_no_allocation(testing_support::problem_of_every_cost(), 1);
}

TEST_P(WarmSolve, TakesNothingFromTheHeapWithThePriorOfABody) {
  expect_no_allocation(testing_support::problem_of_every_cost(), 1, BodyChain::Base{0, 1, 2});
}

/// The second goal change leads on from the first, whose goal term it takes the place of.
TEST(IncrementalSolve, TakesNothingFromTheHeap) {
  Problem problem = conformance::reference_problem();
  const Trajectory initial = conformance::straight_line_of(problem);
  const auto rule = make_step_rule({});
  ChainModel model;
  model.reset(problem, initial);
  ASSERT_GT(minimise(model, *rule, {}, Deadline()).tried, 1);
  model.keep(problem);
  std::vector<double> step;
  for (int change = 0; change < 3; ++change) {
    const Trajectory found = model.trajectory();
    problem.goal.q[0] += 0.05;
    for (CostTerm& term : problem.terms) {
      if (term.placement != Placement::kGoal) continue;
      term.cost = make_state_prior("goal", problem.goal, 1e-4);
    }
    const int before = testing_support::allocations();
    ASSERT_TRUE(model.resume(problem, found));
    const Minimisation end = settle(model, *rule, {}, Deadline(), step);
    model.keep(problem);
    const int taken = testing_support::allocations() - before;
    EXPECT_GE(end.tried, 1);
    if (change > 0) {
      EXPECT_EQ(taken, 0) << "change " << change;
    }
  }
}

INSTANTIATE_TEST_SUITE_P(GpChain, WarmSolve,
                         testing::Values("levenberg_marquardt", "gauss_newton", "dogleg"),
                         [](const auto& of) { return of.param; });

}  // namespace
}  // namespace sidestep
