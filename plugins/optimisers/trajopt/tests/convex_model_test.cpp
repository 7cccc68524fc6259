#include "convex_model.hpp"

#include <gtest/gtest.h>

#include "conformance/analytic_models.hpp"

namespace sidestep {
namespace {

using conformance::Ball;
using conformance::BallField;

class ConvexModelTest : public testing::Test {
 protected:
  ConvexModelTest() {
    problem_.robot = std::make_shared<conformance::PlanarRobot>(
        conformance::PlanarRobot::Shape{.rotary_joints = 2, .mobile = true});
    problem_.start = {Eigen::Vector4d(-0.8, 0.1, 0.0, 0.4), Eigen::Vector4d::Zero()};
    problem_.goal = {Eigen::Vector4d(0.8, 0.0, 1.5, -0.5), Eigen::Vector4d::Zero()};
    problem_.support_states = 9;
    problem_.dt_s = 0.3;
    problem_.interpolated_checks = 2;
    problem_.qc = Eigen::Vector4d(1.0, 2.0, 0.5, 1.0);
    problem_.field = std::make_shared<BallField>(
        std::vector<Ball>{{{0.0, 0.35, 0.0}, 0.2}, {{0.7, -0.3, 0.05}, 0.1}});
    problem_.terms = standard_terms(problem_, {.self_collision_epsilon_m = 0.3});
    std::srand(6);
    positions_ = Waypoints(4, 9);
    for (int i = 0; i < 9; ++i) {
      positions_.col(i) = problem_.start.q + i / 8.0 * (problem_.goal.q - problem_.start.q);
    }
    positions_.middleCols(1, 7) += 0.05 * Waypoints::Random(4, 7);
  }

  [[nodiscard]] Waypoints moved(const Eigen::VectorXd& step) const {
    Waypoints out = positions_;
    out.middleCols(1, 7) += step.reshaped(4, 7);
    return out;
  }

  Problem problem_;
  Waypoints positions_;
};

TEST_F(ConvexModelTest, HasTheValueAndTheSlopesOfTheMerit) {
  const DifferenceMetric metric(problem_, Derivative::kAcceleration);
  ConvexModel model(problem_, metric, 0.7, 0.05, 0.3);
  const PenaltyQp qp = model.convexify(positions_, 30.0);
  const Merit here = model.evaluate(positions_);
  ASSERT_GT(here.shortfall_m, 0.05);
  const Eigen::VectorXd zero = Eigen::VectorXd::Zero(28);
  EXPECT_NEAR(qp.value(zero), 30.0 * here.shortfall_m, 1e-9);  // changes of the rest are from 0
  for (int i = 0; i < 28; ++i) {
    constexpr double kStep = 1e-5;
    const Eigen::VectorXd up = kStep * Eigen::VectorXd::Unit(28, i);
    const double cost_slope =
        (model.evaluate(moved(up)).cost - model.evaluate(moved(-up)).cost) / (2.0 * kStep);
    EXPECT_NEAR(qp.g[i], cost_slope, 1e-3 * (1.0 + std::abs(cost_slope))) << "variable " << i;
  }
}

/// Hinges predict the clearance of their contacts; what they leave out is how the bend of a way and
/// the place of contact change.
TEST_F(ConvexModelTest, PredictsClearances) {
  const DifferenceMetric metric(problem_, Derivative::kVelocity);
  ConvexModel model(problem_, metric, 1.0, 0.05, 0.3);
  const PenaltyQp qp = model.convexify(positions_, 1.0);
  const Merit here = model.evaluate(positions_);
  double missed = 0.0, changed = 0.0;
  for (int trial = 0; trial < 20; ++trial) {
    const Eigen::VectorXd step = 0.01 * Eigen::VectorXd::Random(28);
    double predicted = 0.0;
    for (const Hinge& hinge : qp.hinges) predicted += std::max(0.0, hinge.shortfall(step));
    const double actual = model.evaluate(moved(step)).shortfall_m;
    missed += std::abs(predicted - actual);
    changed += std::abs(here.shortfall_m - actual);
  }
  EXPECT_LT(missed, 0.25 * changed);
}

TEST_F(ConvexModelTest, HasAPositiveSemidefiniteHessian) {
  const DifferenceMetric metric(problem_, Derivative::kVelocity);
  ConvexModel model(problem_, metric, 1.0, 0.05, 0.3);
  const PenaltyQp qp = model.convexify(positions_, 1.0);
  for (int trial = 0; trial < 50; ++trial) {
    const Eigen::VectorXd x = Eigen::VectorXd::Random(28);
    EXPECT_GT(x.dot(qp.h.times(x)), 0.0);
  }
}

}  // namespace
}  // namespace sidestep
