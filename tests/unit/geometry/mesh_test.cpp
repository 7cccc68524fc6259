#include <gtest/gtest.h>

#include "geometry_testing.hpp"

namespace sidestep {
namespace {

TEST(MeshDistance, OfABoxesFacetsIsTheBoxes) {
  const Box box{{0.4, 1.0, 0.2}};
  const Shape plain = std::make_shared<const Mesh>(triangulate(box));
  const Shape indexed = indexed_mesh(triangulate(box));
  std::mt19937 random(3);
  for (int i = 0; i < 2000; ++i) {
    const Eigen::Vector3d p = testing::uniform_point(random, 0.8);
    const double expected_m = signed_distance_m(box, p);
    EXPECT_NEAR(signed_distance_m(plain, p), expected_m, 1e-12) << p.transpose();
    EXPECT_NEAR(signed_distance_m(indexed, p), expected_m, 1e-12) << p.transpose();
  }
}

TEST(MeshDistance, WithAnIndexEqualsTheBruteForce) {
  const Mesh mesh = triangulate(Capsule{0.2, 0.6}, 100);
  ASSERT_GT(mesh.triangles.size(), 9000U);
  const Shape plain = std::make_shared<const Mesh>(mesh);
  const Shape indexed = indexed_mesh(mesh);
  std::mt19937 random(5);
  for (int i = 0; i < 300; ++i) {
    const Eigen::Vector3d p = testing::uniform_point(random, 0.7);
    EXPECT_NEAR(signed_distance_m(indexed, p), signed_distance_m(plain, p), 1e-14);
  }
}

TEST(MeshDistance, OfASphereComesCloseToTheSphere) {
  const Sphere sphere{0.5};
  const Shape mesh = indexed_mesh(triangulate(sphere, 200));
  std::mt19937 random(11);
  for (int i = 0; i < 1000; ++i) {
    const Eigen::Vector3d p = testing::uniform_point(random, 1.0);
    // The facets' sagitta: r (1 - cos(pi / 200)), for two curved directions.
    EXPECT_NEAR(signed_distance_m(mesh, p), signed_distance_m(sphere, p), 2.0 * 0.5 * 1.3e-4);
  }
}

TEST(MeshDistance, KeepsItsSignWhereFacesAreMissing) {
  Mesh open = triangulate(Box{{1.0, 1.0, 1.0}});
  open.triangles.pop_back();
  const Shape mesh = indexed_mesh(open);
  EXPECT_LT(signed_distance_m(mesh, {0.0, 0.0, 0.0}), 0.0);
  EXPECT_GT(signed_distance_m(mesh, {0.8, 0.0, 0.0}), 0.0);
}

TEST(MeshDistance, OfDegenerateTrianglesIsThatToTheirEdges) {
  Mesh mesh;
  mesh.vertices_m = {{0.0, 0.0, 0.0}, {1.0, 0.0, 0.0}, {2.0, 0.0, 0.0}};
  mesh.triangles = {{0, 1, 2}, {0, 0, 0}};
  EXPECT_DOUBLE_EQ(signed_distance_m(indexed_mesh(mesh), {1.5, 3.0, 4.0}), 5.0);
  EXPECT_DOUBLE_EQ(signed_distance_m(std::make_shared<const Mesh>(mesh), {1.5, 3.0, 4.0}), 5.0);
}

TEST(MeshDistance, IsInfiniteWithoutTriangles) {
  EXPECT_EQ(signed_distance_m(indexed_mesh({}), {0.0, 0.0, 0.0}),
            std::numeric_limits<double>::infinity());
  EXPECT_EQ(signed_distance_m(std::make_shared<const Mesh>(), {0.0, 0.0, 0.0}),
            std::numeric_limits<double>::infinity());
}

}  // namespace
}  // namespace sidestep
