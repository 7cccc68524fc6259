#include <gtest/gtest.h>

#include <sidestep/field/scene_field.hpp>
#include <sidestep/trajectory/splice.hpp>

#include "field_check_testing.hpp"

namespace sidestep {
namespace {

using testing_support::rest_to_rest;

class LeavingTest : public FieldCheckTest {};

/// A ball of 0.1 m whose centre is 0.06 m before the wall: 0.04 m in it.
TEST_F(LeavingTest, LetsASphereLeaveWhatItStandsIn) {
  const Eigen::Vector3d start(0.11, 0.0, 0.05);
  const auto outcome_to = [&](const Eigen::Vector3d& end) {
    return check(rest_to_rest(start, end, 2.0)).outcome;
  };
  EXPECT_EQ(outcome_to({0.5, 0.0, 0.05}), Verdict::Outcome::kInvalid);
  space_.leaving = std::make_shared<const Leaving>(Leaving{{start}, {0.05}});
  EXPECT_EQ(outcome_to({0.5, 0.0, 0.05}), Verdict::Outcome::kValid);     // straight out
  EXPECT_EQ(outcome_to({0.5, 0.5, 0.05}), Verdict::Outcome::kValid);     // at 45 degrees
  EXPECT_EQ(outcome_to({0.18, 0.5, 0.05}), Verdict::Outcome::kInvalid);  // hardly out
  EXPECT_EQ(outcome_to({0.11, 0.3, 0.05}), Verdict::Outcome::kInvalid);  // along
  EXPECT_EQ(outcome_to({0.08, 0.0, 0.05}), Verdict::Outcome::kInvalid);  // deeper
  // Elsewhere the wall is as it was: out, and in again.
  const Trajectory out = rest_to_rest(start, Eigen::Vector3d(0.5, 0.0, 0.05), 2.0);
  const Trajectory in =
      rest_to_rest(Eigen::Vector3d(0.5, 0.0, 0.05), Eigen::Vector3d(0.11, 0.25, 0.05), 2.0);
  EXPECT_EQ(check(joined(out, in)).outcome, Verdict::Outcome::kInvalid);
  // Other spheres have no such leave.
  space_.leaving = std::make_shared<const Leaving>(Leaving{{start}, {0.0}});
  EXPECT_EQ(outcome_to({0.5, 0.0, 0.05}), Verdict::Outcome::kInvalid);
}

/// What is allowed along the way is what the rule says at each of many instants.
TEST_F(LeavingTest, ProvesThatASphereLeavesAtEveryInstant) {
  const Eigen::Vector3d start(0.11, 0.0, 0.05);
  const double depth_m = 0.05;
  space_.leaving = std::make_shared<const Leaving>(Leaving{{start}, {depth_m}});
  const auto field = world_.field();
  int valid = 0;
  for (int i = 0; i < 60; ++i) {
    const double bearing_rad = -1.6 + 3.2 * i / 59;
    const Eigen::Vector3d end =
        start + 0.3 * Eigen::Vector3d(std::cos(bearing_rad), std::sin(bearing_rad), 0.0);
    const Trajectory way = rest_to_rest(start, end, 2.0);
    double least_m = 1.0;
    for (int k = 0; k <= 4000; ++k) {
      Eigen::Vector3d at;
      way.sample(2.0 * k / 4000, {at.data(), 3}, {});
      double distance_m = 0.0;
      FieldStatus status{};
      field->query({&at, 1}, {&distance_m, 1}, {}, {&status, 1});
      const double allowed_m = std::max(0.0, depth_m - 0.5 * (at - start).norm());
      least_m = std::min(least_m, distance_m - 0.1 + allowed_m);
    }
    const bool is_valid = check(way).outcome == Verdict::Outcome::kValid;
    valid += is_valid;
    EXPECT_TRUE(!is_valid || least_m >= -1e-6) << bearing_rad << ": " << least_m;
    EXPECT_TRUE(is_valid || least_m <= 2e-3) << bearing_rad << ": " << least_m;
  }
  EXPECT_GT(valid, 20);
  EXPECT_LT(valid, 50);
}

/// Towards the wall and back, from an instant at which the ball is as deep as it may be, but for
/// 0.012 m: a dip of more than 0.008 m, a third of the time after it, is too much.
TEST_F(LeavingTest, SeesASphereGoDeeperAndBackBetweenChecks) {
  const Scene wall(
      {{"wall", Box{{2.0, 4.0, 4.0}}, {{0.0, Transform(Eigen::Translation3d(-1, 0, 0))}}}});
  const auto field = std::make_shared<SceneField>(
      wall, Stamp{}, Eigen::AlignedBox3d(Eigen::Vector3d(-2, -2, -2), Eigen::Vector3d(2, 2, 2)));
  const Eigen::Vector3d start(0.06, 0.0, 0.0);
  space_.leaving = std::make_shared<const Leaving>(Leaving{{start}, {0.052}});
  settings_.max_step_m = 10.0;
  const auto is_valid = [&](double dip_m) {
    Trajectory way = rest_to_rest(start, start, 1.0);
    way.qdot(0)[0] = -27.0 / 4.0 * dip_m;
    const auto verdict =
        make_field_check(robot_, field, space_, settings_)->check(way, 0.0, Deadline());
    return verdict && verdict->valid();
  };
  EXPECT_TRUE(is_valid(0.007));
  EXPECT_FALSE(is_valid(0.0081));
}

}  // namespace
}  // namespace sidestep
