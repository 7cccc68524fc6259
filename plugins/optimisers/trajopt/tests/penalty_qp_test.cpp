#include "penalty_qp.hpp"

#include <algorithm>
#include <cmath>
#include <random>

#include <gtest/gtest.h>
#include <Eigen/LU>

namespace sidestep {
namespace {

PenaltyQp random_qp(int blocks, int width, std::uint64_t seed) {
  std::mt19937_64 random(seed);
  std::normal_distribution<double> normal;
  const int n = blocks * width;
  PenaltyQp qp{
      BandMatrix(blocks, width, 1), Eigen::VectorXd(n), Eigen::VectorXd(n), Eigen::VectorXd(n), {}};
  for (int i = 0; i < n; ++i) {
    qp.g[i] = 3.0 * normal(random);
    qp.lower[i] = -0.5 - std::abs(normal(random));
    qp.upper[i] = 0.5 + std::abs(normal(random));
  }
  // Sums of squares of windows of two blocks, so that H is positive definite within its band.
  for (int b = 0; b + 1 < blocks; ++b) {
    for (int k = 0; k < 2 * width; ++k) {
      Eigen::VectorXd row(2 * width);
      for (double& value : row) value = normal(random);
      for (int i = 0; i < 2 * width; ++i) {
        for (int j = 0; j <= i; ++j) qp.h.add(b * width + i, b * width + j, row[i] * row[j]);
      }
      Hinge hinge{b * width, {}, normal(random), 2.0 * std::abs(normal(random))};
      for (int i = 0; i < 2 * width; ++i) hinge.coefficients.push_back(normal(random));
      qp.hinges.push_back(hinge);
    }
  }
  return qp;
}

Eigen::MatrixXd whole_of(const BandMatrix& band) {
  const Eigen::MatrixXd lower = band.lower();
  return lower.selfadjointView<Eigen::Lower>();
}

/// The minimum of a convex function over a box, by the optimality condition: no feasible direction
/// among many descends, and none of the subgradient's own.
void expect_minimum(const PenaltyQp& qp, const Eigen::VectorXd& x, std::uint64_t seed) {
  ASSERT_TRUE((x.array() >= qp.lower.array() - 1e-9).all());
  ASSERT_TRUE((x.array() <= qp.upper.array() + 1e-9).all());
  const double value = qp.value(x);
  std::mt19937_64 random(seed);
  std::normal_distribution<double> normal;
  for (int trial = 0; trial < 2000; ++trial) {
    Eigen::VectorXd to = x;
    const double scale = std::pow(10.0, -(trial % 6));
    if (trial % 2 == 0) {
      for (double& entry : to) entry += scale * normal(random);
    } else {
      to[trial / 2 % to.size()] += scale * normal(random);
    }
    to = to.cwiseMax(qp.lower).cwiseMin(qp.upper);
    EXPECT_GE(qp.value(to), value - 1e-5 * (1.0 + std::abs(value))) << "trial " << trial;
  }
}

/// By an independent method, accelerated projected gradient descent, with the hinges rounded over
/// ever smaller widths.
double by_smoothed_descent(const PenaltyQp& qp) {
  Eigen::VectorXd x = 0.5 * (qp.lower + qp.upper);
  const Eigen::MatrixXd h = whole_of(qp.h);
  for (const double width : {1e-1, 1e-2, 1e-3, 1e-4, 1e-5}) {
    double steepest = h.norm();
    for (const Hinge& hinge : qp.hinges) {
      for (const double a : hinge.coefficients) steepest += hinge.weight * a * a / width;
    }
    Eigen::VectorXd y = x;
    double t = 1.0;
    for (int i = 0; i < 20000; ++i) {
      Eigen::VectorXd gradient = h * y + qp.g;
      for (const Hinge& hinge : qp.hinges) {
        const double slope = hinge.weight * std::clamp(hinge.shortfall(y) / width + 0.5, 0.0, 1.0);
        for (std::size_t k = 0; k < hinge.coefficients.size(); ++k) {
          gradient[hinge.first + static_cast<int>(k)] -= slope * hinge.coefficients[k];
        }
      }
      const Eigen::VectorXd next = (y - gradient / steepest).cwiseMax(qp.lower).cwiseMin(qp.upper);
      const double t_next = 0.5 * (1.0 + std::sqrt(1.0 + 4.0 * t * t));
      y = next + (t - 1.0) / t_next * (next - x);
      if ((y - next).dot(next - x) < 0.0)
        t = 1.0;
      else
        t = t_next;
      x = next;
    }
  }
  return qp.value(x);
}

TEST(PenaltyQp, AgreesWithAcceleratedDescent) {
  for (const std::uint64_t seed : {1u, 2u, 3u, 4u}) {
    const PenaltyQp qp = random_qp(4, 2, seed);
    const auto x = minimise(qp);
    ASSERT_TRUE(x.has_value());
    const double expected = by_smoothed_descent(qp);
    EXPECT_LE(qp.value(*x), expected + 1e-5 * (1.0 + std::abs(expected))) << "seed " << seed;
    EXPECT_GE(qp.value(*x), expected - 1e-2 * (1.0 + std::abs(expected))) << "seed " << seed;
  }
}

TEST(PenaltyQp, IsBetterThanAllAroundIt) {
  for (const std::uint64_t seed : {5u, 6u}) {
    const PenaltyQp qp = random_qp(20, 7, seed);
    const auto x = minimise(qp);
    ASSERT_TRUE(x.has_value());
    expect_minimum(qp, *x, seed);
  }
}

/// 1/2 (x - 1)^2 and what a hinge of weight w holds back, in closed form: without bounds in reach
/// x = min(2, 1 + w) for a hinge that asks for x >= 2.
TEST(PenaltyQp, PaysForAHingeUpToItsWeight) {
  for (const double weight : {0.25, 0.5, 3.0, 1e4}) {
    PenaltyQp qp{BandMatrix(1, 1, 0),
                 Eigen::VectorXd::Constant(1, -1.0),
                 Eigen::VectorXd::Constant(1, -10.0),
                 Eigen::VectorXd::Constant(1, 10.0),
                 {{0, {1.0}, 2.0, weight}}};
    qp.h.add(0, 0, 1.0);
    const auto x = minimise(qp);
    ASSERT_TRUE(x.has_value());
    EXPECT_NEAR((*x)[0], std::min(2.0, 1.0 + weight), 1e-4) << "weight " << weight;
  }
}

TEST(PenaltyQp, StopsAtItsBounds) {
  PenaltyQp qp{BandMatrix(2, 1, 1),
               Eigen::VectorXd::Constant(2, -1.0),
               Eigen::VectorXd::Constant(2, -0.1),
               Eigen::VectorXd::Constant(2, 0.3),
               {}};
  qp.upper[1] = qp.lower[1];  // may not move
  qp.h.add(0, 0, 1.0);
  const auto x = minimise(qp);
  ASSERT_TRUE(x.has_value());
  EXPECT_NEAR((*x)[0], 0.3, 1e-6);
  EXPECT_EQ((*x)[1], -0.1);
}

TEST(PenaltyQp, SaysWhereTheNumbersGoWrong) {
  PenaltyQp qp{BandMatrix(1, 1, 0),
               Eigen::VectorXd::Constant(1, std::nan("")),
               Eigen::VectorXd::Constant(1, -1.0),
               Eigen::VectorXd::Constant(1, 1.0),
               {}};
  EXPECT_FALSE(minimise(qp).has_value());
}

TEST(BandMatrix, AddsSquares) {
  BandMatrix band(3, 2, 1);
  const std::vector<double> a{1.0, 0.0, -2.0, 3.0};
  band.add_square(2, a, 0.5);
  const Eigen::Map<const Eigen::Vector4d> v(a.data());
  Eigen::MatrixXd expected = Eigen::MatrixXd::Zero(6, 6);
  expected.bottomRightCorner(4, 4) = 0.5 * v * v.transpose();
  EXPECT_TRUE(whole_of(band).isApprox(expected));
}

TEST(BandMatrix, MultipliesAsTheWholeMatrix) {
  const PenaltyQp qp = random_qp(5, 3, 9);
  const Eigen::MatrixXd whole = whole_of(qp.h);
  std::srand(1);
  const Eigen::VectorXd x = Eigen::VectorXd::Random(15);
  EXPECT_TRUE(qp.h.times(x).isApprox(whole * x, 1e-12));
  EXPECT_EQ(whole(0, 6), 0.0);
}

}  // namespace
}  // namespace sidestep
