#include <sidestep/geometry/scene.hpp>

#include <set>

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

TEST(Scene, DrawsMotionFromItsRangesByTheSeed) {
  SceneObject walker{"walker", Sphere{0.3}, {at(1.0, {0, 0, 1}), at(3.0, {4, 0, 1})}};
  walker.random = MotionRanges{{-2.0, 5.0}, {0.5, 2.0}, {{{-0.1, 0.1}, {1.0, 3.0}, {0.0, 0.0}}}};
  const SceneObject pillar{"pillar", Sphere{0.3}, {at(0.0, {9, 9, 9})}};
  const Scene scene({walker, pillar});
  std::set<double> begins_s;
  for (std::uint64_t seed = 0; seed < 50; ++seed) {
    const SceneObject drawn = scene.drawn(seed)->objects().front();
    const Waypoint& first = drawn.waypoints.front();
    const Waypoint& last = drawn.waypoints.back();
    const double factor = 2.0 / (last.time_s - first.time_s);
    EXPECT_GE(factor, 0.5);
    EXPECT_LE(factor, 2.0);
    const double delay_s = first.time_s - 1.0 / factor;
    EXPECT_GE(delay_s, -2.0 - 1e-9);
    EXPECT_LE(delay_s, 5.0 + 1e-9);
    const Eigen::Vector3d moved_m = first.T_world_object.translation() - Eigen::Vector3d(0, 0, 1);
    EXPECT_LE(std::abs(moved_m.x()), 0.1);
    EXPECT_GE(moved_m.y(), 1.0);
    EXPECT_LE(moved_m.y(), 3.0);
    EXPECT_EQ(moved_m.z(), 0.0);
    EXPECT_TRUE((last.T_world_object.translation() - first.T_world_object.translation())
                    .isApprox(Eigen::Vector3d(4, 0, 0), 1e-12));
    begins_s.insert(first.time_s);
    EXPECT_EQ(scene.drawn(seed)->objects().front().waypoints.front().time_s, first.time_s);
    EXPECT_EQ(scene.drawn(seed)->objects().back().waypoints.front().T_world_object.translation(),
              Eigen::Vector3d(9, 9, 9));
  }
  EXPECT_EQ(begins_s.size(), 50U);
  // What another object draws is its own.
  EXPECT_EQ(Scene({pillar, walker}).drawn(7)->objects().back().waypoints.front().time_s,
            scene.drawn(7)->objects().front().waypoints.front().time_s);
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
