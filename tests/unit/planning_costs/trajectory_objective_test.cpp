#include <sidestep/planning/trajectory_objective.hpp>

#include <cmath>
#include <memory>
#include <random>

#include <gtest/gtest.h>

#include <sidestep/core/index.hpp>
#include <sidestep/planning/costs.hpp>

#include "conformance/analytic_models.hpp"

namespace sidestep {
namespace {

using conformance::Ball;
using conformance::BallField;
using conformance::PlanarRobot;

/// A mobile arm of two joints that passes a ball, with costs of positions and of velocities, at
/// support states, between them, and at both ends.
Problem problem_among_costs() {
  Problem problem;
  problem.robot = std::make_shared<PlanarRobot>(PlanarRobot::Shape{2, true});
  problem.field = std::make_shared<BallField>(std::vector<Ball>{{{1.0, 0.2, 0.0}, 0.4}});
  problem.space = {Space::kOccupied, Space::kOccupied};
  problem.start = {Eigen::Vector4d(0.0, 0.0, 2.0, 0.5), Eigen::Vector4d::Zero()};
  problem.goal = {Eigen::Vector4d(2.0, 0.1, -1.0, -0.5), Eigen::Vector4d::Zero()};
  problem.support_states = 5;
  problem.dt_s = 0.7;
  problem.qc = Eigen::Vector4d(1.0, 0.5, 2.0, 0.2);
  problem.interpolated_checks = 2;
  CostSettings settings;
  settings.epsilon_m = 0.4;
  settings.sigma_endpoint = 0.1;
  problem.terms = standard_terms(problem, settings);
  return problem;
}

/// Off its straight line, and faster than it may.
Eigen::VectorXd some_variables(const Problem& problem, unsigned seed) {
  std::mt19937 random(seed);
  std::uniform_real_distribution<double> off(-0.6, 0.6);
  const Eigen::Index d = problem.qc.size(), last = problem.support_states - 1;
  Eigen::MatrixXd x(2 * d, last + 1);
  for (Eigen::Index i = 0; i <= last; ++i) {
    const double s = static_cast<double>(i) / static_cast<double>(last);
    x.col(i) << problem.start.q + s * (problem.goal.q - problem.start.q), Eigen::VectorXd::Zero(d);
  }
  for (double& value : x.reshaped()) value += off(random);
  return x.reshaped();
}

/// All residuals, whitened: those of the prior in the form of its definition, e = Phi x - x' with
/// 1/2 e^T Q^-1 e; those of the terms at the states of the cubic that a trajectory is.
Eigen::VectorXd residuals(const Problem& problem, const Trajectory& trajectory) {
  std::vector<double> all;
  const double dt = problem.dt_s;
  for (int i = 0; i + 1 < trajectory.size(); ++i) {
    for (Eigen::Index j = 0; j < problem.qc.size(); ++j) {
      const double v = trajectory.qdot(i)[idx(j)], v_next = trajectory.qdot(i + 1)[idx(j)];
      const double e_q = trajectory.q(i)[idx(j)] + dt * v - trajectory.q(i + 1)[idx(j)];
      const double e_v = v - v_next;
      // Q^-1 = 12/dt^3, -6/dt^2, 4/dt: the sum of two squares.
      all.push_back(std::sqrt(12.0 / (dt * dt * dt * problem.qc[j])) * (e_q - 0.5 * dt * e_v));
      all.push_back(std::sqrt(1.0 / (dt * problem.qc[j])) * e_v);
    }
  }
  Scratch scratch;
  const int between = problem.interpolated_checks + 1, last = trajectory.size() - 1;
  for (const CostTerm& term : problem.terms) {
    for (int s = 0; s <= last * between; ++s) {
      if (term.placement == Placement::kStart && s > 0) continue;
      if (term.placement == Placement::kGoal && s < last * between) continue;
      if (term.placement == Placement::kSupport && s % between != 0) continue;
      std::vector<double> q(idx(trajectory.dof)), qdot(idx(trajectory.dof));
      const double time_s = dt * s / between;
      trajectory.sample(time_s, q, qdot);
      std::vector<double> own(idx(term.cost->residual_count()));
      term.cost->evaluate({1, trajectory.dof, q, qdot, {&time_s, 1}}, {own, {}, {}}, scratch);
      all.insert(all.end(), own.begin(), own.end());
    }
  }
  return Eigen::Map<Eigen::VectorXd>(all.data(), std::ssize(all));
}

Eigen::MatrixXd jacobian(const Problem& problem, const TrajectoryObjective& objective,
                         const Eigen::VectorXd& x) {
  constexpr double kStep = 1e-6;
  Eigen::MatrixXd J;
  for (Eigen::Index v = 0; v < x.size(); ++v) {
    Eigen::VectorXd less = x, more = x;
    less[v] -= kStep;
    more[v] += kStep;
    const Eigen::VectorXd difference = residuals(problem, objective.trajectory_of(more)) -
                                       residuals(problem, objective.trajectory_of(less));
    if (v == 0) J.resize(difference.size(), x.size());
    J.col(v) = difference / (2.0 * kStep);
  }
  return J;
}

class TrajectoryObjectiveTest : public testing::TestWithParam<unsigned> {
 protected:
  Problem problem_ = problem_among_costs();
};
INSTANTIATE_TEST_SUITE_P(seeds, TrajectoryObjectiveTest, testing::Values(1u, 2u, 3u));

TEST_P(TrajectoryObjectiveTest, IsHalfTheSquaresOfAllResiduals) {
  TrajectoryObjective objective(problem_);
  const Eigen::VectorXd x = some_variables(problem_, GetParam());
  const double truth = 0.5 * residuals(problem_, objective.trajectory_of(x)).squaredNorm();
  double cost = 0.0;
  const auto terms = objective.costs(x);
  for (const TermCost& term : terms) cost += term.cost;
  EXPECT_NEAR(cost, truth, 1e-9 * truth);
  const auto expansion = objective.expand(x);
  constexpr double kOfLinearise = 1e-7;  // which sums in another order, in part as float
  EXPECT_NEAR(expansion.cost, truth, kOfLinearise * truth);
  ASSERT_EQ(expansion.terms.size(), terms.size());
  int felt = 0;
  for (std::size_t t = 0; t < terms.size(); ++t) {
    EXPECT_EQ(expansion.terms[t].name, terms[t].name);
    EXPECT_NEAR(expansion.terms[t].cost, terms[t].cost, kOfLinearise * truth);
    felt += terms[t].cost > 0.0 ? 1 : 0;
  }
  EXPECT_GE(felt, 5);  // prior, obstacle, velocity limits, both ends
}

TEST_P(TrajectoryObjectiveTest, HasTheirNormalEquations) {
  TrajectoryObjective objective(problem_);
  const Eigen::VectorXd x = some_variables(problem_, GetParam());
  const auto expansion = objective.expand(x);
  const Eigen::MatrixXd J = jacobian(problem_, objective, x);
  const Eigen::VectorXd gradient = J.transpose() * residuals(problem_, objective.trajectory_of(x));
  EXPECT_LT((expansion.gradient - gradient).norm(), 1e-5 * gradient.norm());
  const Eigen::MatrixXd hessian = J.transpose() * J;
  EXPECT_LT((Eigen::MatrixXd(expansion.hessian) - hessian).norm(), 1e-5 * hessian.norm());
}

TEST_P(TrajectoryObjectiveTest, HoldsAnEndAtWhichNoTermIsPlaced) {
  std::erase_if(problem_.terms,
                [](const CostTerm& term) { return term.placement == Placement::kGoal; });
  TrajectoryObjective objective(problem_);
  Eigen::VectorXd x = some_variables(problem_, GetParam());
  x = objective.variables_of(objective.trajectory_of(x));
  Eigen::VectorXd goal(8);
  goal << problem_.goal.q, problem_.goal.qdot;
  EXPECT_EQ(x.tail(8), goal);
  EXPECT_NE(x.head(4), problem_.start.q);  // where a term is

  const auto expansion = objective.expand(x);
  EXPECT_TRUE(expansion.gradient.tail(8).isZero(0.0));
  const Eigen::MatrixXd hessian(expansion.hessian);
  EXPECT_EQ(hessian.bottomRightCorner(8, 8), Eigen::MatrixXd::Identity(8, 8));
  EXPECT_TRUE(hessian.topRightCorner(hessian.rows() - 8, 8).isZero(0.0));
  EXPECT_TRUE(hessian.bottomLeftCorner(8, hessian.cols() - 8).isZero(0.0));
  const Eigen::MatrixXd J = jacobian(problem_, objective, x).leftCols(x.size() - 8);
  const Eigen::MatrixXd free = J.transpose() * J;
  const Eigen::MatrixXd left = hessian.topLeftCorner(free.rows(), free.cols());
  EXPECT_LT((left - free).norm(), 1e-5 * free.norm());
}

TEST(TrajectoryObjective, KeepsATrajectoryAsItIs) {
  const Problem problem = problem_among_costs();
  const TrajectoryObjective objective(problem);
  const Eigen::VectorXd x = some_variables(problem, 7);
  EXPECT_EQ(objective.size(), 40);
  const Trajectory trajectory = objective.trajectory_of(x);
  EXPECT_NEAR(trajectory.duration_s(), 4.0 * problem.dt_s, 1e-12);
  EXPECT_EQ(trajectory.q(3)[2], x[8 * 3 + 2]);
  EXPECT_EQ(trajectory.qdot(3)[2], x[8 * 3 + 4 + 2]);
  EXPECT_EQ(objective.variables_of(trajectory), x);
}

}  // namespace
}  // namespace sidestep
