#include <map>

#include <gtest/gtest.h>

#include "geometry_testing.hpp"

namespace sidestep {
namespace {

double volume_m3(const Mesh& mesh) {
  double sum = 0.0;
  for (const Eigen::Vector3i& t : mesh.triangles) {
    const auto& v = mesh.vertices_m;
    sum += v[static_cast<std::size_t>(t[0])].dot(
        v[static_cast<std::size_t>(t[1])].cross(v[static_cast<std::size_t>(t[2])]));
  }
  return sum / 6.0;
}

double volume_m3(const Shape& shape) {
  constexpr double kPi = std::numbers::pi;
  struct Volume {
    double operator()(const Box& b) const { return b.size_m.prod(); }
    double operator()(const Sphere& s) const { return 4.0 / 3.0 * kPi * std::pow(s.radius_m, 3); }
    double operator()(const Cylinder& c) const {
      return kPi * c.radius_m * c.radius_m * c.length_m;
    }
    double operator()(const Capsule& c) const {
      return (*this)(Sphere{c.radius_m}) + (*this)(Cylinder{c.radius_m, c.length_m});
    }
    double operator()(const HalfSpace&) const { return 0.0; }
    double operator()(const std::shared_ptr<const Mesh>&) const { return 0.0; }
  };
  return std::visit(Volume{}, shape);
}

class TriangulateShape : public ::testing::TestWithParam<Shape> {};

TEST_P(TriangulateShape, IsClosedAndFacesOutwards) {
  const Mesh mesh = triangulate(GetParam());
  std::map<std::pair<int, int>, int> edges;
  for (const Eigen::Vector3i& t : mesh.triangles) {
    for (int i = 0; i < 3; ++i) ++edges[{t[i], t[(i + 1) % 3]}];
  }
  ASSERT_FALSE(edges.empty());
  for (const auto& [edge, count] : edges) {
    EXPECT_EQ(count, 1);
    EXPECT_TRUE(edges.contains({edge.second, edge.first}));
  }
  EXPECT_GT(volume_m3(mesh), 0.0);
}

TEST_P(TriangulateShape, IsInscribedAndNearlyFillsTheShape) {
  const Mesh mesh = triangulate(GetParam(), 96);
  for (const Eigen::Vector3d& vertex : mesh.vertices_m) {
    EXPECT_NEAR(signed_distance_m(GetParam(), vertex), 0.0, 1e-12);
  }
  EXPECT_LE(volume_m3(mesh), volume_m3(GetParam()) * (1.0 + 1e-12));
  EXPECT_GE(volume_m3(mesh), volume_m3(GetParam()) * 0.995);
}

TEST_P(TriangulateShape, AcceptsAnyNumberOfSegments) {
  for (const int segments : {-1, 0, 3, 4, 5}) {
    EXPECT_GT(volume_m3(triangulate(GetParam(), segments)), 0.0) << segments;
  }
}

INSTANTIATE_TEST_SUITE_P(EachShape, TriangulateShape,
                         ::testing::ValuesIn(testing::bounded_shapes()),
                         [](const auto& suite) { return std::string(shape_name(suite.param)); });

TEST(Triangulate, HasNothingToShowOfAHalfSpace) {
  EXPECT_TRUE(triangulate(HalfSpace{}).triangles.empty());
}

}  // namespace
}  // namespace sidestep
