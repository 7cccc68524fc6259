#include "../depth_sensor.hpp"

#include <cmath>

#include <gtest/gtest.h>

#include "../viewpoint.hpp"

namespace sidestep::simulator {
namespace {

constexpr CameraIntrinsics kSmallCamera{64, 48, 55.0, 54.0, 31.5, 23.5};

SceneObject still(const std::string& name, Shape shape, const Eigen::Vector3d& xyz_m) {
  return {name, std::move(shape), {{0.0, transform_from_xyz_rpy(xyz_m, {0, 0, 0})}}};
}

TEST(DepthRenderer, OfAWallFaceOnIsItsDistanceEverywhere) {
  WorkerPool workers(2);
  const RayCaster caster(Scene({still("wall", Box{{0.2, 50, 50}}, {3.1, 0, 0})}));
  ExactImage image;
  DepthRenderer(kSmallCamera, true).render(caster, look_at({0, 0, 0}, {1, 0, 0}), workers, image);
  ASSERT_EQ(image.depth_m.size(), 64U * 48U);
  for (const float depth_m : image.depth_m) EXPECT_FLOAT_EQ(depth_m, 3.0F);
  const double diagonal =
      1.0 / std::hypot(1.0, 31.5 / 55.0, 23.5 / 54.0);  // of the ray through a corner
  EXPECT_NEAR(image.cos_incidence[0], diagonal, 1e-6);
}

/// The floor's depth in each row and a sphere's silhouette, from the pinhole equations.
TEST(DepthRenderer, SeesFloorAndSphereWhereThePinholeModelPutsThem) {
  WorkerPool workers(2);
  const RayCaster caster(
      Scene({still("floor", HalfSpace{}, {0, 0, 0}), still("ball", Sphere{0.5}, {4, 0, 1.5})}));
  ExactImage image;
  DepthRenderer(kSmallCamera, false)
      .render(caster, look_at({0, 0, 1.5}, {1, 0, 1.5}), workers, image);
  EXPECT_TRUE(image.cos_incidence.empty());
  int on_ball = 0;
  for (int v = 0; v < kSmallCamera.height_px; ++v) {
    for (int u = 0; u < kSmallCamera.width_px; ++u) {
      const auto at = static_cast<std::size_t>(v * kSmallCamera.width_px + u);
      const Eigen::Vector3d ray = kSmallCamera.unproject(u, v, 1.0);
      const double nearest = 4.0 / ray.norm();  // along the unit ray, to the ball's centre
      const double gap2 = 16.0 - nearest * nearest;
      if (gap2 < 0.25) {
        ++on_ball;
        const double expected_m = (nearest - std::sqrt(0.25 - gap2)) / ray.norm();
        EXPECT_NEAR(image.depth_m[at], expected_m, 1e-5);
      } else if (v > 23) {
        EXPECT_NEAR(image.depth_m[at], 1.5 / ray.y(), 1e-4 / ray.y());
      } else {
        EXPECT_TRUE(std::isinf(image.depth_m[at])) << u << ' ' << v;
      }
    }
  }
  EXPECT_GT(on_ball, 100);
}

}  // namespace
}  // namespace sidestep::simulator
