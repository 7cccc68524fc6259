#include "waypoints.hpp"

#include <cmath>
#include <random>

#include <gtest/gtest.h>
#include <Eigen/Cholesky>
#include <Eigen/LU>

#include "support/waypoint_problem.hpp"

namespace sidestep {
namespace {

Problem moving_problem(int waypoints) {
  Problem problem = disc_problem(waypoints, {0.2, -0.3}, {1.0, 0.4});
  problem.start.qdot << 0.3, -0.1;
  problem.goal.qdot << -0.2, 0.25;
  problem.qc << 2.0, 0.5;
  return problem;
}

Waypoints minimum(const Problem& problem, const DifferenceMetric& metric) {
  WaypointStates states(problem);
  Waypoints q = states.positions_of(
      straight_line(problem.start, problem.goal, problem.support_states, problem.dt_s));
  Waypoints gradient = Waypoints::Zero(q.rows(), q.cols());
  metric.add_gradient(q, 1.0, gradient);
  q.middleCols(1, metric.inner()) -= metric.joint_weights().cwiseInverse().asDiagonal() *
                                     metric.solve(gradient.middleCols(1, metric.inner()));
  return q;
}

/// Of x(tau) = sin(3 tau) over 0 <= tau <= 1, whose integrals are known.
TEST(DifferenceMetric, IsTheIntegralOfTheSquaredDerivative) {
  constexpr int kWaypoints = 401;
  Problem problem = disc_problem(kWaypoints, {0.0, 0.0}, {std::sin(3.0), 0.0});
  const double end_s = problem.dt_s * (kWaypoints - 1);
  problem.start.qdot.x() = 3.0 / end_s;
  problem.goal.qdot.x() = 3.0 * std::cos(3.0) / end_s;
  Waypoints q = Waypoints::Zero(2, kWaypoints);
  for (int i = 0; i < kWaypoints; ++i) q(0, i) = std::sin(3.0 * i / (kWaypoints - 1));
  const double sin6 = std::sin(6.0);
  const double velocity = 0.5 * 9.0 * (0.5 + sin6 / 12.0);
  const double acceleration = 0.5 * 81.0 * (0.5 - sin6 / 12.0);
  EXPECT_NEAR(DifferenceMetric(problem, Derivative::kVelocity).cost(q), velocity, 1e-3 * velocity);
  EXPECT_NEAR(DifferenceMetric(problem, Derivative::kAcceleration).cost(q), acceleration,
              1e-3 * acceleration);
}

TEST(DifferenceMetric, WeighsAJointByTheLargestQcOverItsOwn) {
  const Problem problem = moving_problem(9);
  const DifferenceMetric metric(problem, Derivative::kVelocity);
  Waypoints q = Waypoints::Zero(2, 9);
  q(0, 4) = 1.0;
  const double first = metric.cost(q);
  q.setZero();
  q(1, 4) = 1.0;
  EXPECT_NEAR(metric.cost(q), 4.0 * first, 1e-12);
}

TEST(DifferenceMetric, HasTheGradientOfItsCost) {
  for (const Derivative derivative : {Derivative::kVelocity, Derivative::kAcceleration}) {
    const Problem problem = moving_problem(8);
    const DifferenceMetric metric(problem, derivative);
    std::srand(2);
    Waypoints q = Waypoints::Random(2, 8);
    Waypoints gradient = Waypoints::Zero(2, 8);
    metric.add_gradient(q, 1.5, gradient);
    for (Eigen::Index i = 0; i < q.size(); ++i) {
      constexpr double kStep = 1e-4;
      const double at = q(i);
      q(i) = at + kStep;
      const double above = metric.cost(q);
      q(i) = at - kStep;
      const double below = metric.cost(q);
      q(i) = at;
      EXPECT_NEAR(gradient(i), 1.5 * (above - below) / (2.0 * kStep), 1e-5) << "value " << i;
    }
  }
}

TEST(DifferenceMetric, OfVelocityIsLeastOnTheStraightLine) {
  const Problem problem = moving_problem(12);
  const Waypoints q = minimum(problem, DifferenceMetric(problem, Derivative::kVelocity));
  for (int i = 0; i < 12; ++i) {
    const Eigen::Vector2d line = problem.start.q + i / 11.0 * (problem.goal.q - problem.start.q);
    EXPECT_LT((q.col(i) - line).norm(), 1e-10) << "waypoint " << i;
  }
}

/// Of all motions between two states the cubic has the least integral of squared acceleration; the
/// error of second differences falls with the square of the spacing.
TEST(DifferenceMetric, OfAccelerationIsLeastOnTheCubic) {
  double coarse = 0.0;
  for (const int waypoints : {11, 21, 41}) {
    const Problem problem = moving_problem(waypoints);
    const Waypoints q = minimum(problem, DifferenceMetric(problem, Derivative::kAcceleration));
    Trajectory cubic = make_trajectory(2, 2, 4.0);
    Eigen::Map<Eigen::Vector2d>(cubic.q(0).data()) = problem.start.q;
    Eigen::Map<Eigen::Vector2d>(cubic.qdot(0).data()) = problem.start.qdot;
    Eigen::Map<Eigen::Vector2d>(cubic.q(1).data()) = problem.goal.q;
    Eigen::Map<Eigen::Vector2d>(cubic.qdot(1).data()) = problem.goal.qdot;
    double error = 0.0;
    Eigen::Vector2d at;
    for (int i = 0; i < waypoints; ++i) {
      cubic.sample(i * problem.dt_s, {at.data(), 2}, {});
      error = std::max(error, (q.col(i) - at).norm());
    }
    EXPECT_LT(error, 0.1 / waypoints);
    if (coarse > 0.0) {
      EXPECT_NEAR(error / coarse, 0.25, 0.05);
    }
    coarse = error;
  }
}

TEST(DifferenceMetric, ColoursNoiseWithTheInverseOfA) {
  const Problem problem = moving_problem(7);
  const DifferenceMetric metric(problem, Derivative::kAcceleration);
  const Eigen::MatrixXd covariance = Eigen::MatrixXd(metric.a()).inverse();
  // Exactly: the map is linear, so that its matrix times its transpose is the covariance.
  Eigen::MatrixXd map(5, 5);
  for (int i = 0; i < 5; ++i) {
    Eigen::MatrixXd unit = Eigen::MatrixXd::Zero(1, 5);
    unit(0, i) = 1.0;
    map.col(i) = metric.colour(unit).transpose();
  }
  EXPECT_TRUE((map * map.transpose()).isApprox(covariance, 1e-9));
  EXPECT_TRUE(metric.solve(Eigen::MatrixXd::Identity(5, 5)).isApprox(covariance, 1e-9));
}

}  // namespace
}  // namespace sidestep
