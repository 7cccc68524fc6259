#include "voxel_boxes.hpp"

#include <gtest/gtest.h>

#include <random>
#include <set>
#include <tuple>

#include <sidestep/runtime/shape_check.hpp>

#include "conformance/grid_map.hpp"

namespace sidestep {
namespace {

TEST(MergeVoxels, CoversExactlyTheVoxelsOnce) {
  constexpr double kResolution_m = 0.05;
  constexpr int kSide = 12;
  const Eigen::Vector3d origin(-0.317, 1.204, 0.66);
  std::mt19937 random(4);
  for (const double density : {0.02, 0.3, 0.7, 1.0}) {
    std::set<std::tuple<int, int, int>> occupied;
    std::vector<Eigen::Vector3d> centres;
    for (int i = 0; i < kSide * kSide * kSide; ++i) {
      if (std::uniform_real_distribution<double>()(random) > density) continue;
      const Eigen::Vector3i voxel(i % kSide, i / kSide % kSide, i / kSide / kSide);
      occupied.insert({voxel.x(), voxel.y(), voxel.z()});
      centres.push_back(origin + kResolution_m * voxel.cast<double>());
    }
    const auto boxes = merge_voxels(centres, kResolution_m);
    EXPECT_LE(boxes.size(), centres.size());
    double volume = 0.0;
    for (const auto& box : boxes) volume += box.volume();
    EXPECT_NEAR(volume, static_cast<double>(centres.size()) * std::pow(kResolution_m, 3), 1e-9);
    for (int i = 0; i < kSide * kSide * kSide; ++i) {
      const Eigen::Vector3i voxel(i % kSide, i / kSide % kSide, i / kSide / kSide);
      const Eigen::Vector3d centre = origin + kResolution_m * voxel.cast<double>();
      int covered = 0;
      for (const auto& box : boxes) covered += box.contains(centre) ? 1 : 0;
      EXPECT_EQ(covered, static_cast<int>(occupied.count({voxel.x(), voxel.y(), voxel.z()})));
    }
  }
}

TEST(MergeVoxels, MakesOneBoxOfAFullBlock) {
  std::vector<Eigen::Vector3d> centres;
  for (int i = 0; i < 60; ++i)
    centres.emplace_back(0.1 * (i % 3), 0.1 * (i / 3 % 4), 0.1 * (i / 12));
  const auto boxes = merge_voxels(centres, 0.1);
  ASSERT_EQ(boxes.size(), 1u);
  EXPECT_TRUE(boxes[0].min().isApprox(Eigen::Vector3d::Constant(-0.05), 1e-12));
  EXPECT_TRUE(boxes[0].max().isApprox(Eigen::Vector3d(0.25, 0.35, 0.45), 1e-12));
}

TEST(OccupiedCentres, AreThoseOfTheView) {
  conformance::GridMap map({{1.0, 2.0, 3.0}, 0.5, {70, 3, 2}});
  map.set({69, 2, 1}, true);
  map.set({0, 0, 0}, true);
  map.set({5, 1, 0}, false);
  const auto centres = occupied_centres(map);
  ASSERT_EQ(centres.size(), 2u);
  EXPECT_TRUE(centres[0].isApprox(Eigen::Vector3d(1.25, 2.25, 3.25)));
  EXPECT_TRUE(centres[1].isApprox(Eigen::Vector3d(35.75, 3.25, 3.75)));
}

}  // namespace
}  // namespace sidestep
