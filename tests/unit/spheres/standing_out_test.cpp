#include "sphere_cover.hpp"

#include <limits>
#include <random>

#include <gtest/gtest.h>

namespace sidestep {
namespace {

/// Every triangle at the points of a lattice, with nothing left out.
double farthest_of_lattice_m(const Mesh& surface, const DistanceTo& distance_m, int n) {
  double farthest = 0.0;
  for (const Eigen::Vector3i& t : surface.triangles) {
    const auto corner = [&](int i) { return surface.vertices_m[static_cast<std::size_t>(t[i])]; };
    for (int i = 0; i <= n; ++i) {
      for (int j = 0; i + j <= n; ++j) {
        const double u = static_cast<double>(i) / n, v = static_cast<double>(j) / n;
        farthest = std::max(farthest,
                            distance_m((1.0 - u - v) * corner(0) + u * corner(1) + v * corner(2)));
      }
    }
  }
  return farthest;
}

TEST(StandingOut, IsWithinItsBoundOfEveryPoint) {
  std::mt19937 random(3);
  std::uniform_real_distribution<double> place(-0.1, 0.1), radius(0.05, 0.12);
  for (int trial = 0; trial < 12; ++trial) {
    std::vector<BodySphere> spheres;
    for (int i = 0; i < 6; ++i) {
      spheres.push_back({0, {place(random), place(random), place(random)}, radius(random)});
    }
    const DistanceTo distance_m = [&](const auto& p) { return signed_distance_m(spheres, p); };
    const Mesh surface = triangulate(Box{{0.2, 0.16, 0.24}});
    const StandingOut out = standing_out(surface, distance_m);
    const double lattice_m = farthest_of_lattice_m(surface, distance_m, 400);
    EXPECT_GE(out.farthest_m, lattice_m - kSurfaceFineness_m);
    EXPECT_GE(out.at_most_m, lattice_m);
    // A limit that is kept by more than the finest look is proven to be, any other is not.
    const double limit_m = out.farthest_m + kSurfaceFineness_m + 1.01 * kProofFineness_m;
    EXPECT_LE(standing_out(surface, distance_m, limit_m).at_most_m, limit_m);
    const double broken_m = lattice_m - 1e-9;
    EXPECT_GT(standing_out(surface, distance_m, broken_m).at_most_m, broken_m);
    if (out.farthest_m > 0.0) {
      EXPECT_DOUBLE_EQ(distance_m(out.p_farthest), out.farthest_m);
    }
    EXPECT_NEAR(out.surface_m2, 2.0 * (0.2 * 0.16 + 0.2 * 0.24 + 0.16 * 0.24), 1e-12);
  }
}

TEST(StandingOut, MeasuresHowMuchOfASurfaceIsOutside) {
  // The ball takes a disc of 0.06 m out of each of the faces above and below.
  const std::vector<BodySphere> ball{{0, Eigen::Vector3d::Zero(), 0.1}};
  const DistanceTo distance_m = [&](const auto& p) { return signed_distance_m(ball, p); };
  const StandingOut out = standing_out(triangulate(Box{{0.6, 0.6, 0.16}}), distance_m);
  const double inside_m2 = 2.0 * 3.14159265 * 0.06 * 0.06;
  EXPECT_NEAR(out.surface_m2 - out.outside_m2, inside_m2, 0.01 * inside_m2);
}

TEST(StandingOut, IsInfiniteWhereThereIsNothing) {
  const auto nothing = [](const Eigen::Vector3d&) {
    return std::numeric_limits<double>::infinity();
  };
  const StandingOut out = standing_out(triangulate(Box{{1.0, 1.0, 1.0}}), nothing);
  EXPECT_TRUE(std::isinf(out.farthest_m));
  EXPECT_NEAR(out.outside_m2, 6.0, 1e-12);
}

TEST(StandingOut, DrawsRoundShapesCloseToTheirSurface) {
  for (const Shape& shape :
       {Shape(Sphere{0.3}), Shape(Cylinder{0.25, 0.4}), Shape(Capsule{0.05, 0.2})}) {
    const Mesh surface = surface_of(shape);
    for (const Eigen::Vector3i& t : surface.triangles) {
      const auto corner = [&](int i) { return surface.vertices_m[static_cast<std::size_t>(t[i])]; };
      const Eigen::Vector3d middle = (corner(0) + corner(1) + corner(2)) / 3.0;
      ASSERT_GE(signed_distance_m(shape, 0.5 * (corner(0) + corner(2))), -1e-4);
      // Flat ends have their middles on the surface, too.
      ASSERT_GE(signed_distance_m(shape, middle), -1e-4);
    }
  }
}

}  // namespace
}  // namespace sidestep
