#include <algorithm>
#include <cmath>
#include <numbers>
#include <vector>

#include <gtest/gtest.h>

#include <sidestep/core/index.hpp>
#include <sidestep/trajectory/braking.hpp>
#include <sidestep/trajectory/retime.hpp>
#include <sidestep/trajectory/rolling.hpp>

namespace sidestep {
namespace {

constexpr double kPi = std::numbers::pi;
constexpr RollingBase kBase{0, 1, 2};

MotionLimits limits_of_base() {
  MotionLimits limits;
  limits.velocity = {1.0, 1.0, 2.0};
  limits.acceleration = {1.0, 1.0, 2.0};
  limits.rolling = kBase;
  return limits;
}

/// A circle of 1 m at 0.5 m/s, as its states have it, `step_s` apart.
Trajectory circle(double step_s, double duration_s) {
  Trajectory out =
      make_trajectory(3, 1 + static_cast<int>(std::lround(duration_s / step_s)), step_s);
  for (int i = 0; i < out.size(); ++i) {
    const double angle = 0.5 * step_s * i;
    out.q(i)[0] = std::sin(angle);
    out.q(i)[1] = 1.0 - std::cos(angle);
    out.q(i)[2] = angle;
    out.qdot(i)[0] = 0.5 * std::cos(angle);
    out.qdot(i)[1] = 0.5 * std::sin(angle);
    out.qdot(i)[2] = 0.5;
  }
  return out;
}

/// The greatest speed across the heading, and along it, every half millisecond.
BaseSpeed greatest(const Trajectory& trajectory) {
  BaseSpeed most;
  std::vector<double> q(3), qdot(3);
  for (double t = 0.0; t <= trajectory.duration_s(); t += 5e-4) {
    trajectory.sample(t, q, qdot);
    const double across = qdot[1] * std::cos(q[2]) - qdot[0] * std::sin(q[2]);
    const double along = qdot[0] * std::cos(q[2]) + qdot[1] * std::sin(q[2]);
    most.left_mps = std::max(most.left_mps, std::abs(across));
    most.ahead_mps = std::max(most.ahead_mps, std::abs(along));
  }
  return most;
}

TEST(Rolling, SpeedIsThatInTheBasesFrame) {
  const std::vector<double> q = {3.0, 4.0, kPi / 6}, qdot = {0.0, 2.0, 1.0};
  const BaseSpeed speed = base_speed(kBase, q, qdot);
  EXPECT_NEAR(speed.ahead_mps, 1.0, 1e-12);
  EXPECT_NEAR(speed.left_mps, std::sqrt(3.0), 1e-12);
}

// Cubics of a second slip on a circle by a few tenths of a millimetre a second.
TEST(Rolling, KeepsToACircle) {
  Trajectory trajectory = circle(1.0, 6.0);
  ASSERT_GT(greatest(trajectory).left_mps, 1e-4);
  const Trajectory before = trajectory;
  ASSERT_TRUE(roll(kBase, trajectory));
  EXPECT_LT(greatest(trajectory).left_mps, kSlipTolerance_mps);
  const int last = trajectory.size() - 1;
  for (std::size_t j = 0; j < 3; ++j) {
    EXPECT_EQ(trajectory.q(0)[j], before.q(0)[j]);
    EXPECT_EQ(trajectory.q(last)[j], before.q(6)[j]);
  }
  std::vector<double> q(3);
  for (double t = 0.0; t < 6.0; t += 0.1) {
    trajectory.sample(t, q, {});
    EXPECT_NEAR(std::hypot(q[0], q[1] - 1.0), 1.0, 1e-3);
  }
}

TEST(Rolling, LeavesAloneWhatSlipsTooMuch) {
  Trajectory sideways = straight_line({Eigen::Vector3d(0, 0, 0), Eigen::Vector3d::Zero()},
                                      {Eigen::Vector3d(0, 1, 0), Eigen::Vector3d::Zero()}, 4, 1.0);
  const Trajectory before = sideways;
  EXPECT_FALSE(roll(kBase, sideways));
  EXPECT_EQ(sideways.positions, before.positions);
  const RollingExtremes most = rolling_extremes(kBase, before, 0.0, before.duration_s());
  EXPECT_GT(most.left_mps, 0.3);
  EXPECT_NEAR(most.ahead_mps, 0.0, 1e-12);
}

TEST(Rolling, IsNoFasterAlongItsWheelsThanAlongX) {
  // At 45 degrees each of x and y could go at 1 m/s, the wheels at 1.4.
  Trajectory path =
      straight_line({Eigen::Vector3d(0, 0, kPi / 4), Eigen::Vector3d::Zero()},
                    {Eigen::Vector3d(4, 4, kPi / 4), Eigen::Vector3d::Zero()}, 2, 1.0);
  const auto timed = retime(path, limits_of_base());
  ASSERT_TRUE(timed) << timed.error().describe();
  const BaseSpeed most = greatest(timed->trajectory);
  EXPECT_LE(most.ahead_mps, 1.0 + 1e-9);
  EXPECT_GT(most.ahead_mps, 0.999);
  EXPECT_LT(most.left_mps, 1e-9);
  // A trapezoid: 5.66 m at 1 m/s, up and down in 1 s each.
  EXPECT_NEAR(timed->trajectory.duration_s(), std::sqrt(32.0) + 1.0, 0.01);
}

TEST(Rolling, StopsOnTheCircleItDrives) {
  Trajectory drive = circle(0.02, 6.0);
  ASSERT_TRUE(roll(kBase, drive));
  const auto stop = brake(drive, 2.0, limits_of_base());
  ASSERT_TRUE(stop) << stop.error().describe();
  EXPECT_LT(greatest(*stop).left_mps, kSlipTolerance_mps);
  const auto end = stop->q(stop->size() - 1);
  EXPECT_NEAR(std::hypot(end[0], end[1] - 1.0), 1.0, 1e-3);
  for (const double rate : stop->qdot(stop->size() - 1)) EXPECT_NEAR(rate, 0.0, 1e-9);
}

// Without a path it is an arc: 0.5 m/s and 1 rad/s, down to nothing evenly.
TEST(Rolling, StopsOnAnArcWithoutAPath) {
  const RobotState state{Eigen::Vector3d(0, 0, 0), Eigen::Vector3d(0.5, 0.0, 1.0)};
  const auto stop = brake_straight(state, limits_of_base());
  ASSERT_TRUE(stop) << stop.error().describe();
  EXPECT_NEAR(stop->duration_s(), 0.5, 1e-3);
  EXPECT_LT(greatest(*stop).left_mps, kSlipTolerance_mps);
  const auto end = stop->q(stop->size() - 1);
  const double turn = 0.5 * 1.0 * stop->duration_s(), radius_m = 0.5;
  EXPECT_NEAR(end[2], turn, 1e-9);
  EXPECT_NEAR(end[0], radius_m * std::sin(turn), 1e-6);
  EXPECT_NEAR(end[1], radius_m * (1.0 - std::cos(turn)), 1e-6);
}

}  // namespace
}  // namespace sidestep
