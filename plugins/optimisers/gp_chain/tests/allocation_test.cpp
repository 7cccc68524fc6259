#include <gtest/gtest.h>

#include "conformance/optimiser_conformance.hpp"
#include "gp_chain.hpp"
#include "minimise.hpp"
#include "support/allocation_counter.hpp"

namespace sidestep {
namespace {

class WarmSolve : public testing::TestWithParam<std::string> {};

TEST_P(WarmSolve, TakesNothingFromTheHeap) {
  const Problem problem = conformance::reference_problem();
  const Trajectory initial = conformance::straight_line_of(problem);
  const auto rule = make_step_rule({.method = GetParam()});
  ChainModel model;
  const auto solve = [&] {
    model.reset(problem, initial);
    return minimise(model, *rule, {}, Deadline());
  };
  ASSERT_GT(solve().tried, 1);
  const int before = testing_support::allocations();
  const Minimisation warm = solve();
  EXPECT_EQ(testing_support::allocations() - before, 0);
  EXPECT_GT(warm.tried, 1);
}

INSTANTIATE_TEST_SUITE_P(GpChain, WarmSolve,
                         testing::Values("levenberg_marquardt", "gauss_newton", "dogleg"),
                         [](const auto& of) { return of.param; });

}  // namespace
}  // namespace sidestep
