#include "../viewpoint.hpp"

#include <numbers>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

namespace sidestep::simulator {
namespace {

using Eigen::Vector3d;
using ::testing::HasSubstr;

CameraWaypoint looking(double time_s, const Vector3d& position_m, const Vector3d& look_at_m) {
  return {time_s, position_m, look_at_m, {}};
}

TEST(LookAt, PutsTheTargetOnTheAxisAndKeepsTheCameraUpright) {
  for (const Vector3d& target :
       {Vector3d(5, 2, 1), Vector3d(-3, -3, 0), Vector3d(1, 2, 9), Vector3d(1, 2, -9)}) {
    const Vector3d position(1, 2, 3);
    const Transform T_world_camera = look_at(position, target);
    const Vector3d p_camera = T_world_camera.inverse() * target;
    EXPECT_TRUE(p_camera.isApprox(Vector3d(0, 0, (target - position).norm()), 1e-12));
    EXPECT_TRUE((T_world_camera.linear().transpose() * T_world_camera.linear()).isIdentity(1e-12));
    EXPECT_NEAR(T_world_camera.linear().determinant(), 1.0, 1e-12);
    EXPECT_NEAR(T_world_camera.linear()(2, 0), 0.0, 1e-12) << "x is level";
    EXPECT_LE(T_world_camera.linear()(2, 1), 1e-12) << "y points down";
  }
}

TEST(LookAt, StraightDownIsTheLimitOfTurningDownFromX) {
  const Transform down = look_at(Vector3d(0, 0, 2), Vector3d(0, 0, 0));
  const Transform nearly = look_at(Vector3d(0, 0, 2), Vector3d(1e-4, 0, 0));
  EXPECT_TRUE(down.isApprox(nearly, 1e-3));
  const Transform up = look_at(Vector3d(0, 0, 2), Vector3d(0, 0, 4));
  EXPECT_TRUE(up.isApprox(look_at(Vector3d(0, 0, 2), Vector3d(1e-4, 0, 4)), 1e-3));
}

TEST(CameraPath, PassesThroughItsWaypointsAndRestsAtBothEnds) {
  const std::vector<CameraWaypoint> waypoints = {looking(1, {0, 0, 1}, {1, 0, 1}),
                                                 looking(2, {1, 1, 1}, {2, 3, 1}),
                                                 looking(4, {3, 0, 2}, {4, 0, 1})};
  ASSERT_TRUE(check_camera_path(waypoints).empty());
  const CameraPath path(waypoints);
  for (const CameraWaypoint& waypoint : waypoints) {
    EXPECT_TRUE(path.T_world_camera(waypoint.time_s)
                    .isApprox(look_at(waypoint.position_m, *waypoint.look_at_m), 1e-12));
  }
  EXPECT_TRUE(path.T_world_camera(-7).isApprox(path.T_world_camera(1)));
  EXPECT_TRUE(path.T_world_camera(99).isApprox(path.T_world_camera(4)));
}

TEST(CameraPath, HasNoJumpInPositionOrVelocity) {
  const CameraPath path({looking(0, {0, 0, 1}, {1, 0, 1}), looking(1, {1, 1, 1}, {2, 3, 1}),
                         looking(3, {3, 0, 2}, {4, 0, 1})});
  const auto position = [&](double t) -> Vector3d { return path.T_world_camera(t).translation(); };
  constexpr double kStep = 1e-4;
  const auto velocity = [&](double t) -> Vector3d {
    return (position(t + kStep) - position(t - kStep)) / (2 * kStep);
  };
  EXPECT_NEAR(velocity(0.0).norm(), 0.0, 1e-3);
  EXPECT_NEAR(velocity(3.0).norm(), 0.0, 1e-3);
  for (double t = 0.0; t < 3.0; t += 0.01) {
    EXPECT_LT((position(t + 0.01) - position(t)).norm(), 0.05) << t;
    EXPECT_LT((velocity(t + 0.01) - velocity(t)).norm(), 0.2) << t;
  }
}

TEST(CameraPath, TurnsBetweenGivenAngles) {
  const double quarter = std::numbers::pi / 2;
  const std::vector<CameraWaypoint> waypoints = {
      {0, Vector3d(0, 0, 1), {}, Vector3d(0, 0, 0)},
      {2, Vector3d(0, 0, 1), {}, Vector3d(0, 0, quarter)}};
  ASSERT_TRUE(check_camera_path(waypoints).empty());
  const CameraPath path(waypoints);
  const auto seen_ahead = [&](double t) -> Vector3d {
    return path.T_world_camera(t).linear().col(2);
  };
  EXPECT_TRUE(seen_ahead(0).isApprox(Vector3d(1, 0, 0), 1e-12));
  EXPECT_TRUE(seen_ahead(1).isApprox(Vector3d(1, 1, 0).normalized(), 1e-12));
  EXPECT_TRUE(seen_ahead(2).isApprox(Vector3d(0, 1, 0), 1e-12));
  EXPECT_TRUE(path.T_world_camera(0).isApprox(look_at({0, 0, 1}, {5, 0, 1}), 1e-12));
}

TEST(CameraPath, BeginsAnewWhereItRepeats) {
  const std::vector<CameraWaypoint> waypoints = {looking(1, {0, 0, 1}, {1, 0, 1}),
                                                 looking(2, {1, 1, 1}, {2, 3, 1}),
                                                 looking(4, {0, 0, 1}, {1, 0, 1})};
  const CameraPath once(waypoints);
  const CameraPath again(waypoints, true);
  for (const double time_s : {0.0, 1.0, 1.7, 3.3}) {
    EXPECT_TRUE(again.T_world_camera(time_s).isApprox(once.T_world_camera(time_s))) << time_s;
    if (time_s < 1.0) continue;
    for (const double later_s : {3.0, 30.0}) {
      EXPECT_TRUE(again.T_world_camera(time_s + later_s).isApprox(once.T_world_camera(time_s)))
          << time_s + later_s;
    }
  }
}

TEST(CameraPath, NamesTheWaypointThatIsWrong) {
  const auto error_of = [](const std::vector<CameraWaypoint>& waypoints) {
    std::string text;
    for (const OptionMistake& mistake : check_camera_path(waypoints)) {
      text += mistake.parameters.at(0) + " " + mistake.what + "\n";
    }
    return text;
  };
  const CameraWaypoint good = looking(0, {0, 0, 1}, {1, 0, 1});
  EXPECT_THAT(error_of({}), HasSubstr("needs a waypoint"));
  EXPECT_THAT(error_of({good, looking(0, {0, 0, 1}, {1, 0, 1})}),
              HasSubstr("camera_path[1].time_s"));
  EXPECT_THAT(error_of({good, {1, Vector3d(0, 0, 0), {}, {}}}), HasSubstr("camera_path[1] needs"));
  EXPECT_THAT(error_of({good, {1, Vector3d(0, 0, 0), Vector3d(1, 1, 1), Vector3d(0, 0, 0)}}),
              HasSubstr("camera_path[1] needs either"));
  EXPECT_THAT(error_of({good, {1, Vector3d(0, 0, 0), {}, Vector3d(0, 0, 0)}}),
              HasSubstr("must both have"));
  EXPECT_THAT(error_of({looking(0, {0, 0, 1}, {0, 0, 1})}), HasSubstr("where the camera itself"));
}

}  // namespace
}  // namespace sidestep::simulator
