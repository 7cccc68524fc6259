#include <sidestep/trajectory/gp_prior.hpp>

#include <random>

#include <gtest/gtest.h>
#include <Eigen/Dense>

#include <sidestep/trajectory/trajectory.hpp>

namespace sidestep {
namespace {

// The dense matrices of numerics.md, term by term, for d joints.
Eigen::MatrixXd dense_phi(int d, double s) {
  Eigen::MatrixXd phi = Eigen::MatrixXd::Identity(2 * d, 2 * d);
  phi.topRightCorner(d, d) = s * Eigen::MatrixXd::Identity(d, d);
  return phi;
}

Eigen::MatrixXd dense_q(const Eigen::VectorXd& qc, double s) {
  const auto d = qc.size();
  const Eigen::MatrixXd power = qc.asDiagonal();
  Eigen::MatrixXd q(2 * d, 2 * d);
  q << s * s * s / 3.0 * power, s * s / 2.0 * power, s * s / 2.0 * power, s * power;
  return q;
}

TEST(GpPrior, WhitensTheProcessNoise) {
  for (const double dt : {0.01, 0.1, 0.5, 2.0}) {
    const GpPrior prior(Eigen::VectorXd::Ones(1), dt);
    const Eigen::Matrix2d q = dense_q(Eigen::VectorXd::Ones(1), dt);
    const Eigen::Matrix2d& u = prior.whitening();
    EXPECT_EQ(u(1, 0), 0.0);
    // The Cholesky factor of the inverse is unique once its diagonal is positive.
    const Eigen::Matrix2d expected = q.inverse().eval().llt().matrixU();
    EXPECT_TRUE(u.isApprox(expected, 1e-10)) << u << "\n\n" << expected;
    EXPECT_TRUE((u * q * u.transpose()).isApprox(Eigen::Matrix2d::Identity(), 1e-12));
  }
}

TEST(GpPrior, InterpolatesAsTheDenseFormulasDo) {
  const Eigen::Vector3d qc(0.3, 1.0, 20.0);
  for (const double dt : {0.05, 0.4, 1.5}) {
    const GpPrior prior(qc, dt);
    EXPECT_EQ(prior.dof(), 3);
    for (const double fraction : {0.0, 0.1, 0.5, 0.77, 1.0}) {
      const double s = fraction * dt;
      const Eigen::MatrixXd psi =
          dense_q(qc, s) * dense_phi(3, dt - s).transpose() * dense_q(qc, dt).inverse();
      const Eigen::MatrixXd lambda = dense_phi(3, s) - psi * dense_phi(3, dt);
      const auto actual = prior.interpolation(fraction);
      for (int a = 0; a < 2; ++a) {
        for (int b = 0; b < 2; ++b) {
          const Eigen::Matrix3d identity = Eigen::Matrix3d::Identity();
          const double scale = 1.0 + std::abs(actual.psi(a, b));
          EXPECT_NEAR((psi.block<3, 3>(3 * a, 3 * b) - actual.psi(a, b) * identity).norm(), 0.0,
                      1e-11 * scale);
          EXPECT_NEAR((lambda.block<3, 3>(3 * a, 3 * b) - actual.lambda(a, b) * identity).norm(),
                      0.0, 1e-11 * scale);
        }
      }
    }
  }
}

TEST(GpPrior, AgreesWithTheSamplesOfATrajectory) {
  std::mt19937 generator(5);
  std::uniform_real_distribution<double> uniform(-2.0, 2.0);
  Trajectory trajectory = make_trajectory(2, 6, 0.3);
  for (double& value : trajectory.positions) value = uniform(generator);
  for (double& value : trajectory.velocities) value = uniform(generator);
  const GpPrior prior(Eigen::Vector2d(1.0, 3.0), 0.3);
  std::vector<double> q(2), qdot(2);
  for (int i = 0; i < 5; ++i) {
    for (const double fraction : {0.125, 0.25, 0.5, 0.875}) {
      trajectory.sample(trajectory.times_s[static_cast<std::size_t>(i)] + fraction * 0.3, q, qdot);
      const auto at = prior.interpolation(fraction);
      for (std::size_t j = 0; j < 2; ++j) {
        const Eigen::Vector2d a(trajectory.q(i)[j], trajectory.qdot(i)[j]);
        const Eigen::Vector2d b(trajectory.q(i + 1)[j], trajectory.qdot(i + 1)[j]);
        const Eigen::Vector2d x = at.lambda * a + at.psi * b;
        EXPECT_NEAR(q[j], x[0], 1e-12);
        EXPECT_NEAR(qdot[j], x[1], 1e-12 * 20);
      }
    }
  }
}

}  // namespace
}  // namespace sidestep
