#include <sidestep/geometry/scene.hpp>

#include <gtest/gtest.h>

#include "geometry_testing.hpp"

namespace sidestep {
namespace {

Waypoint at(double time_s, const Eigen::Vector3d& xyz_m, double yaw_rad = 0.0) {
  return {time_s, transform_from_xyz_rpy(xyz_m, {0.0, 0.0, yaw_rad})};
}

TEST(SceneObject, RestsBeforeTheFirstAndAfterTheLastWaypoint) {
  const SceneObject walker{"walker", Sphere{0.3}, {at(1.0, {0, 0, 0}), at(3.0, {4, 0, 2}, 1.0)}};
  EXPECT_EQ(walker.T_world_object(-5.0).translation(), Eigen::Vector3d(0, 0, 0));
  EXPECT_EQ(walker.T_world_object(1.0).translation(), Eigen::Vector3d(0, 0, 0));
  EXPECT_EQ(walker.T_world_object(3.0).translation(), Eigen::Vector3d(4, 0, 2));
  EXPECT_EQ(walker.T_world_object(99.0).translation(), Eigen::Vector3d(4, 0, 2));
}

TEST(SceneObject, MovesLinearlyAndTurnsEvenlyBetweenWaypoints) {
  const SceneObject walker{"walker",
                           Sphere{0.3},
                           {at(1.0, {0, 0, 0}), at(3.0, {4, 0, 2}, 1.0), at(4.0, {4, 1, 2}, 1.0)}};
  const Transform quarter = walker.T_world_object(1.5);
  EXPECT_TRUE(quarter.isApprox(at(0.0, {1.0, 0.0, 0.5}, 0.25).T_world_object, 1e-12));
  EXPECT_TRUE(walker.T_world_object(3.5).isApprox(at(0, {4, 0.5, 2}, 1.0).T_world_object, 1e-12));
}

TEST(SceneObject, StartsAgainWhenItRepeats) {
  SceneObject door{"door", Sphere{0.3}, {at(1.0, {0, 0, 0}), at(3.0, {4, 0, 0})}};
  door.repeat = true;
  EXPECT_NEAR(door.T_world_object(0.0).translation().x(), 0.0, 1e-12);
  EXPECT_NEAR(door.T_world_object(2.5).translation().x(), 3.0, 1e-12);
  EXPECT_NEAR(door.T_world_object(3.0).translation().x(), 0.0, 1e-12);
  EXPECT_NEAR(door.T_world_object(3.5).translation().x(), 1.0, 1e-12);
  EXPECT_NEAR(door.T_world_object(1.0 + 20.0 + 0.5).translation().x(), 1.0, 1e-9);
}

TEST(Scene, DistanceIsThatToTheNearestObjectWhereItIsNow) {
  const Scene scene({{"floor", HalfSpace{}, {at(0, {0, 0, 0})}},
                     {"ball", Sphere{0.5}, {at(0, {0, 0, 5}), at(10, {10, 0, 5})}},
                     {"box", Box{{1, 1, 1}}, {at(0, {5, 5, 5}, std::numbers::pi / 4)}}});
  const SceneDistance now = scene.signed_distance({0, 0, 4}, 0.0);
  EXPECT_DOUBLE_EQ(now.distance_m, 0.5);
  EXPECT_EQ(now.object, 1);
  const SceneDistance later = scene.signed_distance({0, 0, 4}, 10.0);
  EXPECT_DOUBLE_EQ(later.distance_m, 4.0);
  EXPECT_EQ(later.object, 0);
  const SceneDistance turned = scene.signed_distance({5.0 + std::sqrt(0.5) + 0.2, 5, 5}, 0.0);
  EXPECT_NEAR(turned.distance_m, 0.2, 1e-12);
  EXPECT_EQ(turned.object, 2);
}

TEST(Scene, DistanceInsideOverlappingObjectsIsTheDeepestOnes) {
  const Scene scene(
      {{"small", Sphere{0.2}, {at(0, {0, 0, 0})}}, {"large", Sphere{1.0}, {at(0, {0, 0, 0})}}});
  const SceneDistance inside = scene.signed_distance({0.1, 0, 0}, 0.0);
  EXPECT_DOUBLE_EQ(inside.distance_m, -0.9);
  EXPECT_EQ(inside.object, 1);
}

TEST(Scene, WithoutObjectsIsInfinitelyFarAway) {
  const SceneDistance nothing = Scene().signed_distance({0, 0, 0}, 0.0);
  EXPECT_EQ(nothing.distance_m, std::numeric_limits<double>::infinity());
  EXPECT_EQ(nothing.object, -1);
}

}  // namespace
}  // namespace sidestep
