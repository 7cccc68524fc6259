#include "sphere_cover.hpp"

#include "spheres_testing.hpp"

namespace sidestep {
namespace {

using std::numbers::pi;
using testing_support::ball_m3;
using testing_support::cap_m3;
using testing_support::one_body;

Cover cover_of(const Shape& shape, const std::vector<CollisionSphere>& spheres) {
  return measure_cover(one_body({shape}), spheres).whole;
}

TEST(SphereCover, OfASphereByItselfIsWhole) {
  const Cover cover = cover_of(Sphere{0.2}, {{1, {0, 0, 0}, 0.2}});
  EXPECT_EQ(cover.spheres, 1);
  EXPECT_DOUBLE_EQ(cover.surface_share, 1.0);
  EXPECT_DOUBLE_EQ(cover.volume_share, 1.0);
  EXPECT_EQ(cover.gap_m, 0.0);
  EXPECT_NEAR(cover.protrusion_m, 0.0, 1e-12);
  EXPECT_NEAR(cover.spheres_m3, ball_m3(0.2), 1e-12);
  EXPECT_LT(cover.excess_m3, 1e-3 * ball_m3(0.2));
}

TEST(SphereCover, OfABoxByTheSphereAroundIt) {
  const Eigen::Vector3d size(0.4, 0.3, 0.2);
  const double r = 0.5 * size.norm();
  const Cover cover = cover_of(Box{size}, {{1, {0, 0, 0}, r * (1.0 + 1e-9)}});
  EXPECT_DOUBLE_EQ(cover.surface_share, 1.0);
  EXPECT_EQ(cover.gap_m, 0.0);
  EXPECT_NEAR(cover.shapes_m3, size.prod(), 1e-12);
  EXPECT_NEAR(cover.excess_m3, ball_m3(r) - size.prod(), 0.01 * ball_m3(r));
  EXPECT_NEAR(cover.protrusion_m, r - 0.1, 1e-3);
}

TEST(SphereCover, OfABoxByTheSphereWithinIt) {
  const Cover cover = cover_of(Box{{0.2, 0.2, 0.2}}, {{1, {0, 0, 0}, 0.1}});
  EXPECT_LT(cover.surface_share, 0.001);  // in six points
  EXPECT_NEAR(cover.volume_share, pi / 6.0, 0.01);
  EXPECT_NEAR(cover.gap_m, 0.1 * (std::sqrt(3.0) - 1.0), 1e-9);  // at the corners
  EXPECT_LT(cover.excess_m3, 1e-3 * ball_m3(0.1));
}

TEST(SphereCover, OfACylinderBySpheresOnItsAxis) {
  // Each reaches to the rims of its half.
  const double r = std::hypot(0.1, 0.1);
  const Cylinder cylinder{0.1, 0.4};
  const std::vector<CollisionSphere> both{{1, {0, 0, 0.1}, r}, {1, {0, 0, -0.1}, r}};
  const Cover cover = cover_of(cylinder, both);
  const double shared = 2.0 * cap_m3(r, r - 0.1);
  const double spheres = 2.0 * ball_m3(r) - shared;
  EXPECT_NEAR(cover.spheres_m3, spheres, 0.01 * spheres);
  EXPECT_NEAR(cover.shapes_m3, pi * 0.01 * 0.4, 0.01 * pi * 0.01 * 0.4);
  EXPECT_NEAR(cover.excess_m3, spheres - pi * 0.01 * 0.4, 0.015 * spheres);
  EXPECT_GT(cover.surface_share, 0.9999);  // the rims, to rounding
  EXPECT_LT(cover.gap_m, 1e-8);
  // The upper one alone leaves half the side and an end.
  const Cover half = cover_of(cylinder, {both.front()});
  const double side = 2.0 * pi * 0.1 * 0.4, end = pi * 0.01;
  EXPECT_NEAR(half.surface_share, (0.5 * side + end) / (side + 2.0 * end), 0.01);
  EXPECT_NEAR(half.gap_m, std::hypot(0.1, 0.3) - r, 1e-9);
}

TEST(SphereCover, OfACapsuleByItsEnds) {
  const Capsule capsule{0.1, 0.3};
  const Cover cover = cover_of(capsule, {{1, {0, 0, 0.15}, 0.1}, {1, {0, 0, -0.15}, 0.1}});
  const double caps = 4.0 * pi * 0.01, side = 2.0 * pi * 0.1 * 0.3;
  EXPECT_NEAR(cover.surface_share, caps / (caps + side), 0.01);
  const double volume = ball_m3(0.1) + pi * 0.01 * 0.3;
  EXPECT_NEAR(cover.volume_share, 2.0 * ball_m3(0.1) / volume, 0.01);
  EXPECT_NEAR(cover.gap_m, std::hypot(0.1, 0.15) - 0.1, 2e-3);
  EXPECT_LT(cover.excess_m3, 1e-3 * volume);
}

TEST(SphereCover, CountsOnceWhereShapesOrSpheresOverlap) {
  // Two boxes that share half of each: 0.3 x 0.2 x 0.2.
  auto bodies = one_body({Box{{0.2, 0.2, 0.2}}, Box{{0.2, 0.2, 0.2}}});
  bodies[1].parts[1].T_body_shape.translation().x() = 0.1;
  bodies[1].parts[1].T_shape_body = bodies[1].parts[1].T_body_shape.inverse();
  const CollisionSphere sphere{1, {0.05, 0, 0}, 0.25};
  const Cover cover = measure_cover(bodies, {sphere, sphere, sphere}).whole;
  EXPECT_NEAR(cover.shapes_m3, 0.3 * 0.2 * 0.2, 0.01 * 0.012);
  EXPECT_NEAR(cover.spheres_m3, ball_m3(0.25), 1e-9);
  EXPECT_NEAR(cover.excess_m3, ball_m3(0.25) - 0.012, 0.01 * ball_m3(0.25));
}

TEST(SphereCover, WithoutSpheresNothingIsCovered) {
  const RobotCover cover = measure_cover(one_body({Box{{0.2, 0.2, 0.2}}}), {});
  ASSERT_EQ(cover.links.size(), 1U);
  EXPECT_EQ(cover.links[0].link, 1);
  EXPECT_EQ(cover.whole.surface_share, 0.0);
  EXPECT_GT(cover.whole.gap_m, 0.2);
}

}  // namespace
}  // namespace sidestep
