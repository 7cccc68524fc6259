#include <sidestep/planning/problem.hpp>

#include <cmath>
#include <functional>
#include <limits>
#include <string>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "conformance/optimiser_conformance.hpp"

namespace sidestep {
namespace {

using testing::ElementsAre;
using testing::HasSubstr;

std::string message_after(const std::function<void(Problem&)>& change) {
  Problem problem = conformance::reference_problem();
  change(problem);
  const auto valid = problem.validate();
  if (valid) return "valid";
  EXPECT_EQ(valid.error().code, ErrorCode::kInvalidArgument);
  return valid.error().message;
}

TEST(ProblemValidate, AcceptsAProblem) {
  EXPECT_EQ(message_after([](Problem&) {}), "valid");
  EXPECT_EQ(message_after([](Problem& p) { p.field = nullptr; }), "valid");
}

TEST(ProblemValidate, NamesTheNumberThatMakesNoSense) {
  const double nan = std::nan("");
  EXPECT_THAT(message_after([](Problem& p) { p.robot = nullptr; }), HasSubstr("no robot"));
  EXPECT_THAT(message_after([](Problem& p) { p.support_states = 2; }), HasSubstr("not 2"));
  EXPECT_THAT(message_after([&](Problem& p) { p.dt_s = nan; }), HasSubstr("nan s"));
  EXPECT_THAT(message_after([](Problem& p) { p.dt_s = 0.0; }), HasSubstr("0 s"));
  EXPECT_THAT(message_after([](Problem& p) { p.interpolated_checks = -1; }),
              HasSubstr("interpolated checks"));
  EXPECT_THAT(message_after([](Problem& p) { p.speed_fraction = 1.5; }), HasSubstr("1.5"));
  EXPECT_THAT(message_after([&](Problem& p) { p.speed_fraction = nan; }), HasSubstr("(0, 1]"));
  EXPECT_THAT(message_after([](Problem& p) { p.collision_margin_m = -0.1; }), HasSubstr("-0.1"));
  EXPECT_THAT(message_after([](Problem& p) { p.qc = Eigen::Vector3d::Ones(); }),
              HasSubstr("3 values"));
  EXPECT_THAT(message_after([](Problem& p) { p.qc[2] = 0.0; }), HasSubstr("qc of joint joint_1"));
  EXPECT_THAT(message_after([](Problem& p) { p.terms.push_back({}); }), HasSubstr("missing"));
}

TEST(ProblemValidate, NamesTheJointThatBreaksItsLimits) {
  EXPECT_THAT(message_after([](Problem& p) { p.start.q[3] = 2.9; }),
              HasSubstr("joint joint_2 of the start is at 2.9, outside its limits [-2.8, 2.8]"));
  EXPECT_THAT(message_after([](Problem& p) { p.goal.q[0] = -6.0; }),
              HasSubstr("joint x of the goal"));
  EXPECT_THAT(message_after([](Problem& p) { p.start.qdot[1] = -1.2; }),
              HasSubstr("joint y of the start moves at -1.2"));
  EXPECT_THAT(message_after([](Problem& p) { p.goal.qdot[1] = std::nan(""); }),
              HasSubstr("joint y of the goal is not a finite number"));
  EXPECT_THAT(message_after([](Problem& p) { p.goal.q.conservativeResize(3); }),
              HasSubstr("3 positions"));
  // Within rounding of a limit is within it.
  EXPECT_EQ(message_after([](Problem& p) { p.start.q[3] = 2.8 + 1e-9; }), "valid");
}

std::vector<std::string> names(const std::vector<CostTerm>& terms) {
  std::vector<std::string> out;
  for (const CostTerm& term : terms) out.emplace_back(term.cost->name());
  return out;
}

TEST(StandardTerms, AreAllThere) {
  const auto terms = standard_terms(conformance::reference_problem(), {});
  EXPECT_THAT(names(terms), ElementsAre("start", "goal", "obstacle", "self_collision",
                                        "position_limit", "velocity_limit"));
  EXPECT_EQ(terms[0].placement, Placement::kStart);
  EXPECT_EQ(terms[1].placement, Placement::kGoal);
  EXPECT_EQ(terms[2].placement, Placement::kSupportAndInterpolated);
}

TEST(StandardTerms, HaveTheFloorWhereALinkIsKeptFromIt) {
  Problem problem = conformance::reference_problem();
  problem.space.floor = Floor{0.0, {"base"}};
  problem.collision_margin_m = 0.3;  // of a cost that else begins at 0.2 m
  auto terms = standard_terms(problem, {.epsilon_m = 0.2, .sigma_obstacle = 0.05});
  EXPECT_THAT(names(terms), ElementsAre("start", "goal", "obstacle", "floor", "self_collision",
                                        "position_limit", "velocity_limit"));
  EXPECT_EQ(terms[3].placement, Placement::kSupportAndInterpolated);
  // Two links of three spheres each, whose centres stay at the floor's height.
  std::vector<double> residuals(6), qdot(4);
  Scratch scratch;
  const std::vector<double> times_s{0.0};
  terms[3].cost->evaluate({1, 4, std::span(problem.start.q.data(), 4), qdot, times_s},
                          {residuals, {}, {}}, scratch);
  for (const double residual : residuals) EXPECT_NEAR(residual, (0.3 + 0.06) / 0.05, 1e-9);

  problem.field = nullptr;
  EXPECT_THAT(names(standard_terms(problem, {})), testing::Contains("floor"));
  problem.space.floor = Floor{0.0, {"base", "link_1", "link_2"}};
  EXPECT_THAT(names(standard_terms(problem, {})), testing::Not(testing::Contains("floor")));
}

TEST(StandardTerms, LeaveTheGoalConfigurationToOthers) {
  const auto terms =
      standard_terms(conformance::reference_problem(),
                     {.self_collision_placement = Placement::kSupport, .hold_goal = false});
  EXPECT_THAT(names(terms), ElementsAre("start", "goal_velocity", "obstacle", "self_collision",
                                        "position_limit", "velocity_limit"));
  EXPECT_EQ(terms[1].placement, Placement::kGoal);
  EXPECT_EQ(terms[3].placement, Placement::kSupport);
}

TEST(StandardTerms, LeaveOutWhatHasNoWeightOrNoSense) {
  Problem problem = conformance::reference_problem();
  problem.field = nullptr;
  const auto terms = standard_terms(
      problem,
      {.sigma_self_collision = 0.0, .sigma_position_limit = 0.0, .sigma_velocity_limit = 0.0});
  EXPECT_THAT(names(terms), ElementsAre("start", "goal"));
}

}  // namespace
}  // namespace sidestep
