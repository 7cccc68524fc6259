#include "factors.hpp"

#include <random>

#include <gtest/gtest.h>
#include <Eigen/QR>

#include <sidestep/planning/costs.hpp>

#include "conformance/analytic_models.hpp"
#include "conformance/cost_conformance.hpp"

namespace sidestep {
namespace {

using conformance::Ball;
using conformance::BallField;
using conformance::PlanarRobot;

/// A residual stack [J, r] has the same cost, gradient and Hessian as its R factor.
TEST(ReduceToR, KeepsTheNormalEquations) {
  std::srand(3);
  for (const auto& [rows, columns] : {std::pair{12, 5}, {5, 5}, {7, 6}}) {
    Eigen::MatrixXd a = Eigen::MatrixXd::Random(rows, columns);
    a.col(2) = 2.0 * a.col(1);  // singular, as the Jacobian of few spheres is
    Eigen::MatrixXd r = a;
    reduce_to_r(r.data(), static_cast<std::size_t>(rows), static_cast<std::size_t>(columns),
                static_cast<std::size_t>(rows));
    const Eigen::MatrixXd upper = r.topRows(columns).triangularView<Eigen::Upper>();
    EXPECT_TRUE((upper.transpose() * upper).isApprox(a.transpose() * a, 1e-13));
  }
}

TEST(ReduceToR, LeavesZerosAlone) {
  Eigen::MatrixXd r = Eigen::MatrixXd::Zero(6, 3);
  reduce_to_r(r.data(), 6, 3, 6);
  EXPECT_TRUE(r.isZero(0.0));
}

class StateRowsTest : public testing::Test {
 protected:
  StateRowsTest() {
    problem_.robot = std::make_shared<PlanarRobot>(PlanarRobot::Shape{3, true, 6});
    problem_.field = std::make_shared<BallField>(
        std::vector<Ball>{{{0.4, 0.3, 0.1}, 0.2}, {{-0.5, -0.2, 0.2}, 0.3}});
    problem_.start = {Eigen::VectorXd::Constant(5, -0.4), Eigen::VectorXd::Zero(5)};
    problem_.goal = {Eigen::VectorXd::Constant(5, 0.4), Eigen::VectorXd::Zero(5)};
    problem_.support_states = 4;
    problem_.dt_s = 0.3;
    problem_.qc = Eigen::VectorXd::LinSpaced(5, 0.5, 2.0);
    problem_.interpolated_checks = 2;
    problem_.terms = standard_terms(problem_, {.epsilon_m = 0.6});
    problem_.terms.push_back(
        {make_state_prior("posture", problem_.start, 0.7), Placement::kSupport});
    const auto random = conformance::random_states(5, 4, 0.8, 2.5, 5);
    for (std::size_t i = 0; i < 4; ++i) {
      support_.insert(support_.end(), &random.q[5 * i], &random.q[5 * i] + 5);
      support_.insert(support_.end(), &random.qdot[5 * i], &random.qdot[5 * i] + 5);
    }
  }

  /// The unreduced rows [dr/dq, dr/dqdot, r] of all terms at one state, evaluated alone.
  Eigen::MatrixXd direct_rows(int state) {
    Trajectory trajectory = make_trajectory(5, 4, problem_.dt_s);
    for (int i = 0; i < 4; ++i) {
      std::copy_n(&support_[static_cast<std::size_t>(i) * 10], 5, trajectory.q(i).begin());
      std::copy_n(&support_[static_cast<std::size_t>(i) * 10 + 5], 5, trajectory.qdot(i).begin());
    }
    conformance::States at{5, std::vector<double>(5), std::vector<double>(5), {state * 0.1}};
    trajectory.sample(state * problem_.dt_s / 3.0, at.q, at.qdot);
    std::vector<Eigen::VectorXd> rows;
    for (const CostTerm& term : problem_.terms) {
      const bool applies = term.placement == Placement::kStart     ? state == 0
                           : term.placement == Placement::kGoal    ? state == 9
                           : term.placement == Placement::kSupport ? state % 3 == 0
                                                                   : true;
      if (!applies) continue;
      const auto evaluation = conformance::evaluate(*term.cost, at);
      for (std::size_t m = 0; m < evaluation.residuals.size(); ++m) {
        Eigen::VectorXd row(11);
        row << Eigen::Map<const Eigen::VectorXd>(&evaluation.jacobian_q[5 * m], 5),
            Eigen::Map<const Eigen::VectorXd>(&evaluation.jacobian_qdot[5 * m], 5),
            evaluation.residuals[m];
        rows.push_back(row);
      }
    }
    Eigen::MatrixXd stacked(rows.size(), 11);
    for (std::size_t i = 0; i < rows.size(); ++i) {
      stacked.row(static_cast<Eigen::Index>(i)) = rows[i].transpose();
    }
    return stacked;
  }

  Problem problem_;
  std::vector<double> support_;
};

TEST_F(StateRowsTest, HasTheNormalEquationsOfItsTerms) {
  const GpPrior prior(problem_.qc, problem_.dt_s);
  StateRows rows(problem_, prior);
  rows.update(support_);
  ASSERT_EQ(rows.state_count(), 10);
  double cost = 0.0;
  for (int s = 0; s < rows.state_count(); ++s) {
    const Eigen::MatrixXd expected = direct_rows(s);
    const Eigen::Map<const Eigen::Matrix<double, Eigen::Dynamic, 11, Eigen::RowMajor>> actual(
        rows.rows(s).data(), rows.row_count(s), 11);
    EXPECT_LT(rows.row_count(s), expected.rows()) << "state " << s << " is not reduced";
    const Eigen::MatrixXd difference =
        actual.transpose() * actual - expected.transpose() * expected;
    EXPECT_LT(difference.norm(), 1e-9 * expected.squaredNorm()) << "state " << s;
    cost += 0.5 * expected.col(10).squaredNorm();
  }
  double terms = 0.0;
  for (std::size_t t = 0; t < problem_.terms.size(); ++t) terms += rows.term_cost(t);
  EXPECT_NEAR(terms, cost, 1e-9 * cost);
}

}  // namespace
}  // namespace sidestep
