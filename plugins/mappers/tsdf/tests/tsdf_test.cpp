#include <gtest/gtest.h>

#include <cmath>
#include <random>

#include "conformance/map_bits.hpp"
#include "support/ball_robot.hpp"
#include "support/wrong_option.hpp"
#include "tsdf_testing.hpp"

namespace sidestep::tsdf {
namespace {

using testing_support::BallRobot;
using testing_support::BoxWorld;
using testing_support::kinect;
using testing_support::look_at;

class TsdfTest : public ::testing::TestWithParam<std::string> {};

TEST_P(TsdfTest, WallIsOneOrTwoLayersAtItsDistance) {
  TsdfProbe map(options_of(GetParam()));
  map.see({{wall_at(3.02)}});
  for (const double y_m : {-0.7, 0.0, 0.9}) {
    EXPECT_EQ(map.at(3.02, y_m, 1.02), '#') << y_m;
    EXPECT_EQ(map.at(2.92, y_m, 1.02), '.') << y_m;
    EXPECT_EQ(map.at(1.5, y_m / 4, 1.02), '.') << y_m;
    EXPECT_EQ(map.at(3.12, y_m, 1.02), '?') << "behind the wall at y " << y_m;
    EXPECT_LT(map.distance_m(map.voxel_at(3.12, y_m, 1.02)), -0.05F) << "but in the band";
  }
}

TEST_P(TsdfTest, RemovedWallIsGoneSoonWhereWeightsAreSmall) {
  TsdfOptions options = options_of(GetParam());
  options.weighting = "constant";
  options.max_weight = 4.0;
  TsdfProbe map(options);
  for (int f = 0; f < 10; ++f) map.see({{wall_at(2.02)}});
  EXPECT_EQ(map.at(2.02, 0.0, 1.02), '#');
  // One ray that goes on for 1 m moves the average to at least (1 - 4 * 0.05) / 5 m.
  const MapUpdate update = map.see({{wall_at(3.02)}});
  EXPECT_EQ(map.at(2.02, 0.0, 1.02), '.');
  EXPECT_FALSE(update.changed_blocks.empty());
}

TEST_P(TsdfTest, FloorIsClearedNotInserted) {
  TsdfProbe map(options_of(GetParam()));
  const BoxWorld world{{{{-9, -9, -1}, {9, 9, 0.01}}}};
  const MapUpdate update = map.see(world, look_at({0.52, 0.02, 1.3}, {1.7, 0.1, 0.0}));
  EXPECT_GT(update.counts.floor, 1000);
  EXPECT_EQ(update.counts.inserted, 0);
  EXPECT_EQ(map.at(1.7, -0.2, 0.02), '.') << "the layer above the floor";
  EXPECT_EQ(map.at(1.7, -0.2, 0.12), '.');
  for (const std::uint64_t word : map.mapper().occupied().words) EXPECT_EQ(word, 0U);
}

TEST_P(TsdfTest, RaysBeyondTheRangeClearUpToIt) {
  TsdfOptions options = options_of(GetParam());
  options.max_range_m = 2.0;
  TsdfProbe map(options);
  const MapUpdate update = map.see({{wall_at(3.02)}});
  EXPECT_EQ(update.counts.out_of_range, update.counts.points);
  EXPECT_EQ(map.at(0.52 + 1.9, 0.02, 1.02), '.');
  EXPECT_FLOAT_EQ(map.distance_m(map.voxel_at(0.52 + 1.9, 0.02, 1.02)), 0.2F);
  EXPECT_EQ(map.at(0.52 + 2.1, 0.02, 1.02), '?');
  EXPECT_EQ(map.at(3.02, 0.02, 1.02), '?');
}

TEST_P(TsdfTest, PointsBelowTheLeastRangeAreNoMeasurement) {
  TsdfOptions options = options_of(GetParam());
  options.min_range_m = 0.5;
  TsdfProbe map(options);
  const MapUpdate update = map.see({{wall_at(0.82)}});
  EXPECT_EQ(update.counts.points + update.counts.invalid, 160 * 120);
  EXPECT_EQ(map.at(0.82, 0.02, 1.02), '?');
}

TEST_P(TsdfTest, PixelsWithoutReturnClearOnlyOnRequest) {
  TsdfOptions options = options_of(GetParam());
  TsdfProbe map(options);
  EXPECT_TRUE(map.see({}).changed_blocks.empty());
  options.clear_no_return = true;
  options.max_range_m = 3.0;
  TsdfProbe clearing(options);
  EXPECT_EQ(clearing.see({}).counts.invalid, 160 * 120);
  EXPECT_EQ(clearing.at(3.4, 0.02, 1.02), '.');
  EXPECT_EQ(clearing.at(3.6, 0.02, 1.02), '?');
}

TEST_P(TsdfTest, RobotsOwnPointsNeitherInsertNorClear) {
  TsdfProbe map(options_of(GetParam()), 2, std::make_shared<BallRobot>(0.3));
  const BoxWorld world{{wall_at(3.02), {{1.72, -0.1, 0.9}, {1.9, 0.1, 1.1}}}};
  Frame frame = world.frame(0, kinect(160, 120), eye());
  frame.joint_positions = Eigen::Vector3d(1.9, 0.0, 1.0);
  EXPECT_GT(map.integrate(frame).counts.self, 50);
  EXPECT_EQ(map.at(1.72, 0.02, 1.02), '?');
  EXPECT_EQ(map.at(1.52, 0.02, 1.02), '?') << "the ray to the robot says nothing";
  EXPECT_EQ(map.at(3.02, 0.8, 1.02), '#');
  frame.joint_positions.reset();
  EXPECT_EQ(map.integrate(frame).counts.self, 0);
  EXPECT_EQ(map.at(1.72, 0.02, 1.02), '#') << "without joint positions it is an obstacle";
}

TEST_P(TsdfTest, JointPositionsThatDoNotFitAreABadFrame) {
  TsdfProbe map(options_of(GetParam()), 2, std::make_shared<BallRobot>(0.3));
  Frame frame = BoxWorld{{wall_at(3.02)}}.frame(17, kinect(160, 120), eye());
  frame.joint_positions = Eigen::Vector2d(0.0, 0.0);
  const auto update = map.mapper().integrate(frame);
  ASSERT_FALSE(update);
  EXPECT_EQ(update.error().code, ErrorCode::kBadFrame);
  EXPECT_EQ(map.mapper().tsdf_block(0), nullptr);
}

TEST_P(TsdfTest, ChangesAreNamedExactlyUnderRandomViews) {
  TsdfProbe map(options_of(GetParam()));
  std::mt19937 random(5);
  std::uniform_real_distribution<double> uniform(-1.0, 1.0);
  conformance::MapBits before = conformance::copy_bits(map.mapper());
  auto tsdf_before = map.copy();
  for (int f = 0; f < 20; ++f) {
    const Eigen::Vector3d box(2.0 + uniform(random), uniform(random), 0.9 + uniform(random));
    const BoxWorld world{{{{-9, -9, -1}, {9, 9, 0}},
                          {{4.52, -9, -9}, {9, 9, 9}},
                          {box, box + Eigen::Vector3d(0.4, 0.4, 0.4)}}};
    // Now and then from outside the grid, from beside it, or looking straight down.
    const Eigen::Vector3d from(0.5 + uniform(random), 2.0 * uniform(random),
                               1.4 + uniform(random) * (f % 5 == 0 ? 3.0 : 0.3));
    const Eigen::Vector3d target =
        f % 7 == 0 ? Eigen::Vector3d(from.x(), from.y(), -5.0) : Eigen::Vector3d(2.5, 0.0, 0.8);
    const MapUpdate update = map.see(world, look_at(from, target));
    conformance::MapBits after = conformance::copy_bits(map.mapper());
    ASSERT_EQ(update.changed_blocks, conformance::differing_blocks(map.grid(), before, after))
        << "frame " << f;
    before = std::move(after);
    auto tsdf_after = map.copy();
    std::vector<std::int32_t> differing;
    for (std::size_t b = 0; b < tsdf_after.size(); ++b) {
      bool differs = false;
      for (std::size_t v = 0; 2 * v < tsdf_after[b].size(); ++v) {
        const bool was = !tsdf_before[b].empty() && tsdf_before[b][v + TsdfBlock::kVoxels] > 0.0F;
        const bool is = tsdf_after[b][v + TsdfBlock::kVoxels] > 0.0F;
        differs |= was != is || (is && tsdf_before[b][v] != tsdf_after[b][v]);
      }
      if (differs) differing.push_back(static_cast<std::int32_t>(b));
    }
    // A value may change and change back within a frame: named, though equal after it.
    const auto named = map.mapper().tsdf_changed_blocks();
    ASSERT_TRUE(std::ranges::is_sorted(named));
    ASSERT_TRUE(std::ranges::includes(named, differing)) << "frame " << f;
    tsdf_before = std::move(tsdf_after);
  }
}

TEST_P(TsdfTest, DistancesAreTheSameOnAnyNumberOfThreads) {
  std::vector<std::vector<std::vector<float>>> results;
  for (const int threads : {1, 2, 5}) {
    TsdfProbe map(options_of(GetParam()), threads);
    for (int f = 0; f < 3; ++f) {
      map.see({{wall_at(3.02 + 0.03 * f), {{1.52, 0.1, 0.2}, {1.9, 0.8, 1.3}}}});
    }
    results.push_back(map.copy());
  }
  EXPECT_EQ(results[0], results[1]);
  EXPECT_EQ(results[0], results[2]);
}

TEST_P(TsdfTest, OnlyBlocksThatRaysTouchAreAllocated) {
  TsdfProbe map(options_of(GetParam()));
  map.see({{wall_at(1.02)}});
  const Eigen::Vector3i counts = block_counts(map.grid());
  for (int b = 0; b < counts.prod(); ++b) {
    // The wall is in the second block along x; the band behind it ends there as well.
    if (b % counts.x() >= 2) {
      EXPECT_EQ(map.mapper().tsdf_block(b), nullptr) << b;
    }
  }
}

INSTANTIATE_TEST_SUITE_P(integrators, TsdfTest, ::testing::Values("simple", "merged", "fast"),
                         [](const auto& test) { return test.param; });

using WrongOption = testing_support::WrongOption<TsdfOptions>;

class WrongOptions : public ::testing::TestWithParam<WrongOption> {};

TEST_P(WrongOptions, FailNamingTheParameter) { expect_told(GetParam()); }

INSTANTIATE_TEST_SUITE_P(
    each, WrongOptions,
    ::testing::Values(WrongOption{"size_vox", [](TsdfOptions& o) { o.size_vox.fill(1 << 20); }},
                      WrongOption{"max_weight", [](TsdfOptions& o) { o.max_weight = 0.0; }},
                      WrongOption{"max_range_m",
                                  [](TsdfOptions& o) { o.max_range_m = o.min_range_m; }}));

}  // namespace
}  // namespace sidestep::tsdf
