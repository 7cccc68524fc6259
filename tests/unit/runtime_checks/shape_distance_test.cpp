#include <gtest/gtest.h>

#include <random>

#include "shape_collider.hpp"
#include "support/chain_robot.hpp"

namespace sidestep {
namespace {

/// A robot of one shape that stands wherever its transform says.
struct OneShape {
  RobotDescription description;
  std::vector<Transform> poses{Transform::Identity()};

  explicit OneShape(const Shape& shape) {
    description.name = "one";
    description.links = {{"body", -1}};
    description.shapes = {{0, shape, Transform::Identity()}};
  }
};

Transform random_pose(std::mt19937& random, double spread_m) {
  std::uniform_real_distribution<double> unit(-1.0, 1.0);
  Transform pose = Transform::Identity();
  pose.translation() = spread_m * Eigen::Vector3d(unit(random), unit(random), unit(random));
  pose.linear() = Eigen::Quaterniond(unit(random), unit(random), unit(random), unit(random))
                      .normalized()
                      .toRotationMatrix();
  return pose;
}

std::shared_ptr<const Mesh> tetrahedron() {
  Mesh mesh;
  mesh.vertices_m = {{0, 0, 0}, {0.3, 0, 0}, {0, 0.3, 0}, {0, 0, 0.3}};
  mesh.triangles = {{0, 2, 1}, {0, 1, 3}, {0, 3, 2}, {1, 2, 3}};
  return std::make_shared<Mesh>(mesh);
}

/// Points all over a shape's surface, none farther than `grain_m` from another.
std::vector<Eigen::Vector3d> surface_points(const Shape& shape, double grain_m) {
  const Mesh mesh = triangulate(shape, 96);
  std::vector<Eigen::Vector3d> points;
  for (const Eigen::Vector3i& t : mesh.triangles) {
    const Eigen::Vector3d a = mesh.vertices_m[static_cast<std::size_t>(t[0])];
    const Eigen::Vector3d ab = mesh.vertices_m[static_cast<std::size_t>(t[1])] - a;
    const Eigen::Vector3d ac = mesh.vertices_m[static_cast<std::size_t>(t[2])] - a;
    const int n =
        1 + static_cast<int>(std::max({ab.norm(), ac.norm(), (ab - ac).norm()}) / grain_m);
    for (int i = 0; i <= n; ++i) {
      for (int j = 0; i + j <= n; ++j) points.push_back(a + ab * i / n + ac * j / n);
    }
  }
  return points;
}

class ShapeDistance : public testing::TestWithParam<Shape> {};

/// FCL against sampled surface points and the exact distance of a point to a box.
TEST_P(ShapeDistance, AgreesWithSampledSurfaces) {
  constexpr double kGrain_m = 0.01;
  const auto points = surface_points(GetParam(), kGrain_m);
  std::mt19937 random(12);
  int apart = 0;
  int touching = 0;
  for (int i = 0; i < 150; ++i) {
    OneShape robot(GetParam());
    robot.poses[0] = random_pose(random, 0.5);
    const Box box{{0.2, 0.35, 0.1}};
    const Transform T_world_box = random_pose(random, 0.1);
    ShapeObstacles obstacles;
    obstacles.scene = std::make_shared<Scene>(
        std::vector<SceneObject>{{"box", box, {{0.0, T_world_box}}, false}});
    const ShapeCollider collider(robot.description, obstacles, {});
    const auto pose = collider.make_pose();
    collider.place(*pose, robot.poses, 0.0);
    const auto found = collider.to_obstacles(0, *pose, 10.0);
    ASSERT_EQ(found.other, "box");
    double sampled = 10.0;
    for (const Eigen::Vector3d& p : points) {
      sampled =
          std::min(sampled, signed_distance_m(box, T_world_box.inverse() * (robot.poses[0] * p)));
    }
    if (sampled > 0.0) {
      // A box that lies within the shape without meeting its surface is beyond sampling.
      if (found.clearance_m < 0.0) continue;
      ++apart;
      EXPECT_LE(found.clearance_m, sampled + 1e-5);
      EXPECT_GE(found.clearance_m, sampled - kGrain_m);
    } else if (sampled < -1e-4) {
      ++touching;
      EXPECT_LT(found.clearance_m, 0.0);
      EXPECT_GT(-found.clearance_m, 0.0);
    }
  }
  EXPECT_GT(apart, 50);
  EXPECT_GT(touching, 5);
}

INSTANTIATE_TEST_SUITE_P(Shapes, ShapeDistance,
                         testing::Values(Shape(Box{{0.3, 0.2, 0.15}}), Shape(Sphere{0.15}),
                                         Shape(Cylinder{0.1, 0.3}), Shape(Capsule{0.08, 0.25}),
                                         Shape(tetrahedron())),
                         [](const auto& of) { return std::string(shape_name(of.param)); });

class HalfSpaceDistance : public testing::TestWithParam<Shape> {};

TEST_P(HalfSpaceDistance, IsThatOfTheLowestSurfacePoint) {
  const auto points = surface_points(GetParam(), 0.01);
  std::mt19937 random(5);
  for (int i = 0; i < 50; ++i) {
    OneShape robot(GetParam());
    robot.poses[0] = random_pose(random, 0.5);
    const Transform T_world_floor = random_pose(random, 0.3);
    ShapeObstacles obstacles;
    obstacles.scene = std::make_shared<Scene>(
        std::vector<SceneObject>{{"floor", HalfSpace{}, {{0.0, T_world_floor}}, false}});
    const ShapeCollider collider(robot.description, obstacles, {});
    const auto pose = collider.make_pose();
    collider.place(*pose, robot.poses, 0.0);
    double lowest = 10.0;
    for (const Eigen::Vector3d& p : points) {
      lowest = std::min(lowest, (T_world_floor.inverse() * (robot.poses[0] * p)).z());
    }
    const double found = collider.to_obstacles(0, *pose, 10.0).clearance_m;
    EXPECT_LE(found, lowest + 1e-9);
    EXPECT_GE(found, lowest - 1e-3);  // facets are inscribed
  }
}

INSTANTIATE_TEST_SUITE_P(Shapes, HalfSpaceDistance,
                         testing::Values(Shape(Box{{0.3, 0.2, 0.15}}), Shape(Sphere{0.15}),
                                         Shape(Cylinder{0.1, 0.3}), Shape(Capsule{0.08, 0.25}),
                                         Shape(tetrahedron())),
                         [](const auto& of) { return std::string(shape_name(of.param)); });

TEST(ShapeDepth, IsThatOfASphereInABoxAndOfTwoBoxes) {
  for (const double gap_m : {-0.03, -0.01, 0.02}) {
    ShapeObstacles obstacles;
    obstacles.resolution_m = 0.2;
    obstacles.occupied_centres_m = {{0.0, 0.0, 0.0}};
    for (const Shape& shape : {Shape(Sphere{0.15}), Shape(Box{{0.3, 0.5, 0.5}})}) {
      OneShape robot(shape);
      robot.poses[0].translation().x() = 0.1 + 0.15 + gap_m;
      const ShapeCollider collider(robot.description, obstacles, {});
      const auto pose = collider.make_pose();
      collider.place(*pose, robot.poses, 0.0);
      EXPECT_NEAR(collider.to_obstacles(0, *pose, 1.0).clearance_m, gap_m, 1e-4)
          << shape_name(shape);
    }
  }
}

/// A row of voxels is one long box to FCL, whose own depth of a graze may be ten times too large.
class GrazeDepth : public testing::TestWithParam<Shape> {};

TEST_P(GrazeDepth, IsNoMoreThanTheWayBackOut) {
  constexpr double kDepth_m = 0.006;
  std::mt19937 random(5);
  std::uniform_real_distribution<double> place(-0.45, 0.45);
  OneShape robot(GetParam());
  const std::vector<Eigen::Vector3d> points = surface_points(GetParam(), 0.01);
  for (int trial = 0; trial < 300; ++trial) {
    const int along = trial % 3;
    const int normal = (along + 1 + trial / 3 % 2) % 3;
    ShapeObstacles obstacles;
    obstacles.resolution_m = 0.05;
    for (int i = 0; i < 20; ++i) {
      obstacles.occupied_centres_m.push_back(0.05 * (i - 9.5) * Eigen::Vector3d::Unit(along));
    }
    const ShapeCollider collider(robot.description, obstacles, {});
    const auto pose = collider.make_pose();
    Transform& body = robot.poses[0];
    body = random_pose(random, 1.0);
    if (trial % 4 == 0) body.linear().setIdentity();
    Eigen::Vector3d lowest = points.front();
    for (const Eigen::Vector3d& p : points) {
      if ((body.linear() * p)[normal] < (body.linear() * lowest)[normal]) lowest = p;
    }
    // Its lowest point lies below the surface of the row: moved up by the depth, it is out.
    Eigen::Vector3d p_world = place(random) * Eigen::Vector3d::Unit(along);
    p_world[normal] = 0.025 - kDepth_m;
    body.translation() = p_world - body.linear() * lowest;
    collider.place(*pose, robot.poses, 0.0);
    const double clearance_m = collider.to_obstacles(0, *pose, 1.0).clearance_m;
    EXPECT_LT(clearance_m, 0.0) << trial;
    EXPECT_GE(clearance_m, -kDepth_m - 1e-3) << trial;  // facets are inscribed
  }
}

INSTANTIATE_TEST_SUITE_P(Shapes, GrazeDepth,
                         testing::Values(Shape(Box{{0.3, 0.2, 0.15}}), Shape(Sphere{0.15}),
                                         Shape(Cylinder{0.215, 0.19}), Shape(Capsule{0.08, 0.25}),
                                         Shape(tetrahedron())),
                         [](const auto& of) { return std::string(shape_name(of.param)); });

TEST(ShapeDepth, IsNothingBeyondTheBound) {
  ShapeObstacles obstacles;
  obstacles.resolution_m = 0.2;
  obstacles.occupied_centres_m = {{0.0, 0.0, 0.0}};
  OneShape robot(Sphere{0.1});
  robot.poses[0].translation().x() = 0.5;
  const ShapeCollider collider(robot.description, obstacles, {});
  const auto pose = collider.make_pose();
  collider.place(*pose, robot.poses, 0.0);
  EXPECT_EQ(collider.to_obstacles(0, *pose, 0.2).other, "");
  EXPECT_EQ(collider.to_obstacles(0, *pose, 0.2).clearance_m, 0.2);
  EXPECT_NEAR(collider.to_obstacles(0, *pose, 0.4).clearance_m, 0.3, 1e-6);
}

}  // namespace
}  // namespace sidestep
