#include "waypoints.hpp"

#include <numeric>

#include <gtest/gtest.h>
#include <Eigen/LU>

#include <sidestep/planning/costs.hpp>

#include "conformance/analytic_models.hpp"
#include "support/in_doubles.hpp"
#include "support/waypoint_problem.hpp"

namespace sidestep {
namespace {

/// An arm that is too fast, near itself, near its limits and near a ball, all at once.
class WaypointTermsTest : public testing::Test {
 protected:
  WaypointTermsTest() {
    problem_.robot = std::make_shared<conformance::PlanarRobot>(
        conformance::PlanarRobot::Shape{.rotary_joints = 3});
    problem_.field = std::make_shared<conformance::BallField>(
        std::vector<conformance::Ball>{{{0.5, 0.4, 0.0}, 0.2}});
    problem_.start = {Eigen::Vector3d(-0.4, 0.2, 0.1), Eigen::Vector3d(0.1, 0.0, -0.2)};
    problem_.goal = {Eigen::Vector3d(1.0, 0.9, 2.0), Eigen::Vector3d::Zero()};
    problem_.support_states = 6;
    problem_.dt_s = 0.3;
    problem_.qc = Eigen::Vector3d(0.5, 1.0, 2.0);
    problem_.interpolated_checks = 2;
    problem_.terms = standard_terms(problem_, {.epsilon_m = 0.4,
                                               .self_collision_epsilon_m = 0.4,
                                               .position_limit_margin = 1.0,
                                               .sigma_endpoint = 1.0});
    problem_.terms.push_back(
        {make_state_prior("posture", problem_.start, 0.7), Placement::kSupport});
    problem_ = testing_support::linearised_in_doubles(problem_);
    states_ = std::make_unique<WaypointStates>(problem_);
    std::srand(3);
    positions_ = states_->positions_of(straight_line(problem_.start, problem_.goal, 6, 0.3)) +
                 0.6 * Waypoints::Random(3, 6);
    states_->update(positions_);
  }

  [[nodiscard]] static double total(const std::vector<TermCost>& terms) {
    double sum = 0.0;
    for (const TermCost& term : terms) sum += term.cost;
    return sum;
  }

  Problem problem_;
  std::unique_ptr<WaypointStates> states_;
  Waypoints positions_;
};

TEST_F(WaypointTermsTest, SumUpInEveryWay) {
  WaypointTerms terms(problem_, {});
  Waypoints gradient = Waypoints::Zero(3, 6);
  std::vector<double> costs(static_cast<std::size_t>(states_->states()));
  terms.add_costs(*states_, costs);
  const std::vector<TermCost> by_term = term_costs(problem_, *states_);
  for (const TermCost& term : by_term) EXPECT_GT(term.cost, 0.0) << term.name;
  const double expected = total(by_term) - by_term.front().cost;
  EXPECT_NEAR(terms.add_gradient(*states_, gradient), expected, 1e-9 * expected);
  EXPECT_NEAR(std::accumulate(costs.begin(), costs.end(), 0.0), expected, 1e-9 * expected);
}

TEST_F(WaypointTermsTest, LeaveOutWhatIsNamed) {
  WaypointTerms terms(problem_, {"obstacle", "posture"});
  Waypoints gradient = Waypoints::Zero(3, 6);
  double expected = 0.0;
  for (const TermCost& term : term_costs(problem_, *states_)) {
    const bool is_left_out =
        term.name == "obstacle" || term.name == "posture" || term.name == "gp_prior";
    if (!is_left_out) expected += term.cost;
  }
  EXPECT_NEAR(terms.add_gradient(*states_, gradient), expected, 1e-9 * expected);
}

TEST_F(WaypointTermsTest, HaveTheGradientOfTheirCost) {
  WaypointTerms terms(problem_, {});
  Waypoints gradient = Waypoints::Zero(3, 6), ignored = gradient;
  (void)terms.add_gradient(*states_, gradient);
  for (Eigen::Index i = 0; i < positions_.size(); ++i) {
    constexpr double kStep = 1e-6;
    const auto cost_at = [&](double step) {
      Waypoints moved = positions_;
      moved(i) += step;
      states_->update(moved);
      return terms.add_gradient(*states_, ignored);
    };
    const double difference = (cost_at(kStep) - cost_at(-kStep)) / (2.0 * kStep);
    EXPECT_NEAR(gradient(i), difference, 1e-4 * (1.0 + std::abs(difference))) << "value " << i;
  }
}

/// Q(dt) written out from docs/numerics.md.
TEST_F(WaypointTermsTest, CountTheGpPrior) {
  const double dt = problem_.dt_s;
  const Trajectory trajectory = states_->trajectory();
  double expected = 0.0;
  for (int i = 0; i + 1 < trajectory.size(); ++i) {
    for (std::size_t j = 0; j < 3; ++j) {
      Eigen::Matrix2d q;
      q << dt * dt * dt / 3.0, dt * dt / 2.0, dt * dt / 2.0, dt;
      q *= problem_.qc[static_cast<Eigen::Index>(j)];
      const Eigen::Vector2d e(
          trajectory.q(i)[j] + dt * trajectory.qdot(i)[j] - trajectory.q(i + 1)[j],
          trajectory.qdot(i)[j] - trajectory.qdot(i + 1)[j]);
      expected += 0.5 * e.dot(q.inverse() * e);
    }
  }
  EXPECT_NEAR(term_costs(problem_, *states_).front().cost, expected, 1e-9 * expected);
}

}  // namespace
}  // namespace sidestep
