#include "chain_model.hpp"

#include <functional>

#include <gtest/gtest.h>
#include <Eigen/Cholesky>
#include <unsupported/Eigen/MatrixFunctions>

#include <sidestep/core/index.hpp>
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

  /// e of the prior of a joint: position, then velocity.
  static Eigen::Vector2d prior_error(const Trajectory& trajectory, int i, double dt_s,
                                     std::size_t joint) {
    return {trajectory.q(i)[joint] + dt_s * trajectory.qdot(i)[joint] - trajectory.q(i + 1)[joint],
            trajectory.qdot(i)[joint] - trajectory.qdot(i + 1)[joint]};
  }

  // Of the body, by logarithms and exponentials of matrices.

  Eigen::Vector3d of_base(std::span<const double> values) const {
    return {values[idx((*body_)[0])], values[idx((*body_)[1])], values[idx((*body_)[2])]};
  }
  Eigen::Matrix3d pose(std::span<const double> q) const {
    Eigen::Matrix3d T = Eigen::Matrix3d::Identity();
    T.topLeftCorner<2, 2>() = Eigen::Rotation2Dd(of_base(q)[2]).toRotationMatrix();
    T.topRightCorner<2, 1>() = of_base(q).head<2>();
    return T;
  }
  Eigen::Vector3d twist(std::span<const double> q, std::span<const double> qdot) const {
    Eigen::Vector3d twist = of_base(qdot);
    twist.head<2>() = Eigen::Rotation2Dd(-of_base(q)[2]) * twist.head<2>();
    return twist;
  }
  Eigen::Vector3d way(const Trajectory& trajectory, int i) const {
    const Eigen::Matrix3d log = (pose(trajectory.q(i)).inverse() * pose(trajectory.q(i + 1))).log();
    return {log(0, 2), log(1, 2), log(1, 0)};
  }
  Eigen::Vector3d twist(const Trajectory& trajectory, int i) const {
    return twist(trajectory.q(i), trajectory.qdot(i));
  }

  std::array<Eigen::Vector2d, 3> body_errors(const Trajectory& trajectory, int i,
                                             double dt_s) const {
    const Eigen::Vector3d place = dt_s * twist(trajectory, i) - way(trajectory, i),
                          speed = twist(trajectory, i) - twist(trajectory, i + 1);
    return {Eigen::Vector2d(place[0], speed[0]), Eigen::Vector2d(place[1], speed[1]),
            Eigen::Vector2d(place[2], speed[2])};
  }

  /// Between states i and i + 1.
  void put_base_between(const Trajectory& trajectory, int i, double fraction,
                        conformance::States& at) const {
    const auto [lambda, psi] = GpPrior({}, problem_.dt_s).interpolation(fraction);
    const auto mixed = [&](Eigen::Index row) -> Eigen::Vector3d {
      return lambda(row, 1) * twist(trajectory, i) + psi(row, 0) * way(trajectory, i) +
             psi(row, 1) * twist(trajectory, i + 1);
    };
    const Eigen::Vector3d moved = mixed(0), speed = mixed(1);
    Eigen::Matrix3d hat = Eigen::Matrix3d::Zero();
    hat(1, 0) = moved[2];
    hat(0, 1) = -moved[2];
    hat.topRightCorner<2, 1>() = moved.head<2>();
    const Eigen::Matrix3d T = pose(trajectory.q(i)) * hat.exp();
    const Eigen::Vector2d in_world = T.topLeftCorner<2, 2>() * speed.head<2>();
    for (std::size_t axis : {0, 1}) {
      at.q[idx((*body_)[axis])] = T(static_cast<Eigen::Index>(axis), 2);
      at.qdot[idx((*body_)[axis])] = in_world[static_cast<Eigen::Index>(axis)];
    }
    at.q[idx((*body_)[2])] = of_base(trajectory.q(i))[2] + moved[2];
    at.qdot[idx((*body_)[2])] = speed[2];
  }

  /// A state plus a step of one variable, velocities of a body being in its own frame.
  Eigen::VectorXd stepped(Eigen::VectorXd x, Eigen::Index variable, double step) const {
    const Eigen::VectorXd before = x;
    x[variable] += step;
    if (!body_) return x;
    const Eigen::Index first = variable / (2 * kDof) * 2 * kDof;
    const auto of = [&](const Eigen::VectorXd& values, Eigen::Index part) {
      return std::span(values.data() + first + part * kDof, kDof);
    };
    Eigen::Vector3d speed = twist(of(before, 0), of(before, 1));
    speed += of_base(of(x, 1)) - of_base(of(before, 1));
    speed.head<2>() = Eigen::Rotation2Dd(of_base(of(x, 0))[2]) * speed.head<2>();
    for (std::size_t axis : {0, 1, 2}) {
      x[first + kDof + (*body_)[axis]] = speed[static_cast<Eigen::Index>(axis)];
    }
    return x;
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
    Eigen::Matrix2d q;
    q << dt * dt * dt / 3.0, dt * dt / 2.0, dt * dt / 2.0, dt;
    for (int i = 0; i + 1 < kStates; ++i) {
      for (int j = 0; j < kDof; ++j) {
        Eigen::Vector2d e = prior_error(trajectory, i, dt, idx(j));
        for (std::size_t axis = 0; body_ && axis < 3; ++axis) {
          if ((*body_)[axis] == j) e = body_errors(trajectory, i, dt)[axis];
        }
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
        if (body_ && !support) {
          put_base_between(trajectory, s / (kChecks + 1), (s % (kChecks + 1)) / (kChecks + 1.0),
                           at);
        }
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
      jacobian.col(i) =
          (residuals(stepped(x, i, kStep)) - residuals(stepped(x, i, -kStep))) / (2.0 * kStep);
    }
    return jacobian;
  }

  void expect_normal_equations_of_residuals() const;

  Problem problem_;
  Trajectory initial_;
  std::optional<BodyChain::Base> body_;  ///< Whose body has the prior.
};

TEST_F(ChainModelTest, HasTheNormalEquationsOfItsResiduals) {
  expect_normal_equations_of_residuals();
}

TEST_F(ChainModelTest, HasThoseOfABodysPrior) {
  body_ = {3, 1, 4};
  expect_normal_equations_of_residuals();
}

TEST_F(ChainModelTest, HasThoseOfABodysPriorThatTurnsByNextToNothing) {
  body_ = {0, 1, 2};
  for (int i = 0; i < kStates; ++i) {
    initial_.q(i)[2] = 0.7 + 3e-4 * i;
    initial_.qdot(i)[2] = 1e-4 * i;
  }
  expect_normal_equations_of_residuals();
}

void ChainModelTest::expect_normal_equations_of_residuals() const {
  ChainModel model;
  model.reset(problem_, initial_, body_);
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

TEST_F(ChainModelTest, CostsNoPriorOfABodyThatDrivesAnArc) {
  body_ = {0, 1, 2};
  constexpr double kSpeed_mps = 0.8, kTurn_radps = 1.5, kRadius_m = kSpeed_mps / kTurn_radps;
  for (int i = 0; i < kStates; ++i) {
    const double yaw = 0.4 + kTurn_radps * i * problem_.dt_s;
    const std::array q{kRadius_m * std::sin(yaw), -kRadius_m * std::cos(yaw), yaw, 0.1, 0.2};
    const std::array qdot{kSpeed_mps * std::cos(yaw), kSpeed_mps * std::sin(yaw), kTurn_radps, 0.0,
                          0.0};
    std::ranges::copy(q, initial_.q(i).begin());
    std::ranges::copy(qdot, initial_.qdot(i).begin());
  }
  ChainModel model;
  model.reset(problem_, initial_, body_);
  EXPECT_LT(model.current().terms.front(), 1e-20);
  model.reset(problem_, initial_);
  EXPECT_GT(model.current().terms.front(), 1.0);
}

TEST_F(ChainModelTest, TakesStepsOfABodyInItsFrame) {
  body_ = {3, 1, 4};
  ChainModel model;
  model.reset(problem_, initial_, body_);
  const Eigen::VectorXd x =
      Eigen::Map<const Eigen::VectorXd>(model.current().support.data(), 2 * kDof * kStates);
  for (Eigen::Index variable = 0; variable < x.size(); ++variable) {
    std::vector<double> step(idx(x.size()), 0.0);
    step[idx(variable)] = 0.3;
    model.reset(problem_, initial_, body_);
    (void)model.try_step(step);
    model.accept();
    const Eigen::Map<const Eigen::VectorXd> after(model.current().support.data(), x.size());
    EXPECT_LT((after - stepped(x, variable, 0.3)).norm(), 1e-12) << variable;
  }
}

TEST_F(ChainModelTest, LeavesABodyThatDoesNotStepWhereItWas) {
  ChainModel model;
  model.reset(problem_, initial_, BodyChain::Base{3, 1, 4});
  const std::vector<double> before = model.current().support;
  (void)model.try_step(std::vector<double>(before.size(), 0.0));
  model.accept();
  EXPECT_EQ(model.current().support, before);
}

TEST_F(ChainModelTest, HasAnotherPriorWhereOnlyTheQcOfABodyIsAnother) {
  const BodyChain::Base body{3, 1, 4};
  ChainModel model, anew;
  model.reset(problem_, initial_, body);
  const double before = model.current().cost;
  problem_.qc[body[0]] *= 4.0;
  model.reset(problem_, initial_, body);
  anew.reset(problem_, initial_, body);
  EXPECT_EQ(model.current().cost, anew.current().cost);
  EXPECT_LT(model.current().cost, before);
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
