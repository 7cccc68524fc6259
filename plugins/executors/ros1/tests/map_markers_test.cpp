#include "markers.hpp"

#include <algorithm>
#include <cmath>

#include <gtest/gtest.h>

namespace sidestep::ros1_executor {
namespace {

using ros_messages::Marker;

/// Around one occupied voxel, 40 x 30 x 20 voxels of 10 cm.
constexpr int kWide = 40, kDeep = 30, kHigh = 20;
const Eigen::Vector3i kSolid(12, 7, 5);

std::shared_ptr<const DenseField> field_around_one(int wide = kWide) {
  FieldInfo info;
  info.grid = {Eigen::Vector3d(-1.0, -2.0, 0.0), 0.1, Eigen::Vector3i(wide, kDeep, kHigh)};
  info.max_distance_m = 0.8;
  return make_dense_field(info, [](const Eigen::Vector3i& voxel) {
    return std::min(0.8, 0.1 * (voxel - kSolid).cast<double>().norm());
  });
}

TEST(MapMarkers, OfVoxelsShowThoseThatAreOccupied) {
  const auto field = field_around_one();
  OccupancyBits voxels;
  voxels.update(field);
  const auto array = voxel_markers(voxels, "odom", ::ros::Time(3, 4));
  ASSERT_EQ(array.markers.size(), 2U);
  EXPECT_EQ(array.markers[0].action, Marker::DELETEALL);
  const Marker& cubes = array.markers[1];
  EXPECT_EQ(cubes.type, Marker::CUBE_LIST);
  EXPECT_EQ(cubes.header.frame_id, "odom");
  EXPECT_EQ(cubes.scale.x, 0.1);
  ASSERT_EQ(cubes.points.size(), 1U);
  ASSERT_EQ(cubes.colors.size(), 1U);
  const Eigen::Vector3d centre_m = field->info().grid.centre_m(kSolid);
  EXPECT_DOUBLE_EQ(cubes.points[0].x, centre_m.x());
  EXPECT_DOUBLE_EQ(cubes.points[0].y, centre_m.y());
  EXPECT_DOUBLE_EQ(cubes.points[0].z, centre_m.z());
}

TEST(MapMarkers, OfNoVoxelsAreNone) {
  const auto array = voxel_markers(OccupancyBits(), "odom", ::ros::Time(3, 4));
  ASSERT_EQ(array.markers.size(), 1U);
  EXPECT_EQ(array.markers[0].action, Marker::DELETEALL);
}

TEST(MapMarkers, OfASliceAreRedInsideAndBlueFarAway) {
  const auto field = field_around_one();
  const double height_m = field->info().grid.centre_m(kSolid).z();
  const auto array = slice_markers(*field, height_m, "odom", ::ros::Time(3, 4));
  ASSERT_EQ(array.markers.size(), 2U);
  const Marker& squares = array.markers[1];
  ASSERT_EQ(squares.points.size(), static_cast<std::size_t>(kWide * kDeep));
  ASSERT_EQ(squares.colors.size(), squares.points.size());
  EXPECT_EQ(squares.scale.x, 0.1);
  for (std::size_t i = 0; i < squares.points.size(); ++i) {
    const auto& p = squares.points[i];
    EXPECT_DOUBLE_EQ(p.z, height_m);
    const Eigen::Vector3d away_m =
        Eigen::Vector3d(p.x, p.y, p.z) - field->info().grid.centre_m(kSolid);
    const auto& colour = squares.colors[i];
    if (away_m.norm() < 1e-9) {
      EXPECT_EQ(std::tie(colour.r, colour.g, colour.b), std::make_tuple(1.0F, 0.0F, 0.0F));
    } else if (away_m.norm() > 0.8 - 1e-6) {
      EXPECT_EQ(std::tie(colour.r, colour.g, colour.b), std::make_tuple(0.0F, 0.0F, 1.0F));
    } else {
      EXPECT_TRUE(colour.g > 0.0F) << away_m.norm();
    }
  }
}

TEST(MapMarkers, OfALargeSliceAreBoundedInNumber) {
  const auto field = field_around_one(5 * kMostSliceSquares + 3);
  const auto array = slice_markers(*field, 100.0, "odom", ::ros::Time(3, 4));
  ASSERT_EQ(array.markers.size(), 2U);
  const Marker& squares = array.markers[1];
  EXPECT_LE(squares.points.size(), static_cast<std::size_t>(kMostSliceSquares * kMostSliceSquares));
  EXPECT_NEAR(squares.scale.x, 0.6, 1e-12);
  // Moved into the grid.
  EXPECT_NEAR(squares.points[0].z, 1.95, 1e-9);
}

}  // namespace
}  // namespace sidestep::ros1_executor
