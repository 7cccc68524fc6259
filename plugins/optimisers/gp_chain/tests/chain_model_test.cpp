#include "chain_model.hpp"

#include <functional>

#include <gtest/gtest.h>
#include <Eigen/Cholesky>

#include <sidestep/planning/costs.hpp>

#include "conformance/analytic_models.hpp"
#include "conformance/cost_conformance.hpp"

namespace sidestep {
namespace {

/// Every kind of cost and placement, on a chain whose states are far from smooth.
class ChainModelTest : public testing::Test {
 protected:
  static constexpr int kDof = 5, kStates = 4, kChecks = 2;

  ChainModelTest() {
    problem_.robot =
        std::make_shared<conformance::PlanarRobot>(conformance::PlanarRobot::Shape{3, true, 6});
    problem_.field = std::make_shared<conformance::BallField>(
        std::vector<conformance::Ball>{{{0.4, 0.3, 0.1}, 0.2}, {{-0.5, -0.2, 0.2}, 0.3}});
    problem_.start = {Eigen::VectorXd::Constant(kDof, -0.4), Eigen::VectorXd::Zero(kDof)};
    problem_.goal = {Eigen::VectorXd::Constant(kDof, 0.4), Eigen::VectorXd::Zero(kDof)};
    problem_.support_states = kStates;
    problem_.dt_s = 0.3;
    problem_.qc = Eigen::VectorXd::LinSpaced(kDof, 0.5, 2.0);
    problem_.interpolated_checks = kChecks;
    problem_.terms = standard_terms(problem_, {.epsilon_m = 0.6, .sigma_endpoint = 0.1});
    problem_.terms.push_back(
        {make_state_prior("posture", problem_.start, 0.7), Placement::kSupport});
    problem_.terms.push_back(
        {make_state_prior("middle", problem_.goal, 0.9), Placement::kSupportAndInterpolated});
    const auto random = conformance::random_states(kDof, kStates, 0.8, 2.5, 5);
    initial_ = make_trajectory(kDof, kStates, problem_.dt_s);
    initial_.positions = random.q;
    initial_.velocities = random.qdot;
  }

  /// All residuals of the problem, the prior's from Q written out, the states between support
  /// states from Trajectory's cubic.
  Eigen::VectorXd residuals(const Eigen::VectorXd& x) const {
    Trajectory trajectory = initial_;
    for (int i = 0; i < kStates; ++i) {
      std::copy_n(x.data() + 2 * kDof * i, kDof, trajectory.q(i).begin());
      std::copy_n(x.data() + 2 * kDof * i + kDof, kDof, trajectory.qdot(i).begin());
    }
    std::vector<double> all;
    const double dt = problem_.dt_s;
    for (int i = 0; i + 1 < kStates; ++i) {
      for (int j = 0; j < kDof; ++j) {
        const auto at = static_cast<std::size_t>(j);
        Eigen::Matrix2d q;
        q << dt * dt * dt / 3.0, dt * dt / 2.0, dt * dt / 2.0, dt;
        const Eigen::Vector2d e(
            trajectory.q(i)[at] + dt * trajectory.qdot(i)[at] - trajectory.q(i + 1)[at],
            trajectory.qdot(i)[at] - trajectory.qdot(i + 1)[at]);
        const Eigen::Vector2d white = (q * problem_.qc[j]).llt().matrixL().solve(e);
        all.insert(all.end(), {white[0], white[1]});
      }
    }
    for (const CostTerm& term : problem_.terms) {
      for (int s = 0; s <= (kStates - 1) * (kChecks + 1); ++s) {
        const bool support = s % (kChecks + 1) == 0;
        const bool last = s == (kStates - 1) * (kChecks + 1);
        if (term.placement == Placement::kStart && s != 0) continue;
        if (term.placement == Placement::kGoal && !last) continue;
        if (term.placement == Placement::kSupport && !support) continue;
        conformance::States at{kDof, std::vector<double>(kDof), std::vector<double>(kDof), {0.0}};
        trajectory.sample(s * dt / (kChecks + 1), at.q, at.qdot);
        const auto evaluation = conformance::evaluate(*term.cost, at, false);
        all.insert(all.end(), evaluation.residuals.begin(), evaluation.residuals.end());
      }
    }
    return Eigen::Map<const Eigen::VectorXd>(all.data(), static_cast<Eigen::Index>(all.size()));
  }

  Eigen::MatrixXd differences(const Eigen::VectorXd& x) const {
    constexpr double kStep = 1e-6;
    Eigen::MatrixXd jacobian(residuals(x).size(), x.size());
    for (Eigen::Index i = 0; i < x.size(); ++i) {
      Eigen::VectorXd above = x, below = x;
      above[i] += kStep;
      below[i] -= kStep;
      jacobian.col(i) = (residuals(above) - residuals(below)) / (2.0 * kStep);
    }
    return jacobian;
  }

  Problem problem_;
  Trajectory initial_;
};

TEST_F(ChainModelTest, HasTheNormalEquationsOfItsResiduals) {
  ChainModel model;
  model.reset(problem_, initial_);
  model.linearise();
  const auto& support = model.current().support;
  const Eigen::VectorXd x =
      Eigen::Map<const Eigen::VectorXd>(support.data(), static_cast<Eigen::Index>(support.size()));
  const Eigen::VectorXd r = residuals(x);
  const Eigen::MatrixXd jacobian = differences(x);
  EXPECT_NEAR(model.current().cost, 0.5 * r.squaredNorm(), 1e-9 * r.squaredNorm());
  double terms = 0.0;
  for (const double term : model.current().terms) terms += term;
  EXPECT_NEAR(terms, model.current().cost, 1e-9 * terms);

  const Eigen::MatrixXd h = jacobian.transpose() * jacobian;
  const Eigen::VectorXd b = -jacobian.transpose() * r;
  constexpr int kWidth = 2 * kDof;
  ChainSystem& system = model.system();
  for (int i = 0; i < kStates; ++i) {
    EXPECT_LT(
        (Eigen::Map<const Eigen::VectorXd>(system.rhs(i), kWidth) - b.segment(i * kWidth, kWidth))
            .norm(),
        1e-5 * b.norm())
        << "state " << i;
  }
  Eigen::MatrixXd ours(x.size(), x.size());
  for (Eigen::Index i = 0; i < x.size(); ++i) {
    const Eigen::VectorXd unit = Eigen::VectorXd::Unit(x.size(), i);
    const auto n = static_cast<std::size_t>(x.size());
    system.product({unit.data(), n}, {ours.col(i).data(), n});
  }
  EXPECT_LT((ours - h).norm(), 1e-5 * h.norm());
}

TEST_F(ChainModelTest, EvaluatesAStepWithoutTakingIt) {
  ChainModel model;
  model.reset(problem_, initial_);
  const double before = model.current().cost;
  const std::vector<double> step(model.current().support.size(), 0.01);
  const double tried = model.try_step(step);
  EXPECT_EQ(model.current().cost, before);
  model.accept();
  EXPECT_EQ(model.current().cost, tried);
  EXPECT_DOUBLE_EQ(model.current().support[3], initial_.q(0)[3] + 0.01);
}

}  // namespace
}  // namespace sidestep
