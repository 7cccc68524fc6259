#include "commands.hpp"

#include <numbers>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

namespace sidestep::ros1_executor {
namespace {

constexpr double kPi = std::numbers::pi;

RobotDescription base_of_three() {
  RobotDescription robot;
  robot.name = "base";
  for (const char* name : {"odom_x", "odom_y", "odom_t"}) robot.joints.push_back({name});
  return robot;
}

Gaze gaze_of(const LookOptions& look) {
  auto gaze = Gaze::create(base_of_three(), OdometryOptions{}, look);
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
    const auto pans = gaze.pans(drive(way.dx, way.dy, way.yaw), 0.0, times, 0.0);
    ASSERT_EQ(pans.size(), times.size());
    EXPECT_NEAR(pans.back(), way.wanted, 1e-6) << way.dx << " " << way.dy << " " << way.yaw;
    EXPECT_EQ(pans[0], 0.0);
    EXPECT_LE(std::abs(pans[1] - pans[0]), 0.5 + 1e-12) << "half a radian a second";
  }
}

TEST(Gaze, LooksAheadAtTheEndOfTheWay) {
  const Gaze gaze = gaze_of({});
  EXPECT_NEAR(gaze.pans(drive(0.0, 3.0, 0.0), 19.8, {{0.0, 10.0}}, 1.2).back(), 0.0, 1e-12);
}

}  // namespace
}  // namespace sidestep::ros1_executor
