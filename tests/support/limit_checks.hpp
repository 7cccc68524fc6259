#pragma once

#include <functional>
#include <limits>
#include <string>

#include <gtest/gtest.h>

#include <sidestep/planning/validity_check.hpp>

#include "support/chain_robot.hpp"

namespace sidestep::testing_support {

/// Along a straight line in joint space.
[[nodiscard]] inline Trajectory rest_to_rest(const Eigen::VectorXd& from, const Eigen::VectorXd& to,
                                             double duration_s) {
  Trajectory trajectory = make_trajectory(static_cast<int>(from.size()), 2, duration_s);
  for (Eigen::Index j = 0; j < from.size(); ++j) {
    trajectory.q(0)[static_cast<std::size_t>(j)] = from[j];
    trajectory.q(1)[static_cast<std::size_t>(j)] = to[j];
  }
  return trajectory;
}

/// A check of a flying ball among no obstacles near y = 1.2, and what its settings let pass.
struct CheckOfLimits {
  RobotDescription& robot;
  double& speed_fraction;
  double& acceleration_fraction;
  bool tells_values;  ///< Of the limits that are broken.
  std::function<Verdict(const Trajectory&)> check;

  [[nodiscard]] std::string limit(const std::string& which, const std::string& value) const {
    return "its " + which + (tells_values ? " of " + value : "");
  }
};

inline void expect_limits_between_support_states(const CheckOfLimits& of) {
  of.robot.joints[0].lower = -0.4;
  of.robot.joints[0].upper = 0.4;
  of.robot.joints[0].max_velocity = 3.2;
  of.speed_fraction = 0.5;
  for (const double sign : {1.0, -1.0}) {
    Trajectory arc = make_trajectory(3, 2, 1.0);
    arc.q(0)[1] = arc.q(1)[1] = 1.2;
    arc.qdot(0)[0] = 3.0 * sign;
    const Verdict verdict = of.check(arc);
    ASSERT_EQ(verdict.outcome, Verdict::Outcome::kInvalid);
    ASSERT_EQ(verdict.violations.size(), 2u);
    EXPECT_EQ(verdict.violations[0].kind, Violation::Kind::kPositionLimit);
    EXPECT_EQ(verdict.violations[0].subject, "x");
    EXPECT_EQ(verdict.violations[0].other,
              sign > 0.0 ? of.limit("upper limit", "0.4 m") : of.limit("lower limit", "-0.4 m"));
    // x(t) = 3 t (1 - t)^2 is largest at t = 1/3: 4/9.
    EXPECT_NEAR(verdict.violations[0].amount, 4.0 / 9.0 - 0.4, 1e-6);
    EXPECT_NEAR(verdict.violations[0].time_s, 1.0 / 3.0, 1e-3);
    EXPECT_EQ(verdict.violations[1].kind, Violation::Kind::kVelocityLimit);
    EXPECT_NEAR(verdict.violations[1].amount, 3.0 - 1.6, 1e-9);
    EXPECT_EQ(verdict.violations[1].other, of.limit("velocity limit", "1.6 m/s"));
  }
}

inline void expect_acceleration_limits_where_asked(const CheckOfLimits& of) {
  of.robot.joints[0].max_acceleration = 1.6;
  // Over 1 m in 2 s: 6 / 2^2 = 1.5 m/s^2 at both ends, or at one end alone, in either direction.
  const Trajectory way = rest_to_rest(Eigen::Vector3d(-1, 1.2, 0), Eigen::Vector3d(0, 1.2, 0), 2.0);
  EXPECT_TRUE(of.check(way).valid());
  of.acceleration_fraction = 1.0;
  EXPECT_TRUE(of.check(way).valid());
  of.acceleration_fraction = 0.5;
  Trajectory up = make_trajectory(3, 2, 2.0), down = up;
  up.q(0)[1] = up.q(1)[1] = down.q(0)[1] = down.q(1)[1] = 1.2;
  // Evenly, at 1.5 m/s^2 and at -1.5 m/s^2.
  up.qdot(0)[0] = down.qdot(1)[0] = -1.5;
  up.qdot(1)[0] = down.qdot(0)[0] = 1.5;
  for (const Trajectory& motion : {way, up, down}) {
    const Verdict verdict = of.check(motion);
    ASSERT_EQ(verdict.outcome, Verdict::Outcome::kInvalid);
    ASSERT_EQ(verdict.violations.size(), 1u);
    EXPECT_EQ(verdict.violations[0].kind, Violation::Kind::kAccelerationLimit);
    EXPECT_EQ(verdict.violations[0].subject, "x");
    EXPECT_EQ(verdict.violations[0].other, of.limit("acceleration limit", "0.8 m/s^2"));
    EXPECT_NEAR(verdict.violations[0].amount, 1.5 - 0.8, 1e-9);
  }
  of.robot.joints[0].max_acceleration = std::numeric_limits<double>::infinity();
  EXPECT_TRUE(of.check(way).valid());
}

}  // namespace sidestep::testing_support
