#include "shape_paths.hpp"

#include <gtest/gtest.h>

#include <random>

#include "support/chain_robot.hpp"

namespace sidestep {
namespace {

using testing_support::flying_ball;

constexpr double kFlying_m = 0.1;
constexpr double kMargin_m = 0.01;
constexpr double kFinest_m = 0.005;

std::shared_ptr<const Scene> shapes_in_the_way() {
  Transform turned = Transform::Identity();
  turned.linear() = Eigen::AngleAxisd(0.7, Eigen::Vector3d(1, 2, 3).normalized()).matrix();
  turned.translation() << 0.2, -0.3, 0.1;
  Transform beside = Transform::Identity();
  beside.translation() << -0.6, 0.5, 0.0;
  Transform above = Transform::Identity();
  above.translation() << 0.5, 0.6, 0.5;
  return std::make_shared<Scene>(
      std::vector<SceneObject>{{"box", Box{{0.4, 0.3, 0.8}}, {{0.0, turned}}},
                               {"cylinder", Cylinder{0.2, 0.7}, {{0.0, beside}}},
                               {"sphere", Sphere{0.3}, {{0.0, above}}}});
}

/// The least distance of the ball along a motion, by the shapes' exact distances. The ball moves
/// less than 1e-3 m from one sample to the next.
double least_distance_m(const Scene& scene, const Eigen::Vector3d& from,
                        const Eigen::Vector3d& to) {
  double least_m = 10.0;
  for (int i = 0; i <= 4000; ++i) {
    const Eigen::Vector3d p = from + (to - from) * i / 4000.0;
    least_m = std::min(least_m, scene.signed_distance(p, 0.0).distance_m - kFlying_m);
  }
  return least_m;
}

TEST(ShapePaths, ShowClearWhatIsAndNothingElse) {
  ShapeWorld world;
  world.obstacles.scene = shapes_in_the_way();
  world.margin_m = kMargin_m;
  ShapePaths paths(flying_ball(kFlying_m), world);
  std::mt19937 random(4);
  std::uniform_real_distribution<double> unit(-1.0, 1.0);
  int clear = 0;
  int blocked = 0;
  for (int i = 0; i < 2000; ++i) {
    const Eigen::Vector3d from(unit(random), unit(random), unit(random));
    const Eigen::Vector3d to(unit(random), unit(random), unit(random));
    const double least_m = least_distance_m(*world.obstacles.scene, from, to);
    const bool shown = paths.is_clear({from.data(), 3}, {to.data(), 3}, kFinest_m);
    if (least_m < kMargin_m - 1e-5) {
      EXPECT_FALSE(shown) << least_m;
      ++blocked;
    }
    if (least_m > kMargin_m + kFinest_m) {
      EXPECT_TRUE(shown) << least_m;
      ++clear;
    }
    const bool at_from = paths.is_clear(std::span(from.data(), 3));
    const double here_m = least_distance_m(*world.obstacles.scene, from, from) - kMargin_m;
    if (std::abs(here_m) > 1e-4) {
      EXPECT_EQ(at_from, here_m > 0.0);
    }
  }
  EXPECT_GT(clear, 300);
  EXPECT_GT(blocked, 300);
}

TEST(ShapePaths, NameWhatIsHitAndHowDeep) {
  ShapeWorld world;
  world.obstacles.scene = shapes_in_the_way();
  ShapePaths paths(flying_ball(kFlying_m), world);
  const std::vector<double> touching{0.5, 0.25, 0.5};
  const auto hit = paths.violation(touching);
  ASSERT_TRUE(hit);
  EXPECT_EQ(hit->kind, Violation::Kind::kCollision);
  EXPECT_EQ(hit->subject, "ball");
  EXPECT_EQ(hit->other, "sphere");
  EXPECT_NEAR(hit->amount, 0.05, 1e-5);
  EXPECT_FALSE(paths.violation(std::vector{0.5, 0.1, 1.0}));
}

TEST(ShapePaths, KeepCentresOfSpheresWithinBounds) {
  ShapeWorld world;
  world.bounds_m.emplace(Eigen::Vector3d(-1, -1, -1), Eigen::Vector3d(1, 1, 1));
  ShapePaths paths(flying_ball(kFlying_m), world);
  const std::vector<double> middle{0.0, 0.0, 0.0};
  const std::vector<double> inside{0.99, 0.0, 0.9};
  const std::vector<double> outside{1.01, 0.0, 0.9};
  EXPECT_TRUE(paths.is_clear(middle, inside, kFinest_m));
  EXPECT_FALSE(paths.is_clear(middle, outside, kFinest_m));
  EXPECT_FALSE(paths.violation(inside));
  const auto hit = paths.violation(outside);
  ASSERT_TRUE(hit);
  EXPECT_NEAR(hit->amount, 0.01, 1e-12);
}

/// An arm whose link has spheres 1 m away from its axis, beyond its shape or without one.
std::shared_ptr<const RobotModel> arm_of_spheres(bool has_shape) {
  RobotDescription description;
  description.name = "arm";
  description.joints = {{.name = "turn", .lower = -3.0, .upper = 3.0, .max_velocity = 1.0}};
  description.links = {{"base", -1}, {"arm", 0}};
  description.spheres = {{.link = 1, .centre_link_m = {1.0, 0.0, 0.0}, .radius_m = 0.05}};
  description.shapes = {{.link = has_shape ? 1 : 0, .shape = Sphere{0.05}}};
  return std::make_shared<testing_support::ChainRobot>(
      description, std::vector<testing_support::ChainRobot::Step>{{}, {.joint = 0}});
}

TEST(ShapePaths, KeepCentresWithinBoundsThatShapesDoNotReach) {
  for (const bool has_shape : {false, true}) {
    SCOPED_TRACE(has_shape);
    ShapeWorld world;
    world.bounds_m.emplace(Eigen::Vector3d(-2, -0.9, -1), Eigen::Vector3d(2, 0.9, 1));
    ShapePaths paths(arm_of_spheres(has_shape), world);
    int clear = 0;
    for (double to = -1.5; to <= 1.5; to += 0.05) {
      const std::vector<double> from{-0.3}, end{to};
      // y is the sine of the angle.
      const bool is_inside = std::abs(std::sin(to)) <= 0.9;
      const bool is_shown = paths.is_clear(from, end, kFinest_m);
      if (is_shown) {
        EXPECT_TRUE(is_inside) << to;
      }
      if (std::abs(std::sin(to)) < 0.9 - kFinest_m) {
        EXPECT_TRUE(is_shown) << to;
      }
      clear += is_shown ? 1 : 0;
    }
    EXPECT_GT(clear, 20);
    EXPECT_LT(clear, 55);
  }
}

/// Distances to an octree's voxels against those to each of their cubes.
TEST(ShapeCollider, MeasuresToTheVoxelsOfAnOctree) {
  constexpr double kSide_m = 0.07;
  std::mt19937 random(5);
  std::uniform_int_distribution<int> cell(0, 9);
  ShapeObstacles obstacles;
  obstacles.resolution_m = kSide_m;
  obstacles.voxels_in_octree = true;
  for (int i = 0; i < 60; ++i) {
    const Eigen::Vector3d voxel(cell(random), cell(random), cell(random));
    obstacles.occupied_centres_m.emplace_back(Eigen::Vector3d(-0.31, 0.17, -0.26) +
                                              kSide_m * voxel);
  }
  const auto ball = flying_ball(kFlying_m);
  const ShapeCollider collider(ball->description(), obstacles, {});
  const auto pose = collider.make_pose();
  std::vector<Transform> links(3);
  Scratch scratch;
  std::uniform_real_distribution<double> unit(-1.0, 1.0);
  const Eigen::Vector3d half = Eigen::Vector3d::Constant(0.5 * kSide_m);
  int apart = 0;
  for (int i = 0; i < 500; ++i) {
    const Eigen::Vector3d p = Eigen::Vector3d(0, 0.45, 0) +
                              0.6 * Eigen::Vector3d(unit(random), unit(random), unit(random));
    double least_m = 10.0;
    for (const Eigen::Vector3d& centre : obstacles.occupied_centres_m) {
      const Eigen::AlignedBox3d cube(Eigen::Vector3d(centre - half),
                                     Eigen::Vector3d(centre + half));
      least_m = std::min(least_m, cube.exteriorDistance(p) - kFlying_m);
    }
    ball->link_poses({p.data(), 3}, links, scratch);
    collider.place(*pose, links, 0.0);
    const double found_m = collider.to_obstacles(0, *pose, 2.0).clearance_m;
    if (least_m > 1e-5) {
      EXPECT_NEAR(found_m, least_m, 1e-5) << p.transpose();
    }
    if (least_m < -1e-5) {
      EXPECT_LT(found_m, 0.0) << p.transpose();
    }
    apart += least_m > 0.0 ? 1 : 0;
  }
  EXPECT_GT(apart, 100);
  EXPECT_LT(apart, 450);
}

}  // namespace
}  // namespace sidestep
