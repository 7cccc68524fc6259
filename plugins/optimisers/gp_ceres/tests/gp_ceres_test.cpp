#include "gp_ceres.hpp"

#include <gtest/gtest.h>

#include <sidestep/planning/costs.hpp>

#include "conformance/analytic_models.hpp"
#include "conformance/cost_conformance.hpp"
#include "factors.hpp"

namespace sidestep {
namespace {

using conformance::PlanarRobot;

Problem free_problem() {
  Problem problem;
  problem.robot = std::make_shared<PlanarRobot>(PlanarRobot::Shape{2, true});
  problem.start = {Eigen::Vector4d(-1.0, 0.5, 0.3, 0.2), Eigen::Vector4d(0.1, 0.0, -0.2, 0.3)};
  problem.goal = {Eigen::Vector4d(1.0, -0.5, -0.6, 0.9), Eigen::Vector4d(0.0, 0.2, 0.1, 0.0)};
  problem.support_states = 12;
  problem.dt_s = 0.25;
  problem.qc = Eigen::Vector4d(1.0, 0.5, 2.0, 1.5);
  return problem;
}

/// The prior's mean between two fixed states is the cubic through them: least squares over the
/// support states must find it, whatever their number.
TEST(GpCeres, FindsTheCubicWhereThereIsNoCost) {
  const Problem problem = free_problem();
  const auto solution =
      make_gp_ceres({.relative_tolerance = 0, .absolute_tolerance = 1e-14})
          ->solve(problem, straight_line(problem.start, problem.goal, 12, 0.25), Deadline());
  ASSERT_TRUE(solution.has_value()) << solution.error().describe();
  Trajectory cubic = make_trajectory(4, 2, 11 * 0.25);
  for (std::size_t j = 0; j < 4; ++j) {
    const auto k = static_cast<Eigen::Index>(j);
    cubic.q(0)[j] = problem.start.q[k];
    cubic.q(1)[j] = problem.goal.q[k];
    cubic.qdot(0)[j] = problem.start.qdot[k];
    cubic.qdot(1)[j] = problem.goal.qdot[k];
  }
  std::vector<double> q(4), qdot(4);
  for (int i = 0; i < 12; ++i) {
    cubic.sample(0.25 * i, q, qdot);
    for (std::size_t j = 0; j < 4; ++j) {
      EXPECT_NEAR(solution->trajectory.q(i)[j], q[j], 1e-6) << "state " << i;
      EXPECT_NEAR(solution->trajectory.qdot(i)[j], qdot[j], 1e-6) << "state " << i;
    }
  }
}

TEST(GpCeres, HoldsAnEndThatNoTermHolds) {
  Problem problem = free_problem();
  problem.terms.push_back({make_state_prior("goal", problem.goal, 1e-4), Placement::kGoal});
  Trajectory initial = straight_line(problem.start, problem.goal, 12, 0.25);
  initial.q(0)[0] += 0.1;  // a guess need not begin at the start
  const auto solution = make_gp_ceres({})->solve(problem, initial, Deadline());
  ASSERT_TRUE(solution.has_value()) << solution.error().describe();
  for (std::size_t j = 0; j < 4; ++j) {
    EXPECT_EQ(solution->trajectory.q(0)[j], problem.start.q[static_cast<Eigen::Index>(j)]);
    EXPECT_EQ(solution->trajectory.qdot(0)[j], problem.start.qdot[static_cast<Eigen::Index>(j)]);
  }
}

TEST(GpCeres, SaysThatItRanOutOfIterations) {
  Problem problem = free_problem();
  problem.field = std::make_shared<conformance::BallField>(
      std::vector<conformance::Ball>{{{0.0, 0.05, 0.0}, 0.3}});
  problem.terms = standard_terms(problem, {});
  const auto solution =
      make_gp_ceres({.max_iterations = 2})
          ->solve(problem, straight_line(problem.start, problem.goal, 12, 0.25), Deadline());
  ASSERT_TRUE(solution.has_value()) << solution.error().describe();
  EXPECT_EQ(solution->status, SolveStatus::kIterationLimit);
  EXPECT_EQ(solution->iterations, 2);
  EXPECT_NE(solution->reason.find("2 iterations"), std::string::npos) << solution->reason;
}

/// The whitened residual's square is e^T Q^-1 e with Q written out from numerics.
TEST(GpPriorFactorTest, IsTheMahalanobisDistanceAndDifferentiatesIt) {
  const double dt = 0.37;
  const Eigen::Vector2d qc(0.8, 2.5);
  const GpPrior prior(qc, dt);
  const GpPriorFactor factor(prior);
  std::srand(7);
  const Eigen::Vector4d a = Eigen::Vector4d::Random(), b = Eigen::Vector4d::Random();
  Eigen::Matrix4d phi = Eigen::Matrix4d::Identity();
  phi.topRightCorner<2, 2>().diagonal().setConstant(dt);
  Eigen::Matrix4d q = Eigen::Matrix4d::Zero();
  q.topLeftCorner<2, 2>().diagonal() = dt * dt * dt / 3.0 * qc;
  q.topRightCorner<2, 2>().diagonal() = dt * dt / 2.0 * qc;
  q.bottomLeftCorner<2, 2>() = q.topRightCorner<2, 2>();
  q.bottomRightCorner<2, 2>().diagonal() = dt * qc;
  const Eigen::Vector4d e = phi * a - b;

  Eigen::Vector4d residuals;
  Eigen::Matrix<double, 4, 4, Eigen::RowMajor> by_a, by_b;
  const double* const states[] = {a.data(), b.data()};
  double* jacobians[] = {by_a.data(), by_b.data()};
  ASSERT_TRUE(factor.Evaluate(states, residuals.data(), jacobians));
  EXPECT_NEAR(residuals.squaredNorm(), e.dot(q.inverse() * e), 1e-10);
  EXPECT_TRUE((by_a * a + by_b * b).isApprox(residuals, 1e-12));  // it is linear
  EXPECT_TRUE((by_b.transpose() * by_b).isApprox(q.inverse(), 1e-10));
  EXPECT_TRUE((by_a.transpose() * by_a).isApprox(phi.transpose() * q.inverse() * phi, 1e-10));
}

/// The gradient of the whole chain's cost, through interpolation, against differences.
TEST(IntervalFactorTest, ChainsTheGradientOntoBothSupportStates) {
  Problem problem = free_problem();
  problem.support_states = 3;
  problem.interpolated_checks = 3;
  problem.field = std::make_shared<conformance::BallField>(
      std::vector<conformance::Ball>{{{0.1, 0.3, 0.1}, 0.3}});
  problem.terms = standard_terms(problem, {.epsilon_m = 2.0, .sigma_self_collision = 0.0});
  const GpPrior prior(problem.qc, problem.dt_s);
  StateRows rows(problem, prior);
  const auto random = conformance::random_states(8, 3, 1.5, 0.0, 11);
  const IntervalFactor factor(rows, 1);
  const int m = factor.num_residuals();
  const auto evaluate = [&](const std::vector<double>& x, double** jacobians) {
    rows.update(x);
    Eigen::VectorXd residuals(m);
    const double* const states[] = {x.data(), x.data() + 8};
    factor.Evaluate(states, residuals.data(), jacobians);
    return residuals;
  };
  Eigen::Matrix<double, Eigen::Dynamic, 8, Eigen::RowMajor> by_a(m, 8), by_b(m, 8);
  double* jacobians[] = {by_a.data(), by_b.data()};
  const Eigen::VectorXd residuals = evaluate(random.q, jacobians);
  ASSERT_GT(residuals.norm(), 1.0);
  for (std::size_t i = 0; i < 16; ++i) {
    constexpr double kStep = 1e-6;
    std::vector<double> above = random.q, below = random.q;
    above[i] += kStep;
    below[i] -= kStep;
    const double difference =
        (evaluate(above, nullptr).squaredNorm() - evaluate(below, nullptr).squaredNorm()) /
        (4.0 * kStep);
    const auto column = static_cast<Eigen::Index>(i % 8);
    const double gradient = (i < 8 ? by_a : by_b).col(column).dot(residuals);
    EXPECT_NEAR(gradient, difference, 1e-5 * (1.0 + std::abs(difference))) << "variable " << i;
  }
}

}  // namespace
}  // namespace sidestep
