#include <sidestep/geometry/ray_caster.hpp>

#include <set>

#include <gtest/gtest.h>

#include <sidestep/core/worker_pool.hpp>

#include "geometry_testing.hpp"

namespace sidestep {
namespace {

SceneObject still(std::string name, Shape shape, const Eigen::Vector3d& xyz_m,
                  const Eigen::Vector3d& rpy_rad = Eigen::Vector3d::Zero()) {
  return {std::move(name), std::move(shape), {{0.0, transform_from_xyz_rpy(xyz_m, rpy_rad)}}};
}

RayHit cast_one(const RayCaster& caster, const Eigen::Vector3d& origin,
                const Eigen::Vector3d& direction) {
  const std::array<Eigen::Vector3d, 1> origins = {origin};
  const std::array<Eigen::Vector3d, 1> directions = {direction.normalized()};
  std::array<RayHit, 1> hits;
  caster.cast(origins, directions, hits);
  return hits[0];
}

Scene every_shape() {
  return Scene({still("floor", HalfSpace{}, {0, 0, -1.5}, {0.1, 0.05, 0.0}),
                still("box", Box{{0.4, 1.0, 0.2}}, {1.0, 0.2, 0.1}, {0.3, -0.4, 0.9}),
                still("sphere", Sphere{0.35}, {-0.8, 0.9, 0.4}),
                still("cylinder", Cylinder{0.25, 0.9}, {-0.7, -0.9, 0.0}, {1.1, 0.2, -0.5}),
                still("capsule", Capsule{0.2, 0.6}, {0.5, -1.0, 0.9}, {-0.6, 0.8, 0.1}),
                still("mesh", indexed_mesh(triangulate(Sphere{0.3}, 24)), {0.3, 1.3, -0.4},
                      {0.2, 0.1, 0.7})});
}

/// The first hit by marching along the ray in steps of the signed distance.
double sphere_trace(const Scene& scene, const Eigen::Vector3d& origin,
                    const Eigen::Vector3d& direction, double limit_m) {
  double along_m = 0.0;
  for (int step = 0; step < 100000 && along_m < limit_m; ++step) {
    const double distance_m = scene.signed_distance(origin + along_m * direction, 0.0).distance_m;
    if (distance_m < 1e-10) return along_m;
    along_m += distance_m;
  }
  return std::numeric_limits<double>::infinity();
}

/// Against a caster of a scene in which everything stood there from the beginning.
TEST(RayCaster, MovesObjectsToThePosesItIsGiven) {
  const Scene scene = every_shape();
  RayCaster moved(scene);
  std::vector<SceneObject> objects = scene.objects();
  std::vector<Transform> poses;
  for (std::size_t i = 2; i < objects.size(); ++i) {
    const double by = 0.2 * static_cast<double>(i);
    poses.push_back(objects[i].waypoints[0].T_world_object *
                    transform_from_xyz_rpy({by, -0.3, 0.1}, {0.1, by, -0.2}));
    objects[i].waypoints[0].T_world_object = poses.back();
  }
  moved.set_poses(2, poses);
  const RayCaster built{Scene(objects)};
  const RayCaster unmoved(scene);
  int changed = 0;
  for (int i = 0; i < 2000; ++i) {
    const double angle = 0.01 * i;
    const Eigen::Vector3d origin(3.0 * std::cos(angle), 3.0 * std::sin(angle), 1.5 - 0.001 * i);
    const Eigen::Vector3d direction =
        Eigen::Vector3d(std::sin(0.37 * i), std::cos(0.23 * i), std::sin(0.11 * i)) - origin;
    const RayHit hit = cast_one(moved, origin, direction);
    const RayHit expected = cast_one(built, origin, direction);
    EXPECT_EQ(hit.object, expected.object);
    if (expected.object >= 0) {
      EXPECT_NEAR(hit.distance_m, expected.distance_m, 1e-6);
    }
    changed += hit.distance_m != cast_one(unmoved, origin, direction).distance_m ? 1 : 0;
  }
  EXPECT_GT(changed, 300);
}

TEST(RayCaster, HitsAnalyticShapesWhereAlgebraSays) {
  const RayCaster ball(Scene({still("ball", Sphere{0.5}, {3, 0, 0})}));
  RayHit hit = cast_one(ball, {0, 0, 0}, {1, 0, 0});
  EXPECT_DOUBLE_EQ(hit.distance_m, 2.5);
  EXPECT_EQ(hit.object, 0);
  EXPECT_TRUE(hit.normal_world.isApprox(Eigen::Vector3d(-1, 0, 0)));
  hit = cast_one(ball, {0, 0.3, 0}, {1, 0, 0});
  EXPECT_NEAR(hit.distance_m, 3.0 - 0.4, 1e-12);
  EXPECT_EQ(cast_one(ball, {0, 0.51, 0}, {1, 0, 0}).object, -1);
  EXPECT_EQ(cast_one(ball, {0, 0, 0}, {-1, 0, 0}).distance_m,
            std::numeric_limits<double>::infinity());

  const RayCaster rod(Scene({still("rod", Cylinder{0.5, 2.0}, {0, 0, 0})}));
  hit = cast_one(rod, {0.2, 0, 5}, {0, 0, -1});
  EXPECT_DOUBLE_EQ(hit.distance_m, 4.0);
  EXPECT_TRUE(hit.normal_world.isApprox(Eigen::Vector3d(0, 0, 1)));
  hit = cast_one(rod, {4, 0.3, 0.9}, {-1, 0, 0});
  EXPECT_NEAR(hit.distance_m, 3.6, 1e-12);
  EXPECT_TRUE(hit.normal_world.isApprox(Eigen::Vector3d(0.8, 0.6, 0.0), 1e-12));

  const RayCaster pill(Scene({still("pill", Capsule{0.5, 2.0}, {0, 0, 0})}));
  EXPECT_NEAR(cast_one(pill, {0, 0, 5}, {0, 0, -1}).distance_m, 3.5, 1e-12);
  EXPECT_NEAR(cast_one(pill, {5, 0, 1.3}, {-1, 0, 0}).distance_m, 4.6, 1e-12);

  const RayCaster ground(Scene({still("ground", HalfSpace{}, {0, 0, 1})}));
  hit = cast_one(ground, {7, 8, 3}, {3, 0, -4});
  EXPECT_NEAR(hit.distance_m, 2.5, 1e-12);
  EXPECT_TRUE(hit.normal_world.isApprox(Eigen::Vector3d(0, 0, 1)));
  EXPECT_EQ(cast_one(ground, {7, 8, 3}, {1, 0, 0}).object, -1);
}

TEST(RayCaster, AgreesWithSphereTracing) {
  const Scene scene = every_shape();
  const RayCaster caster(scene);
  std::mt19937 random(17);
  std::vector<int> hits_of(scene.objects().size(), 0);
  for (int i = 0; i < 4000; ++i) {
    Eigen::Vector3d origin = testing::uniform_point(random, 2.0);
    origin.z() = std::abs(origin.z());
    if (scene.signed_distance(origin, 0.0).distance_m < 0.05) continue;
    const Eigen::Vector3d direction = (testing::uniform_point(random, 1.2) - origin).normalized();
    const double traced_m = sphere_trace(scene, origin, direction, 30.0);
    const RayHit hit = cast_one(caster, origin, direction);
    if (hit.distance_m > 30.0) {
      EXPECT_GE(traced_m, 30.0) << origin.transpose() << " -> " << direction.transpose();
      continue;
    }
    ++hits_of[static_cast<std::size_t>(hit.object)];
    // Where a ray grazes a surface the march stops early, within its tolerance of it.
    const double slope = std::abs(hit.normal_world.dot(direction));
    EXPECT_NEAR(hit.distance_m, traced_m, 1e-6 + 1e-7 / std::max(slope, 1e-3));
    EXPECT_LE(hit.normal_world.dot(direction), 0.0);
    EXPECT_NEAR(hit.normal_world.norm(), 1.0, 1e-9);
    const Eigen::Vector3d p = origin + hit.distance_m * direction;
    EXPECT_NEAR(scene.signed_distance(p, 0.0).distance_m, 0.0, 1e-6);
    EXPECT_EQ(scene.signed_distance(p, 0.0).object, hit.object);
  }
  for (std::size_t i = 0; i < hits_of.size(); ++i) EXPECT_GT(hits_of[i], 20) << i;
}

/// Rays like a camera's, row after row, then all ways at once; every object is met by some.
TEST(RayCaster, TellsDistancesFromOneOriginAsItCastsEachRay) {
  const Scene with_mesh = every_shape();
  std::vector<SceneObject> analytic = with_mesh.objects();
  std::erase_if(analytic, [](const SceneObject& object) { return object.name == "mesh"; });
  // Also one that rays can run along.
  analytic.push_back(still("shelf", Box{{1.0, 0.5, 0.02}}, {0, 0, 1.2}));
  std::mt19937 random(31);
  for (const Scene& scene : {with_mesh, Scene(std::move(analytic))}) {
    const RayCaster caster(scene);
    std::set<int> met;
    for (int view = 0; view < 60; ++view) {
      // Far away, close by, inside an object, and beside faces.
      Eigen::Vector3d origin = testing::uniform_point(random, view % 2 == 0 ? 2.5 : 1.0);
      if (view == 7) origin = {-0.8, 0.9, 0.4};
      if (view == 8) origin = {2.0, 0.0, 1.21};
      const bool is_level = view == 8 || view == 9;
      std::vector<Eigen::Vector3d> directions;
      const Transform R =
          is_level ? Transform::Identity()
                   : transform_from_xyz_rpy({0, 0, 0}, testing::uniform_point(random, 3.0));
      for (int v = -20; v <= 20; ++v) {
        for (int u = -25; u <= 25; ++u) {
          directions.push_back((R * Eigen::Vector3d(0.03 * u, 0.03 * v, 1.0)).normalized());
        }
      }
      for (int axis = 0; axis < 3; ++axis) {
        directions.push_back(Eigen::Vector3d::Unit(axis));
        directions.push_back(-Eigen::Vector3d::Unit(axis));
      }
      for (int i = 0; i < 500; ++i) directions.push_back(testing::uniform_direction(random));
      std::vector<double> distances_m(directions.size());
      caster.cast_distances(origin, directions, distances_m);
      for (std::size_t i = 0; i < directions.size(); ++i) {
        const RayHit alone = cast_one(caster, origin, directions[i]);
        if (alone.object < 0) {
          ASSERT_TRUE(std::isinf(distances_m[i])) << view << ": ray " << i;
          continue;
        }
        met.insert(alone.object);
        ASSERT_NEAR(distances_m[i], alone.distance_m, 1e-7 * (1.0 + alone.distance_m))
            << view << ": ray " << i << " meets object " << alone.object;
      }
    }
    EXPECT_EQ(met.size(), scene.objects().size());
  }
}

TEST(RayCaster, NormalsAreTheGradientOfTheDistance) {
  const Scene scene = every_shape();
  const RayCaster caster(scene);
  std::mt19937 random(23);
  int compared = 0;
  for (int i = 0; i < 1000; ++i) {
    const Eigen::Vector3d origin(0.0, 0.0, 2.5);
    const Eigen::Vector3d direction = (testing::uniform_point(random, 1.2) - origin).normalized();
    const RayHit hit = cast_one(caster, origin, direction);
    if (hit.object < 0 || hit.object == 5) continue;  // facets have edges everywhere
    const Eigen::Vector3d outside = origin + hit.distance_m * direction + 1e-3 * hit.normal_world;
    Eigen::Vector3d gradient;
    for (int axis = 0; axis < 3; ++axis) {
      const Eigen::Vector3d step = 1e-6 * Eigen::Vector3d::Unit(axis);
      gradient[axis] = (scene.signed_distance(outside + step, 0.0).distance_m -
                        scene.signed_distance(outside - step, 0.0).distance_m) /
                       2e-6;
    }
    EXPECT_NEAR((gradient - hit.normal_world).norm(), 0.0, 1e-5);
    ++compared;
  }
  EXPECT_GT(compared, 500);
}

TEST(RayCaster, HitsASurfaceFromWithin) {
  const RayCaster caster(every_shape());
  const RayHit hit = cast_one(caster, {-0.8, 0.9, 0.4}, {1, 0, 0});
  EXPECT_EQ(hit.object, 2);
  EXPECT_NEAR(hit.distance_m, 0.35, 1e-12);
  EXPECT_TRUE(hit.normal_world.isApprox(Eigen::Vector3d(-1, 0, 0), 1e-12));
}

TEST(RayCaster, FollowsMovingObjects) {
  SceneObject ball = still("ball", Sphere{0.5}, {3, 0, 0});
  ball.waypoints.push_back({10.0, transform_from_xyz_rpy({13, 0, 0}, {0, 0, 0})});
  SceneObject crate = still("crate", indexed_mesh(triangulate(Box{{1, 1, 1}})), {0, 3, 0});
  crate.waypoints.push_back(
      {10.0, transform_from_xyz_rpy({0, 3, 0}, {0, 0, std::numbers::pi / 4})});
  const Scene scene({ball, crate});
  RayCaster caster(scene);
  EXPECT_NEAR(cast_one(caster, {0, 0, 0}, {1, 0, 0}).distance_m, 2.5, 1e-12);
  EXPECT_NEAR(cast_one(caster, {0, 0, 0.01}, {0, 1, 0}).distance_m, 2.5, 1e-12);
  caster.set_time(5.0);
  EXPECT_NEAR(cast_one(caster, {0, 0, 0}, {1, 0, 0}).distance_m, 7.5, 1e-12);
  caster.set_time(10.0);
  EXPECT_NEAR(cast_one(caster, {0, 0, 0}, {1, 0, 0}).distance_m, 12.5, 1e-12);
  EXPECT_NEAR(cast_one(caster, {0, 0, 0.01}, {0, 1, 0}).distance_m, 3.0 - std::sqrt(0.5), 1e-5);
  caster.set_time(0.0);
  EXPECT_NEAR(cast_one(caster, {0, 0, 0}, {1, 0, 0}).distance_m, 2.5, 1e-12);
}

TEST(RayCaster, FindsNothingInAnEmptyScene) {
  const RayCaster caster{Scene()};
  EXPECT_EQ(cast_one(caster, {0, 0, 0}, {1, 0, 0}).object, -1);
}

TEST(RayCaster, GivesTheSameHitsFromManyThreads) {
  const Scene scene = every_shape();
  const RayCaster caster(scene);
  constexpr int kRays = 20000;
  std::mt19937 random(29);
  std::vector<Eigen::Vector3d> origins;
  std::vector<Eigen::Vector3d> directions;
  for (int i = 0; i < kRays; ++i) {
    origins.push_back(testing::uniform_point(random, 2.0));
    directions.push_back(testing::uniform_direction(random));
  }
  std::vector<RayHit> alone(kRays);
  caster.cast(origins, directions, alone);
  std::vector<RayHit> together(kRays);
  WorkerPool workers(2);
  workers.run_banded(kRays, 64, [&](int begin, int end) {
    const auto at = static_cast<std::size_t>(begin);
    const auto count = static_cast<std::size_t>(end - begin);
    caster.cast(std::span(origins).subspan(at, count), std::span(directions).subspan(at, count),
                std::span(together).subspan(at, count));
  });
  for (std::size_t i = 0; i < alone.size(); ++i) {
    ASSERT_EQ(together[i].object, alone[i].object);
    ASSERT_EQ(together[i].distance_m, alone[i].distance_m);
  }
}

}  // namespace
}  // namespace sidestep
