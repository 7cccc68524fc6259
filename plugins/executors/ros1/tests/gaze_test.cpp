#include "commands.hpp"

#include <numbers>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

namespace sidestep::ros1_executor {
namespace {

constexpr double kPi = std::numbers::pi;
constexpr double kHeld_rad = -0.3;

RobotDescription base_of_three() {
  RobotDescription robot;
  robot.name = "base";
  for (const char* name : {"odom_x", "odom_y", "odom_t"}) robot.joints.push_back({name});
  return robot;
}

Gaze gaze_of(const LookOptions& look) {
  auto gaze = Gaze::create(base_of_three(), OdometryOptions{}, look, kHeld_rad);
  EXPECT_TRUE(gaze);
  return *gaze;
}

/// At constant velocity for 20 s, looking along `yaw`.
Trajectory drive(double dx, double dy, double yaw) {
  const RobotState from{Eigen::Vector3d(0.0, 0.0, yaw), Eigen::Vector3d(dx / 20, dy / 20, 0.0)};
  const RobotState to{Eigen::Vector3d(dx, dy, yaw), Eigen::Vector3d(dx / 20, dy / 20, 0.0)};
  return straight_line(from, to, 21, 1.0);
}

TEST(Gaze, TurnsTowardsWhereTheBaseIsGoing) {
  const Gaze gaze = gaze_of({});
  const std::vector<double> times{0.0, 1.0, 2.0, 5.0};
  struct Way {
    double dx, dy, yaw, wanted;
  };
  for (const Way& way : {Way{3.0, 0.0, 0.0, 0.0}, Way{0.0, 3.0, 0.0, 0.5 * kPi},
                         Way{0.0, -3.0, 0.0, -0.5 * kPi}, Way{3.0, 3.0, 0.5 * kPi, -0.25 * kPi},
                         Way{0.0, 3.0, 7.0 * kPi, -0.5 * kPi}, Way{-1.0, 0.01, 0.0, 1.75}}) {
    const auto head = gaze.along(drive(way.dx, way.dy, way.yaw), 0.0, times, {});
    ASSERT_EQ(head.size(), times.size());
    EXPECT_NEAR(head.back().pan_rad, way.wanted, 1e-6) << way.dx << " " << way.dy << " " << way.yaw;
    EXPECT_EQ(head[0].pan_rad, 0.0);
    EXPECT_LE(std::abs(head[1].pan_rad - head[0].pan_rad), 0.5 + 1e-12) << "half a radian a second";
  }
}

TEST(Gaze, LooksDownToWhereTheBaseIsGoingAndNoHigherThanHeld) {
  const Gaze gaze = gaze_of({.eye_m = 0.5});
  // 15 of 20 s of the way.
  for (const auto& [way_m, tilt_rad] :
       {std::pair{4.0 / 3.0 * 0.5, -0.25 * kPi}, std::pair{4.0 / 3.0 * 0.11, -1.2},
        std::pair{4.0 / 3.0 * 5.0, kHeld_rad}}) {
    const auto head = gaze.along(drive(way_m, 0.0, 0.0), 0.0, {{0.0, 5.0}}, {0.0, kHeld_rad});
    EXPECT_NEAR(head.back().tilt_rad, tilt_rad, 1e-6) << way_m;
  }
}

TEST(Gaze, StaysWhereItLookedAtTheEndOfTheWay) {
  const Gaze gaze = gaze_of({});
  const auto head = gaze.along(drive(0.0, 3.0, 0.0), 19.8, {{0.0, 10.0}}, {1.2, -0.7});
  EXPECT_EQ(head.back().pan_rad, 1.2);
  EXPECT_EQ(head.back().tilt_rad, -0.7);
}

}  // namespace
}  // namespace sidestep::ros1_executor
