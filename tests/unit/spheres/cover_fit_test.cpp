#include "cover_fit.hpp"

#include <algorithm>

#include "cluster_fit.hpp"
#include "spheres_testing.hpp"

namespace sidestep {
namespace {

using testing_support::one_body;

struct FitCase {
  const char* name;
  Shape shape;
  friend void PrintTo(const FitCase& one, std::ostream* out) { *out << one.name; }
};

/// A closed mesh that is no primitive: a wedge.
Shape wedge() {
  Mesh mesh;
  mesh.vertices_m = {{0, 0, 0},    {0.3, 0, 0},    {0, 0.2, 0},
                     {0, 0, 0.15}, {0.3, 0, 0.15}, {0, 0.2, 0.15}};
  mesh.triangles = {{0, 2, 1}, {3, 4, 5}, {0, 1, 4}, {0, 4, 3},
                    {1, 2, 5}, {1, 5, 4}, {2, 0, 3}, {2, 3, 5}};
  return indexed_mesh(std::move(mesh));
}

class CoverFit : public ::testing::TestWithParam<FitCase> {
 protected:
  /// How far points of the shape lie outside of all spheres, at most: brute force.
  static double deepest_gap_m(const Shape& shape, const std::vector<CollisionSphere>& spheres) {
    std::mt19937_64 generator(7);
    std::uniform_real_distribution<double> unit(-1.0, 1.0);
    const ShapeBounds bounds = bounds_of(shape);
    double deepest = -1.0;
    for (int i = 0; i < 200'000; ++i) {
      Eigen::Vector3d p(unit(generator), unit(generator), unit(generator));
      // Every other one at a face, an edge or a corner of the bounding box.
      if (i % 2 == 0) p[i / 2 % 3] = p[i / 2 % 3] < 0.0 ? -1.0 : 1.0;
      if (i % 4 == 0) p[i / 4 % 3] = p[i / 4 % 3] < 0.0 ? -1.0 : 1.0;
      p = bounds.centre_m + p.cwiseProduct(bounds.half_m);
      if (signed_distance_m(shape, p) > 0.0) continue;
      double nearest = 1.0;
      for (const CollisionSphere& one : spheres) {
        nearest = std::min(nearest, (p - one.centre_link_m).norm() - one.radius_m);
      }
      deepest = std::max(deepest, nearest);
    }
    return deepest;
  }
  static double protrusion_m(const Shape& shape, const std::vector<CollisionSphere>& spheres) {
    std::mt19937_64 generator(8);
    std::normal_distribution<double> normal;
    double farthest = 0.0;
    for (const CollisionSphere& one : spheres) {
      for (int i = 0; i < 5000; ++i) {
        const Eigen::Vector3d d(normal(generator), normal(generator), normal(generator));
        farthest = std::max(
            farthest, signed_distance_m(shape, one.centre_link_m + one.radius_m * d.normalized()));
      }
    }
    return farthest;
  }
};

TEST_P(CoverFit, HoldsTheWholeShapeWithinTheProtrusionThatIsAskedFor) {
  const auto bodies = one_body({GetParam().shape});
  std::size_t before = 0;
  for (const double protrusion : {0.1, 0.05, 0.025}) {
    const auto spheres = fit_cover(bodies, {}, {.protrusion_m = protrusion});
    ASSERT_FALSE(spheres.empty());
    EXPECT_LE(deepest_gap_m(GetParam().shape, spheres), 1e-9) << protrusion;
    EXPECT_LE(protrusion_m(GetParam().shape, spheres), protrusion);
    EXPECT_GE(spheres.size(), before);
    before = spheres.size();
    for (const CollisionSphere& sphere : spheres) EXPECT_EQ(sphere.link, 1);
  }
}

TEST_P(CoverFit, HoldsTheWholeShapeWithAnyNumberOfSpheres) {
  const auto bodies = one_body({GetParam().shape});
  for (const int count : {1, 4, 12}) {
    const auto spheres = fit_cover(bodies, {}, {.most_spheres = count});
    EXPECT_LE(static_cast<int>(spheres.size()), count);
    ASSERT_FALSE(spheres.empty());
    EXPECT_LE(deepest_gap_m(GetParam().shape, spheres), 1e-9) << count;
  }
}

TEST_P(CoverFit, IsTheSameAgain) {
  const auto bodies = one_body({GetParam().shape});
  const auto a = fit_cover(bodies, {}, {.protrusion_m = 0.04});
  const auto b = fit_cover(bodies, {}, {.protrusion_m = 0.04});
  ASSERT_EQ(a.size(), b.size());
  for (std::size_t i = 0; i < a.size(); ++i) {
    EXPECT_EQ(a[i].centre_link_m, b[i].centre_link_m);
    EXPECT_EQ(a[i].radius_m, b[i].radius_m);
  }
}

INSTANTIATE_TEST_SUITE_P(
    Shapes, CoverFit,
    ::testing::Values(FitCase{"sphere", Sphere{0.2}}, FitCase{"box", Box{{0.3, 0.2, 0.1}}},
                      FitCase{"disc", Cylinder{0.2, 0.1}}, FitCase{"column", Cylinder{0.05, 0.6}},
                      FitCase{"capsule", Capsule{0.06, 0.5}}, FitCase{"wedge", wedge()}),
    [](const auto& test) { return test.param.name; });

TEST(CoverFitOf, ASphereIsThatSphere) {
  const auto spheres = fit_cover(one_body({Sphere{0.1234567}}), {}, {.protrusion_m = 0.02});
  ASSERT_EQ(spheres.size(), 1U);
  EXPECT_EQ(spheres[0].radius_m, 0.1234567);
  EXPECT_EQ(spheres[0].centre_link_m, Eigen::Vector3d(0, 0, 0));
}

TEST(CoverFitOf, OneLinkLeavesTheOthersAlone) {
  const auto bodies = one_body({Box{{0.3, 0.2, 0.1}}});
  const std::vector<CollisionSphere> now{{0, {1, 2, 3}, 0.5}, {1, {0, 0, 0}, 9.0}};
  const auto spheres = fit_cover(bodies, now, {.protrusion_m = 0.05, .link = 1});
  ASSERT_GT(spheres.size(), 1U);
  EXPECT_EQ(spheres[0].centre_link_m, now[0].centre_link_m);
  EXPECT_TRUE(std::ranges::none_of(spheres, [](const auto& one) { return one.radius_m == 9.0; }));
}

TEST(CoverFitOf, AStopLeavesACompleteCover) {
  std::stop_source stop;
  stop.request_stop();
  const auto spheres =
      fit_cover(one_body({Box{{0.3, 0.2, 0.1}}}), {}, {.protrusion_m = 0.002}, stop.get_token());
  ASSERT_FALSE(spheres.empty());
  const Eigen::Vector3d corner(0.15, 0.1, 0.05);
  EXPECT_TRUE(std::ranges::any_of(spheres, [&](const CollisionSphere& one) {
    return (one.centre_link_m - corner).norm() <= one.radius_m;
  }));
}

}  // namespace
}  // namespace sidestep
