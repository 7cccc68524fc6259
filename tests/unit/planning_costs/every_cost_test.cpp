#include <gtest/gtest.h>

#include "conformance/cost_conformance.hpp"
#include "support/every_cost.hpp"

namespace sidestep {
namespace {

using namespace conformance;

TEST(EveryCost, ConformsAtRandomAndNextToItsKinks) {
  const Problem problem = testing_support::problem_of_every_cost();
  ASSERT_EQ(problem.terms.size(), 13u);
  for (const unsigned seed : {3u, 4u}) {
    const States states = random_states(6, 60, 3.0, 2.0, seed);
    for (const CostTerm& term : problem.terms) {
      expect_conforms(*term.cost, states,
                      term.cost->name() == "obstacle" ? kSinglePrecision : 1e-9);
    }
  }
}

TEST(EveryCost, HasItsKinksFound) {
  const Problem problem = testing_support::problem_of_every_cost();
  const States states = random_states(6, 60, 3.0, 2.0, 3);
  for (const CostTerm& term : problem.terms) {
    const States kinks = states_next_to_kinks(*term.cost, states);
    const bool is_hinge = term.cost->name() == "obstacle" || term.cost->name() == "floor" ||
                          term.cost->name() == "self_collision" ||
                          term.cost->name() == "position_limit" ||
                          term.cost->name() == "velocity_limit";
    EXPECT_EQ(kinks.count() > 20, is_hinge) << term.cost->name();
    EXPECT_EQ(kinks.count() > 0, is_hinge) << term.cost->name();
  }
}

}  // namespace
}  // namespace sidestep
