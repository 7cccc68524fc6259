#include "stomp.hpp"

#include <array>
#include <cmath>
#include <limits>
#include <random>

#include <gtest/gtest.h>
#include <Eigen/LU>

#include "support/waypoint_problem.hpp"

namespace sidestep {
namespace {

TEST(Weigh, IsTheExponentialOfTheNormalisedCosts) {
  const std::array costs{3.0, 1.0, 2.0};
  std::array<double, 3> weights{};
  weigh(costs, 4.0, weights);
  const double sum = 1.0 + std::exp(-2.0) + std::exp(-4.0);
  EXPECT_NEAR(weights[0], std::exp(-4.0) / sum, 1e-15);
  EXPECT_NEAR(weights[1], 1.0 / sum, 1e-15);
  EXPECT_NEAR(weights[2], std::exp(-2.0) / sum, 1e-15);
}

TEST(Weigh, DoesNotChangeWithTheUnitOfCosts) {
  std::array<double, 3> weights{}, of_scaled{};
  weigh(std::array{3.0, 1.0, 2.5}, 10.0, weights);
  weigh(std::array{3e8 + 7.0, 1e8 + 7.0, 2.5e8 + 7.0}, 10.0, of_scaled);
  for (std::size_t k = 0; k < 3; ++k) EXPECT_NEAR(weights[k], of_scaled[k], 1e-12);
}

TEST(Weigh, TreatsEqualCostsAlikeAndBrokenOnesNotAtAll) {
  std::array<double, 3> weights{};
  weigh(std::array{2.0, std::numeric_limits<double>::quiet_NaN(), 2.0}, 10.0, weights);
  EXPECT_EQ(weights, (std::array{0.5, 0.0, 0.5}));
}

TEST(Exploration, StraysAsFarAsAsked) {
  const Problem problem = disc_problem(12, {0.0, 0.0}, {1.0, 0.0});
  const DifferenceMetric metric(problem, Derivative::kAcceleration);
  const Exploration exploration(metric);
  // The covariance of each joint, from the map of unit vectors.
  Eigen::MatrixXd variances = Eigen::MatrixXd::Zero(2, 10);
  for (int i = 0; i < 10; ++i) {
    Eigen::MatrixXd z = Eigen::MatrixXd::Zero(2, 10);
    z.col(i).setOnes();
    variances += exploration.noise(z, Eigen::Vector2d(0.3, 0.1)).cwiseAbs2();
  }
  EXPECT_NEAR(std::sqrt(variances.row(0).maxCoeff()), 0.3, 1e-9);
  EXPECT_NEAR(std::sqrt(variances.row(1).maxCoeff()), 0.1, 1e-9);
  EXPECT_LT(variances(0, 0), 0.1 * variances(0, 5));  // least at the ends, which are held
}

TEST(Exploration, SmoothsWithTheScaledInverse) {
  const Problem problem = disc_problem(9, {0.0, 0.0}, {1.0, 0.0});
  const DifferenceMetric metric(problem, Derivative::kAcceleration);
  Eigen::MatrixXd m = Eigen::MatrixXd(metric.a()).inverse();
  for (int i = 0; i < 7; ++i) m.col(i) /= 7.0 * m.col(i).maxCoeff();
  std::srand(1);
  const Eigen::MatrixXd x = Eigen::MatrixXd::Random(2, 7);
  EXPECT_TRUE(Exploration(metric).smooth(x).isApprox(x * m.transpose(), 1e-9));
}

TEST(WeighedDeviation, FollowsTheCheapRolloutWaypointByWaypoint) {
  Rollout left{Waypoints::Zero(1, 4), {0, 0.0, 1.0, 0}, 0.0, true};
  Rollout right = left;
  left.positions << 0.0, 2.0, 2.0, 0.0;
  right.positions << 0.0, -1.0, -1.0, 0.0;
  right.costs = {0, 1.0, 0.0, 0};
  const Eigen::MatrixXd deviation =
      weighed_deviation({&left, &right}, Waypoints::Zero(1, 4), 100.0);
  EXPECT_NEAR(deviation(0, 0), 2.0, 1e-12);
  EXPECT_NEAR(deviation(0, 1), -1.0, 1e-12);
}

}  // namespace
}  // namespace sidestep
