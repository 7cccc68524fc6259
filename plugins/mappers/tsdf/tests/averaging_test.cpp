// The weighted average along single rays, against values worked out by hand.
#include <gtest/gtest.h>

#include <cmath>
#include <random>

#include "tsdf_testing.hpp"

namespace sidestep::tsdf {
namespace {

/// A camera on the axis of a row of voxels, looking along it.
class AveragingTest : public ::testing::Test {
 protected:
  static TsdfOptions options(const std::string& integrator = "simple") {
    TsdfOptions options;
    options.resolution_m = 0.1;
    options.size_vox = {60, 20, 20};
    options.origin_m = {0.0, -1.05, 0.0};
    options.integrator = integrator;
    options.weighting = "constant";
    return options;
  }
  /// Points at these depths straight ahead; the camera stands in the centre of voxel (5, 10, 10).
  static Frame ahead(const std::vector<double>& depths_m) {
    Frame frame;
    frame.T_world_camera.linear() << 0, 0, 1, -1, 0, 0, 0, -1, 0;
    frame.T_world_camera.translation() = Eigen::Vector3d(0.55, 0.0, 1.05);
    PointCloud cloud;
    for (const double depth_m : depths_m) {
      cloud.points_m.emplace_back(0.0F, 0.0F, static_cast<float>(depth_m));
    }
    frame.measurement = cloud;
    return frame;
  }
  static Eigen::Vector3i voxel(int steps_ahead) { return {5 + steps_ahead, 10, 10}; }
};

TEST_F(AveragingTest, DistanceIsMeasuredAlongTheRay) {
  TsdfProbe map(options());
  map.integrate(ahead({2.03}));
  for (int n = 0; n <= 16; ++n) EXPECT_FLOAT_EQ(map.distance_m(voxel(n)), 0.4F) << n;
  for (int n = 17; n <= 24; ++n) {
    EXPECT_NEAR(map.distance_m(voxel(n)), std::max(-0.4, 2.03 - 0.1 * n), 1e-5) << n;
  }
  EXPECT_EQ(map.weight(voxel(25)), 0.0F) << "beyond the truncation distance";
  EXPECT_EQ(map.weight(voxel(0) - Eigen::Vector3i::UnitX()), 0.0F) << "behind the camera";
}

TEST_F(AveragingTest, WeightsFallBehindTheSurface) {
  TsdfProbe map(options());
  map.integrate(ahead({2.0}));
  // Full to one voxel behind it, then linearly to nothing at four.
  for (int n = 0; n <= 20; ++n) EXPECT_FLOAT_EQ(map.weight(voxel(n)), 1.0F) << n;
  EXPECT_NEAR(map.weight(voxel(22)), 2.0 / 3.0, 1e-4);
  EXPECT_NEAR(map.weight(voxel(23)), 1.0 / 3.0, 1e-4);
  TsdfOptions flat = options();
  flat.weight_dropoff = false;
  TsdfProbe without(flat);
  without.integrate(ahead({2.0}));
  EXPECT_FLOAT_EQ(without.weight(voxel(23)), 1.0F);
}

TEST_F(AveragingTest, FarPointsWeighLess) {
  TsdfOptions inverse = options();
  inverse.weighting = "inverse_square";
  TsdfProbe map(inverse);
  map.integrate(ahead({2.0}));
  EXPECT_FLOAT_EQ(map.weight(voxel(20)), 0.25F);
  map.integrate(ahead({4.0}));
  EXPECT_FLOAT_EQ(map.weight(voxel(20)), 0.25F + 0.0625F);
}

TEST_F(AveragingTest, DistancesAreAveragedByWeight) {
  TsdfOptions inverse = options();
  inverse.weighting = "inverse_square";
  TsdfProbe map(inverse);
  map.integrate(ahead({2.0}));
  map.integrate(ahead({2.2}));
  const double near = 1.0 / 4.0;
  const double far = 1.0 / 4.84;
  EXPECT_NEAR(map.distance_m(voxel(20)), (0.0 * near + 0.2 * far) / (near + far), 1e-5);
}

TEST_F(AveragingTest, WeightsStopGrowingAtTheLargest) {
  TsdfOptions light = options();
  light.max_weight = 4.0;
  TsdfProbe map(light);
  for (int f = 0; f < 10; ++f) map.integrate(ahead({2.0}));
  EXPECT_EQ(map.weight(voxel(20)), 4.0F);
  map.integrate(ahead({2.1}));
  EXPECT_NEAR(map.distance_m(voxel(20)), 0.1 / 5.0, 1e-5) << "the new point counts one in five";
}

TEST_F(AveragingTest, WhatIsSeenThroughClearsTheFasterTheFartherTheRayGoes) {
  TsdfOptions light = options();
  light.max_weight = 10.0;
  TsdfProbe near(light), far(light);
  for (TsdfProbe* map : {&near, &far}) {
    for (int f = 0; f < 10; ++f) map->integrate(ahead({2.0}));
  }
  near.integrate(ahead({2.5}));
  far.integrate(ahead({4.0}));
  EXPECT_NEAR(near.distance_m(voxel(20)), 0.5 / 11.0, 1e-5);
  EXPECT_NEAR(far.distance_m(voxel(20)), 2.0 / 11.0, 1e-5);
}

TEST_F(AveragingTest, MergedPointsAreOneRayWithTheirWeights) {
  TsdfProbe map(options("merged"));
  map.integrate(ahead({2.00, 2.04, 3.0}));  // the first two end in one voxel
  EXPECT_FLOAT_EQ(map.weight(voxel(20)), 3.0F);
  EXPECT_NEAR(map.distance_m(voxel(21)), ((2.02 - 2.1) * 2.0 + (3.0 - 2.1)) / 3.0, 1e-5);
  EXPECT_FLOAT_EQ(map.weight(voxel(29)), 1.0F);
}

TEST_F(AveragingTest, FastLeavesOutPointsOfACellThatHasOne) {
  // Cells of half a voxel: 2.01 and 2.03 share one, 1.97 lies in the same voxel's other half.
  TsdfOptions fast = options("fast");
  fast.max_consecutive_collisions = 1000;
  TsdfProbe map(fast);
  // All of a frame's 16 parts are as large as their share of its points, so that 48 points fill
  // them with three each.
  std::vector<double> depths_m;
  for (int i = 0; i < 16; ++i) depths_m.insert(depths_m.end(), {2.01, 2.03, 1.97});
  map.integrate(ahead(depths_m));
  EXPECT_FLOAT_EQ(map.weight(voxel(20)), 2.0F * 16.0F);
}

TEST_F(AveragingTest, FastStopsRaysAmongVoxelsThatOthersHaveSeen) {
  TsdfProbe map(options("fast"));
  std::vector<double> depths_m;
  for (int i = 0; i < 16; ++i) depths_m.insert(depths_m.end(), {2.00, 3.00});
  map.integrate(ahead(depths_m));
  // The second ray of each part passes the first one's first voxels, 0.4 m behind its end.
  EXPECT_FLOAT_EQ(map.weight(voxel(30)), 16.0F);
  EXPECT_FLOAT_EQ(map.weight(voxel(25)), 16.0F);
  EXPECT_GT(map.weight(voxel(23)), 16.0F) << "two voxels in a row may be seen again";
  EXPECT_FLOAT_EQ(map.weight(voxel(15)), 16.0F) << "then the ray stops";
}

TEST_F(AveragingTest, WithoutCarvingRaysStartBeforeTheSurface) {
  TsdfOptions blind = options();
  blind.carving = false;
  TsdfProbe map(blind);
  map.integrate(ahead({2.0}));
  EXPECT_EQ(map.weight(voxel(15)), 0.0F);
  EXPECT_FLOAT_EQ(map.weight(voxel(17)), 1.0F);
  EXPECT_FLOAT_EQ(map.weight(voxel(20)), 1.0F);
}

}  // namespace
}  // namespace sidestep::tsdf
