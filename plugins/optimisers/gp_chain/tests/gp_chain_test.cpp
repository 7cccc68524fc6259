#include "gp_chain.hpp"

#include <gtest/gtest.h>

#include <sidestep/core/index.hpp>
#include <sidestep/planning/costs.hpp>

#include "conformance/analytic_models.hpp"
#include "conformance/localiser_conformance.hpp"
#include "conformance/optimiser_conformance.hpp"
#include "support/joint_cost.hpp"

namespace sidestep {
namespace {

using conformance::reference_problem;
using conformance::straight_line_of;

Problem problem_without_costs() {
  Problem problem = reference_problem();
  problem.start.qdot = Eigen::Vector4d(0.1, 0.0, -0.2, 0.3);
  problem.goal.qdot = Eigen::Vector4d(0.0, 0.2, 0.1, 0.0);
  problem.qc = Eigen::Vector4d(1.0, 0.5, 2.0, 1.5);
  problem.terms.clear();
  return problem;
}

class GpChainMethods : public testing::TestWithParam<std::string> {
 protected:
  std::unique_ptr<Optimiser> optimiser_ = make_gp_chain({.method = GetParam()});
};

/// The prior's mean between two fixed states is the cubic through them: least squares over the
/// support states must find it, whatever their number.
TEST_P(GpChainMethods, FindsTheCubicWhereThereIsNoCost) {
  const Problem problem = problem_without_costs();
  const auto optimiser =
      make_gp_chain({.method = GetParam(), .relative_tolerance = 0.0, .absolute_tolerance = 1e-14});
  const auto solution = optimiser->solve(problem, straight_line_of(problem), Deadline());
  ASSERT_TRUE(solution.has_value()) << solution.error().describe();
  const double duration_s = (problem.support_states - 1) * problem.dt_s;
  const Trajectory cubic = straight_line(problem.start, problem.goal, 2, duration_s);
  std::vector<double> q(4), qdot(4);
  for (int i = 0; i < problem.support_states; ++i) {
    cubic.sample(problem.dt_s * i, q, qdot);
    for (std::size_t j = 0; j < 4; ++j) {
      EXPECT_NEAR(solution->trajectory.q(i)[j], q[j], 1e-6) << "state " << i;
      EXPECT_NEAR(solution->trajectory.qdot(i)[j], qdot[j], 1e-6) << "state " << i;
    }
  }
}

TEST_P(GpChainMethods, HoldsAnEndThatNoTermHolds) {
  Problem problem = problem_without_costs();
  problem.terms.push_back({make_state_prior("goal", problem.goal, 1e-4), Placement::kGoal});
  Trajectory initial = straight_line_of(problem);
  initial.q(0)[0] += 0.1;  // a guess need not begin at the start
  const auto solution = optimiser_->solve(problem, initial, Deadline());
  ASSERT_TRUE(solution.has_value()) << solution.error().describe();
  for (std::size_t j = 0; j < 4; ++j) {
    EXPECT_EQ(solution->trajectory.q(0)[j], problem.start.q[static_cast<Eigen::Index>(j)]);
    EXPECT_EQ(solution->trajectory.qdot(0)[j], problem.start.qdot[static_cast<Eigen::Index>(j)]);
  }
}

/// Ends between which a base can drive an arc at even speeds: to its body's prior nothing is
/// better, whatever the first guess.
TEST_P(GpChainMethods, DrivesTheArcWhereThePriorIsOnTheBody) {
  constexpr double kSpeed_mps = 0.5, kTurn_radps = 0.6, kRadius_m = kSpeed_mps / kTurn_radps;
  Problem problem;
  problem.robot = conformance::turning_robot();
  problem.field = std::make_shared<conformance::BallField>(std::vector<conformance::Ball>{});
  problem.support_states = 6;
  problem.dt_s = 0.5;
  problem.qc = Eigen::Vector3d(1.0, 0.5, 2.0);
  const auto at = [&](double time_s) {
    const double yaw = -0.3 + kTurn_radps * time_s;
    return RobotState{
        Eigen::Vector3d(kRadius_m * std::sin(yaw), -kRadius_m * std::cos(yaw), yaw),
        Eigen::Vector3d(kSpeed_mps * std::cos(yaw), kSpeed_mps * std::sin(yaw), kTurn_radps)};
  };
  problem.start = at(0.0);
  problem.goal = at((problem.support_states - 1) * problem.dt_s);
  const auto optimiser = make_gp_chain({.method = GetParam(),
                                        .relative_tolerance = 0.0,
                                        .absolute_tolerance = 1e-14,
                                        .base_prior = "body"});
  const auto solution = optimiser->solve(problem, straight_line_of(problem), Deadline());
  ASSERT_TRUE(solution.has_value()) << solution.error().describe();
  EXPECT_LT(solution->cost, 1e-12);
  for (int i = 0; i < problem.support_states; ++i) {
    const RobotState arc = at(i * problem.dt_s);
    for (Eigen::Index j = 0; j < 3; ++j) {
      EXPECT_NEAR(solution->trajectory.q(i)[idx(j)], arc.q[j], 1e-6) << "state " << i;
      EXPECT_NEAR(solution->trajectory.qdot(i)[idx(j)], arc.qdot[j], 1e-6) << "state " << i;
    }
  }
}

TEST_P(GpChainMethods, SaysThatItRanOutOfIterations) {
  const Problem problem = reference_problem();
  const auto solution = make_gp_chain({.method = GetParam(), .max_iterations = 1})
                            ->solve(problem, straight_line_of(problem), Deadline());
  ASSERT_TRUE(solution.has_value()) << solution.error().describe();
  EXPECT_EQ(solution->status, SolveStatus::kIterationLimit);
  EXPECT_NE(solution->reason.find("1 iterations"), std::string::npos) << solution->reason;
  EXPECT_LT(solution->cost, solution->initial_cost);
}

INSTANTIATE_TEST_SUITE_P(GpChain, GpChainMethods,
                         testing::Values("levenberg_marquardt", "gauss_newton", "dogleg"),
                         [](const auto& of) { return of.param; });

/// Degenerate problems end in a status that says so, or in an answer.
class GpChainDegenerate : public testing::Test {
 protected:
  Result<Solution> solve(const Problem& problem) {
    return make_gp_chain({})->solve(problem, straight_line_of(problem), Deadline());
  }
};

TEST_F(GpChainDegenerate, TwoStatesAreRefused) {
  Problem problem = reference_problem();
  problem.support_states = 2;
  const auto solution = solve(problem);
  ASSERT_FALSE(solution.has_value());
  EXPECT_EQ(solution.error().code, ErrorCode::kInvalidArgument);
}

TEST_F(GpChainDegenerate, APriorOnTheBodyOfNoBaseIsRefused) {
  Problem problem = reference_problem();
  problem.robot =
      std::make_shared<conformance::PlanarRobot>(conformance::PlanarRobot::Shape{4, false, 4});
  const auto solution =
      make_gp_chain({.base_prior = "body"})->solve(problem, straight_line_of(problem), Deadline());
  ASSERT_FALSE(solution.has_value());
  EXPECT_EQ(solution.error().code, ErrorCode::kUnsupported);
}

TEST_F(GpChainDegenerate, ASingularQcIsRefused) {
  Problem problem = reference_problem();
  problem.qc[2] = 0.0;
  const auto solution = solve(problem);
  ASSERT_FALSE(solution.has_value());
  EXPECT_NE(solution.error().message.find("qc"), std::string::npos) << solution.error().message;
}

TEST_F(GpChainDegenerate, AQcBeyondDoublePrecisionFails) {
  Problem problem = reference_problem();
  problem.qc[2] = 1e-320;
  const auto solution = solve(problem);
  ASSERT_TRUE(solution.has_value()) << solution.error().describe();
  EXPECT_EQ(solution->status, SolveStatus::kFailed);
  EXPECT_NE(solution->reason.find("gp_prior"), std::string::npos) << solution->reason;
  EXPECT_EQ(solution->trajectory.size(), 0);
}

TEST_F(GpChainDegenerate, EverythingInCollisionStillLowersTheCost) {
  Problem problem = reference_problem();
  problem.field = std::make_shared<conformance::BallField>(
      std::vector<conformance::Ball>{{{1.0, 0.1, 0.0}, 20.0}});
  problem.terms = standard_terms(problem, {.epsilon_m = 0.2});
  const auto solution = solve(problem);
  ASSERT_TRUE(solution.has_value()) << solution.error().describe();
  conformance::expect_well_formed(problem, *solution);
  EXPECT_LT(solution->cost, solution->initial_cost);
}

TEST_F(GpChainDegenerate, ACostThatBecomesNanIsNotTakenForLower) {
  Problem problem = reference_problem();
  const auto cliff = std::make_shared<testing_support::JointCost>([](double q) {
    const double nan = std::numeric_limits<double>::quiet_NaN();
    return testing_support::JointCost::Value{q > 0.5 ? nan : 10.0 * (q - 1.0), 10.0};
  });
  problem.terms.push_back({cliff, Placement::kSupportAndInterpolated});
  for (const char* method : {"levenberg_marquardt", "gauss_newton", "dogleg"}) {
    const auto solution =
        make_gp_chain({.method = method})->solve(problem, straight_line_of(problem), Deadline());
    ASSERT_TRUE(solution.has_value()) << solution.error().describe();
    conformance::expect_well_formed(problem, *solution);
    EXPECT_LE(solution->cost, solution->initial_cost) << method;
  }
}

}  // namespace
}  // namespace sidestep
