#include <sidestep/geometry/shape.hpp>

#include <gtest/gtest.h>

#include "geometry_testing.hpp"

namespace sidestep {
namespace {

TEST(SignedDistance, OfABoxIsThatToFacesEdgesAndCorners) {
  const Shape box = Box{{2.0, 4.0, 6.0}};
  EXPECT_DOUBLE_EQ(signed_distance_m(box, {0.0, 0.0, 0.0}), -1.0);
  EXPECT_DOUBLE_EQ(signed_distance_m(box, {0.0, 1.75, 0.0}), -0.25);
  EXPECT_DOUBLE_EQ(signed_distance_m(box, {1.0, 0.0, 0.0}), 0.0);
  EXPECT_DOUBLE_EQ(signed_distance_m(box, {1.5, 0.3, -2.0}), 0.5);
  EXPECT_DOUBLE_EQ(signed_distance_m(box, {4.0, -6.0, 0.0}), 5.0);
  EXPECT_DOUBLE_EQ(signed_distance_m(box, {2.0, 4.0, 5.0}), 3.0);
}

TEST(SignedDistance, OfASphereIsThatToItsCentreLessTheRadius) {
  const Shape sphere = Sphere{0.5};
  EXPECT_DOUBLE_EQ(signed_distance_m(sphere, {0.0, 0.0, 0.0}), -0.5);
  EXPECT_DOUBLE_EQ(signed_distance_m(sphere, {3.0, 0.0, 4.0}), 4.5);
}

TEST(SignedDistance, OfACylinderIsThatToSideCapsAndRim) {
  const Shape cylinder = Cylinder{1.0, 4.0};
  EXPECT_DOUBLE_EQ(signed_distance_m(cylinder, {0.0, 0.0, 0.0}), -1.0);
  EXPECT_DOUBLE_EQ(signed_distance_m(cylinder, {0.0, 0.0, 1.75}), -0.25);
  EXPECT_DOUBLE_EQ(signed_distance_m(cylinder, {0.0, 3.0, 1.0}), 2.0);
  EXPECT_DOUBLE_EQ(signed_distance_m(cylinder, {0.5, 0.0, -5.0}), 3.0);
  EXPECT_DOUBLE_EQ(signed_distance_m(cylinder, {4.0, 0.0, 6.0}), 5.0);
}

TEST(SignedDistance, OfACapsuleMeasuresItsLengthBetweenTheCapsCentres) {
  const Shape capsule = Capsule{0.5, 2.0};
  EXPECT_DOUBLE_EQ(signed_distance_m(capsule, {0.0, 0.0, 0.0}), -0.5);
  EXPECT_DOUBLE_EQ(signed_distance_m(capsule, {0.0, 0.0, 1.5}), 0.0);
  EXPECT_DOUBLE_EQ(signed_distance_m(capsule, {3.0, 0.0, 0.9}), 2.5);
  EXPECT_DOUBLE_EQ(signed_distance_m(capsule, {3.0, 0.0, -5.0}), 4.5);
}

TEST(SignedDistance, OfAHalfSpaceIsTheHeightAboveIt) {
  EXPECT_DOUBLE_EQ(signed_distance_m(HalfSpace{}, {7.0, -9.0, 0.25}), 0.25);
  EXPECT_DOUBLE_EQ(signed_distance_m(HalfSpace{}, {7.0, -9.0, -2.0}), -2.0);
}

class SignedDistanceOfShape : public ::testing::TestWithParam<Shape> {};

TEST_P(SignedDistanceOfShape, IsThatToTheNearestOfManySurfaceSamples) {
  constexpr double kStep_m = 0.01;
  const testing::SurfaceSamples samples(GetParam(), kStep_m);
  std::mt19937 random(7);
  for (int i = 0; i < 300; ++i) {
    const Eigen::Vector3d p = testing::uniform_point(random, 0.8);
    double nearest_m = std::numeric_limits<double>::infinity();
    for (const Eigen::Vector3d& sample : samples.points) {
      nearest_m = std::min(nearest_m, (p - sample).norm());
    }
    const double distance_m = signed_distance_m(GetParam(), p);
    // Samples lie on the surface, so their distance is never the smaller one.
    EXPECT_LE(std::abs(distance_m), nearest_m + 1e-12) << p.transpose();
    EXPECT_GE(std::abs(distance_m), nearest_m - kStep_m) << p.transpose();
    EXPECT_EQ(distance_m < 0.0, testing::inside(GetParam(), p)) << p.transpose();
  }
}

INSTANTIATE_TEST_SUITE_P(EachShape, SignedDistanceOfShape,
                         ::testing::ValuesIn(testing::bounded_shapes()),
                         [](const auto& suite) { return std::string(shape_name(suite.param)); });

TEST(ShapeName, IsTheWordThatSceneFilesUse) {
  EXPECT_EQ(shape_name(Box{}), "box");
  EXPECT_EQ(shape_name(Sphere{}), "sphere");
  EXPECT_EQ(shape_name(Cylinder{}), "cylinder");
  EXPECT_EQ(shape_name(Capsule{}), "capsule");
  EXPECT_EQ(shape_name(HalfSpace{}), "half_space");
  EXPECT_EQ(shape_name(std::make_shared<const Mesh>()), "mesh");
}

}  // namespace
}  // namespace sidestep
