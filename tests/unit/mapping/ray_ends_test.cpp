#include <sidestep/mapping/ray_ends.hpp>

#include <cmath>
#include <limits>

#include <gtest/gtest.h>

namespace sidestep {
namespace {

/// A camera at (1, 1, 1) of a 4 m cube, looking along +x, over a floor at 0.
class RayEndsTest : public ::testing::Test {
 protected:
  RayEndsTest() {
    frame_.T_world_camera.linear() << 0, 0, 1, -1, 0, 0, 0, -1, 0;
    frame_.T_world_camera.translation() = Eigen::Vector3d(1, 1, 1);
  }

  /// The ray of one point given in the world.
  std::optional<RayEnd> end_of(const Eigen::Vector3d& p_world) {
    const Eigen::Vector3d p = frame_.T_world_camera.inverse() * p_world;
    frame_.measurement = PointCloud{{p.cast<float>()}};
    return first();
  }
  std::optional<RayEnd> end_of_pixel(float depth_m) {
    frame_.measurement = DepthImage{{1, 1, 1.0, 1.0, 0.0, 0.0}, {depth_m}};
    return first();
  }
  std::optional<RayEnd> first() {
    counts_ = {};
    const RayEnds ends(grid_, rules_, clear_no_return_, self_, frame_);
    EXPECT_EQ(ends.size(), 1U);
    return ends.at(0, counts_);
  }
  static void expect_end(const std::optional<RayEnd>& end, const Eigen::Vector3d& p_vox, bool hit) {
    ASSERT_TRUE(end);
    EXPECT_TRUE(end->p_vox.isApprox(p_vox, 1e-5)) << end->p_vox.transpose();
    EXPECT_EQ(end->hit, hit);
  }

  GridSpec grid_{Eigen::Vector3d::Zero(), 0.1, {40, 40, 40}};
  PointRules rules_{0.2, 5.0, 0.0, 0.03};
  SelfFilter self_{nullptr, 0.0};
  bool clear_no_return_ = false;
  Frame frame_;
  IntegrationCounts counts_;
};

TEST_F(RayEndsTest, PointInTheGridIsAHit) {
  expect_end(end_of({2.55, 1.35, 0.75}), {25.5, 13.5, 7.5}, true);
  EXPECT_EQ(counts_.points, 1);
  EXPECT_EQ(counts_.inserted, 1);
}

TEST_F(RayEndsTest, FloorPointIsAFreeEnd) {
  expect_end(end_of({2.0, 1.0, 0.02}), {20.0, 10.0, 0.2}, false);
  EXPECT_EQ(counts_.floor, 1);
  EXPECT_EQ(counts_.inserted, 0);
}

TEST_F(RayEndsTest, RayLeavesTheGridAtItsBoundary) {
  expect_end(end_of({5.0, 1.0, 1.0}), {40.0, 10.0, 10.0}, false);
  EXPECT_EQ(counts_.outside_grid, 1);
}

TEST_F(RayEndsTest, RayIsCutAtTheGreatestRange) {
  rules_.max_range_m = 1.5;
  expect_end(end_of({3.5, 1.0, 1.0}), {25.0, 10.0, 10.0}, false);
  EXPECT_EQ(counts_.out_of_range, 1);
}

TEST_F(RayEndsTest, NearAndNonFinitePointsAreInvalid) {
  EXPECT_FALSE(end_of({1.1, 1.0, 1.0}));
  EXPECT_EQ(counts_.invalid, 1);
  EXPECT_FALSE(end_of({std::nan(""), 1.0, 1.0}));
  EXPECT_EQ(counts_.invalid, 1);
  for (const float depth_m : {0.0F, -1.0F, std::nanf(""), std::numeric_limits<float>::infinity()}) {
    EXPECT_FALSE(end_of_pixel(depth_m)) << depth_m;
    EXPECT_EQ(counts_.invalid, 1) << depth_m;
    EXPECT_EQ(counts_.points, 0) << depth_m;
  }
}

TEST_F(RayEndsTest, NoReturnClearsOnRequestButNeverNaN) {
  clear_no_return_ = true;
  rules_.max_range_m = 2.0;
  expect_end(end_of_pixel(0.0F), {30.0, 10.0, 10.0}, false);
  EXPECT_EQ(counts_.invalid, 1);
  EXPECT_FALSE(end_of_pixel(std::nanf("")));
}

TEST_F(RayEndsTest, CameraOutsideTheGridStillHitsAndMisses) {
  frame_.T_world_camera.translation() = Eigen::Vector3d(-1, 1, 1);
  expect_end(end_of({2.05, 1.0, 1.0}), {20.5, 10.0, 10.0}, true);
  frame_.T_world_camera.translation() = Eigen::Vector3d(-1, 9, 1);
  EXPECT_FALSE(end_of({3.0, 9.0, 1.0})) << "passes beside the grid";
  EXPECT_EQ(counts_.outside_grid, 1);
}

TEST(ClipToBox, FindsThePartInsideOrNothing) {
  const Eigen::Vector3d size(10, 10, 10);
  const auto part = clip_to_box({-5, 5, 5}, {15, 5, 5}, size);
  ASSERT_TRUE(part);
  EXPECT_DOUBLE_EQ(part->enter, 0.25);
  EXPECT_DOUBLE_EQ(part->leave, 0.75);
  EXPECT_FALSE(clip_to_box({-5, 11, 5}, {15, 11, 5}, size));
  EXPECT_FALSE(clip_to_box({-5, 5, 5}, {-1, 5, 5}, size));
  EXPECT_FALSE(clip_to_box({3, 3, 3}, {3, 3, 3}, {2, 2, 2}));
}

TEST(NearestVoxel, StaysInTheGridAtItsUpperFace) {
  const GridSpec grid{Eigen::Vector3d::Zero(), 0.1, {4, 5, 6}};
  EXPECT_EQ(nearest_voxel(grid, {4.0, 4.99, -1e-12}), Eigen::Vector3i(3, 4, 0));
}

}  // namespace
}  // namespace sidestep
