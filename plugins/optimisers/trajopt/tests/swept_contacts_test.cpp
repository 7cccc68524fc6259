#include "convex_model.hpp"

#include <algorithm>
#include <random>

#include <gtest/gtest.h>

#include "conformance/analytic_models.hpp"
#include "support/waypoint_problem.hpp"

namespace sidestep {
namespace {

using conformance::Ball;
using conformance::BallField;

/// The least clearance of each sphere between two states, by dense samples of the trajectory.
double dense_clearance_m(const Problem& problem, const Trajectory& trajectory, double from_s,
                         double to_s, std::size_t sphere) {
  const auto& spheres = problem.robot->description().spheres;
  std::vector<double> q(static_cast<std::size_t>(trajectory.dof));
  std::vector<Eigen::Vector3d> centres(spheres.size());
  std::vector<double> distances(spheres.size());
  Scratch scratch;
  double least = 1e9;
  for (int i = 0; i <= 400; ++i) {
    trajectory.sample(from_s + (to_s - from_s) * i / 400.0, q, {});
    problem.robot->sphere_centres(q, centres, scratch);
    problem.field->query(centres, distances, {}, {});
    least = std::min(least, distances[sphere] - spheres[sphere].radius_m);
  }
  return least;
}

/// A ball thinner than a step, between two waypoints that are both clear of it.
TEST(SweptContacts, SeeWhatLiesBetweenTwoStates) {
  Problem problem = disc_problem(3, {-1.0, 0.0}, {1.0, 0.0});
  problem.start.q.x() = -2.0;
  problem.goal.q.x() = 2.0;
  problem.field = std::make_shared<BallField>(std::vector<Ball>{{{1.1, 0.1, 0.0}, 0.05}});
  WaypointStates states(problem);
  states.update((Waypoints(2, 3) << -2.0, 0.0, 2.0, 0.0, 0.0, 0.0).finished());
  SweptContacts swept(problem);
  const auto contacts = swept.find(states, 0.2);
  ASSERT_EQ(contacts.size(), 1u);
  EXPECT_EQ(contacts[0].state, 1);
  EXPECT_NEAR(contacts[0].fraction, 0.55, 0.01);
  EXPECT_NEAR(contacts[0].clearance_m, 0.1 - 0.05 - kDiscRadius_m, SweptContacts::kSearch_m);
  EXPECT_LE(contacts[0].clearance_m, 0.1 - 0.05 - kDiscRadius_m + 1e-12);
  EXPECT_GT(contacts[0].normal.dot(-Eigen::Vector3d::UnitY()), 0.9);
}

/// No contact claims more clearance than the motion has; what is left out has none to be missed.
TEST(SweptContacts, NeverClaimMoreThanTheMotionHas) {
  Problem problem;
  problem.robot = std::make_shared<conformance::PlanarRobot>(
      conformance::PlanarRobot::Shape{.rotary_joints = 2, .mobile = true});
  problem.start = {Eigen::Vector4d(-0.8, 0.1, 0.0, 0.4), Eigen::Vector4d::Zero()};
  problem.goal = {Eigen::Vector4d(0.8, 0.0, 1.5, -0.5), Eigen::Vector4d::Zero()};
  problem.support_states = 12;
  problem.dt_s = 0.3;
  problem.interpolated_checks = 2;
  problem.qc = Eigen::Vector4d::Ones();
  problem.field = std::make_shared<BallField>(
      std::vector<Ball>{{{0.0, 0.3, 0.0}, 0.2}, {{0.6, -0.3, 0.05}, 0.1}});
  constexpr double kReach_m = 0.15;
  std::mt19937_64 random(3);
  std::normal_distribution<double> normal;
  std::size_t found = 0;
  for (int trial = 0; trial < 5; ++trial) {
    WaypointStates states(problem);
    Waypoints positions = states.positions_of(straight_line(problem.start, problem.goal, 12, 0.3));
    for (double& value : positions.middleCols(1, 10).reshaped()) value += 0.05 * normal(random);
    states.update(positions);
    SweptContacts swept(problem);
    const auto contacts = swept.find(states, kReach_m);
    found += contacts.size();
    const Trajectory trajectory = states.trajectory();
    const StateBatch all = states.everywhere();
    for (int s = 0; s + 1 < all.count; ++s) {
      const auto at = static_cast<std::size_t>(s);
      for (std::size_t sphere = 0; sphere < 7; ++sphere) {
        const double truth_m =
            dense_clearance_m(problem, trajectory, all.times_s[at], all.times_s[at + 1], sphere);
        const auto contact = std::ranges::find_if(
            contacts, [&](const SweptContact& c) { return c.state == s && c.sphere == sphere; });
        if (contact == contacts.end()) {
          EXPECT_GE(truth_m, kReach_m - 1e-3) << "state " << s << ", sphere " << sphere;
        } else {
          // The bend of the way is estimated, from neighbours: a tenth of a millimetre beyond.
          EXPECT_LE(contact->clearance_m, truth_m + 1e-4) << "state " << s << ", sphere " << sphere;
          EXPECT_GE(contact->clearance_m, truth_m - 0.02) << "state " << s << ", sphere " << sphere;
        }
      }
    }
  }
  EXPECT_GT(found, 100u);
}

TEST(SweptContacts, FindTheFloor) {
  Problem problem = disc_problem(3, {-1.0, 0.0}, {1.0, 0.0});
  problem.field = nullptr;
  problem.space.floor = Floor{-0.2, {}};
  WaypointStates states(problem);
  states.update((Waypoints(2, 3) << -1.0, 0.0, 1.0, 0.0, 0.0, 0.0).finished());
  SweptContacts swept(problem);
  const auto contacts = swept.find(states, 0.1);
  ASSERT_EQ(contacts.size(), 2u);
  for (const SweptContact& contact : contacts) {
    EXPECT_NEAR(contact.clearance_m, 0.2 - kDiscRadius_m, 1e-12);
    EXPECT_EQ(contact.normal, Eigen::Vector3d(Eigen::Vector3d::UnitZ()));
  }
  EXPECT_TRUE(swept.find(states, 0.04).empty());
}

TEST(SweptContacts, FindNothingWhereNothingIs) {
  Problem problem = disc_problem(5, {-1.0, 0.0}, {1.0, 0.0});
  WaypointStates states(problem);
  states.update(Waypoints::Zero(2, 5));
  EXPECT_TRUE(SweptContacts(problem).find(states, 0.5).empty());
  problem.field = nullptr;
  EXPECT_TRUE(SweptContacts(problem).find(states, 0.5).empty());
}

}  // namespace
}  // namespace sidestep
