#include "waypoints.hpp"

#include <cstdlib>

#include <gtest/gtest.h>

#include "conformance/analytic_models.hpp"
#include "support/waypoint_problem.hpp"

namespace sidestep {
namespace {

Problem states_problem(int checks, int waypoints = 7) {
  Problem problem;
  problem.robot = std::make_shared<conformance::PlanarRobot>(conformance::PlanarRobot::Shape{2});
  problem.start = {Eigen::Vector2d(0.3, -0.2), Eigen::Vector2d(0.4, 0.1)};
  problem.goal = {Eigen::Vector2d(-0.5, 0.9), Eigen::Vector2d(-0.3, 0.2)};
  problem.support_states = waypoints;
  problem.dt_s = 0.3;
  problem.qc = Eigen::Vector2d::Ones();
  problem.interpolated_checks = checks;
  return problem;
}

Waypoints random_waypoints(const WaypointStates& states, const Problem& problem) {
  std::srand(5);
  Trajectory trajectory = make_trajectory(states.dof(), states.waypoints(), problem.dt_s);
  Eigen::Map<Eigen::VectorXd>(trajectory.positions.data(),
                              static_cast<Eigen::Index>(trajectory.positions.size()))
      .setRandom();
  return states.positions_of(trajectory);
}

TEST(WaypointStates, AreTheTrajectoryThatIsHandedOut) {
  for (const int checks : {0, 1, 3}) {
    const Problem problem = states_problem(checks);
    WaypointStates states(problem);
    states.update(random_waypoints(states, problem));
    const Trajectory trajectory = states.trajectory();
    const StateBatch all = states.everywhere();
    ASSERT_EQ(all.count, 6 * (checks + 1) + 1);
    std::vector<double> q(2), qdot(2);
    for (std::size_t s = 0; s < all.times_s.size(); ++s) {
      trajectory.sample(all.times_s[s], q, qdot);
      for (std::size_t j = 0; j < 2; ++j) {
        EXPECT_NEAR(all.q[2 * s + j], q[j], 1e-12) << "state " << s;
        EXPECT_NEAR(all.qdot[2 * s + j], qdot[j], 1e-12) << "state " << s;
      }
    }
  }
}

TEST(WaypointStates, HaveTheEndsOfTheProblemAndCentralDifferencesBetween) {
  const Problem problem = states_problem(0);
  WaypointStates states(problem);
  const Waypoints positions = random_waypoints(states, problem);
  states.update(positions);
  const Trajectory trajectory = states.trajectory();
  for (std::size_t j = 0; j < 2; ++j) {
    const auto k = static_cast<Eigen::Index>(j);
    EXPECT_EQ(trajectory.q(0)[j], problem.start.q[k]);
    EXPECT_EQ(trajectory.qdot(0)[j], problem.start.qdot[k]);
    EXPECT_EQ(trajectory.q(6)[j], problem.goal.q[k]);
    EXPECT_EQ(trajectory.qdot(6)[j], problem.goal.qdot[k]);
    EXPECT_NEAR(trajectory.qdot(3)[j], (positions(k, 4) - positions(k, 2)) / 0.6, 1e-12);
  }
}

/// A random linear function of all states, whose gradient by waypoints is differenced.
TEST(WaypointStates, PullGradientsBackOntoWaypoints) {
  for (const auto& [checks, waypoints] : {std::pair{0, 3}, {2, 3}, {2, 4}, {3, 7}}) {
    const Problem problem = states_problem(checks, waypoints);
    WaypointStates states(problem);
    Waypoints positions = random_waypoints(states, problem);
    const Eigen::MatrixXd by_q = Eigen::MatrixXd::Random(2, states.states());
    const Eigen::MatrixXd by_qdot = Eigen::MatrixXd::Random(2, states.states());
    const auto value = [&] {
      states.update(positions);
      const StateBatch all = states.everywhere();
      return by_q.cwiseProduct(Eigen::Map<const Eigen::MatrixXd>(all.q.data(), 2, all.count))
                 .sum() +
             by_qdot.cwiseProduct(Eigen::Map<const Eigen::MatrixXd>(all.qdot.data(), 2, all.count))
                 .sum();
    };
    Waypoints gradient = Waypoints::Zero(2, waypoints);
    states.pull_back(by_q, by_qdot, gradient);
    for (Eigen::Index i = 0; i < positions.size(); ++i) {
      const double before = value();
      positions(i) += 1.0;
      EXPECT_NEAR(gradient(i), value() - before, 1e-9) << checks << " checks, value " << i;
      positions(i) -= 1.0;
    }
  }
}

}  // namespace
}  // namespace sidestep
