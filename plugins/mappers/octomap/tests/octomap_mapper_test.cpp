#include "octomap_mapper.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <memory>
#include <string>

#include "conformance/map_bits.hpp"
#include "support/ball_robot.hpp"
#include "support/mapper_probe.hpp"
#include "support/wrong_option.hpp"

namespace sidestep::octomap_mapper {
namespace {

using testing_support::BallRobot;
using testing_support::BoxWorld;
using testing_support::eye;
using testing_support::kinect;
using testing_support::look_at;
using testing_support::wall_at;

using Probe = testing_support::MapperProbe<OctomapMapper>;

OctomapOptions small_options() { return testing_support::small_map_options<OctomapOptions>(); }

/// Every voxel's bits against the tree itself.
void expect_bits_equal_tree(Probe& map) {
  const GridSpec& grid = map.grid();
  octomap::OcTree& tree = map.mapper().octree();
  std::size_t differences = 0;
  for (int z = 0; z < grid.size_vox.z(); ++z) {
    for (int y = 0; y < grid.size_vox.y(); ++y) {
      for (int x = 0; x < grid.size_vox.x(); ++x) {
        const Eigen::Vector3d p = grid.centre_m({x, y, z});
        const octomap::OcTreeNode* node = tree.search(p.x(), p.y(), p.z());
        const bool known = node != nullptr;
        const bool occupied = known && tree.isNodeOccupied(node);
        differences += known != map.mapper().known().at(grid, {x, y, z}) ||
                       occupied != map.mapper().occupied().at(grid, {x, y, z});
      }
    }
  }
  EXPECT_EQ(differences, 0U);
}

TEST(OctomapMapperTest, BitsEqualTheTreeThroughChangingScenes) {
  Probe map(small_options(), 1);
  for (int f = 0; f < 12; ++f) {
    const double x_m = f < 6 ? 2.02 : 3.02;
    const Transform pose = look_at({0.52, 0.1 * f, 1.02}, {9.0, 0.02, 1.02});
    map.see({{wall_at(x_m), {{-9, -9, -1}, {9, 9, 0}}}}, pose);
  }
  expect_bits_equal_tree(map);
  EXPECT_EQ(map.at(3.02, 0.5, 1.02), '#');
}

TEST(OctomapMapperTest, TreeHoldsTheNewestFramesChangesAndNoOthers) {
  Probe map(small_options(), 1);
  map.see({{wall_at(2.02)}});
  octomap::OcTree& tree = map.mapper().octree();
  EXPECT_TRUE(tree.isChangeDetectionEnabled());
  EXPECT_GT(tree.numChangesDetected(), 0U);
  map.see({{wall_at(2.02)}});
  EXPECT_EQ(tree.numChangesDetected(), 0U) << "the same frame again changes nothing";
  const conformance::MapBits before = conformance::copy_bits(map.mapper());
  // A consumer that resets them, as DynamicEDTOctomap does, takes nothing from the mapper.
  tree.resetChangeDetection();
  const MapUpdate update = map.see({{wall_at(1.52)}});
  EXPECT_EQ(update.changed_blocks, conformance::differing_blocks(
                                       map.grid(), before, conformance::copy_bits(map.mapper())));
  expect_bits_equal_tree(map);
}

TEST(OctomapMapperTest, StaysWithinItsGrid) {
  Probe map(small_options(), 1);
  map.see({{wall_at(9.02), {{-9, 2.6, -9}, {9, 9, 9}}}}, look_at({0.5, 0, 1}, {3, 3, 1}));
  double min_m[3];
  double max_m[3];
  map.mapper().octree().getMetricMin(min_m[0], min_m[1], min_m[2]);
  map.mapper().octree().getMetricMax(max_m[0], max_m[1], max_m[2]);
  for (int axis = 0; axis < 3; ++axis) {
    EXPECT_GE(min_m[axis], map.grid().origin_m[axis] - 1e-6);
    EXPECT_LE(max_m[axis], map.grid().upper_m()[axis] + 1e-6);
  }
  EXPECT_EQ(map.at(2.5, 2.02, 1.02), '.') << "rays that leave the grid clear up to its boundary";
}

TEST(OctomapMapperTest, RemovedWallIsGoneAfterTheFramesThatTheLogOddsImply) {
  Probe map(small_options(), 1);
  for (int f = 0; f < 20; ++f) map.see({{wall_at(2.02)}});
  // log(0.971 / 0.029) = 3.51; a miss adds log(0.4 / 0.6) = -0.405: below 0 after 9.
  for (int f = 0; f < 8; ++f) map.see({{wall_at(3.02)}});
  EXPECT_EQ(map.at(2.02, 0.0, 1.02), '#');
  map.see({{wall_at(3.02)}});
  EXPECT_EQ(map.at(2.02, 0.0, 1.02), '.');
}

TEST(OctomapMapperTest, FloorIsClearedNotInserted) {
  Probe map(small_options(), 1);
  const BoxWorld world{{{{-9, -9, -1}, {9, 9, 0.01}}, {{1.5, 0.3, 0}, {2.0, 0.8, 0.04}}}};
  const MapUpdate update = map.see(world, look_at({0.52, 0.02, 1.3}, {1.7, 0.1, 0.0}));
  EXPECT_GT(update.counts.floor, 1000);
  EXPECT_EQ(map.at(1.7, -0.2, 0.02), '.');
  EXPECT_EQ(map.at(1.7, 0.5, 0.035), '#');
}

TEST(OctomapMapperTest, RangeAndSelfFilterHold) {
  OctomapOptions options = small_options();
  options.max_range_m = 2.0;
  Probe map(options, 1, std::make_shared<BallRobot>(0.3));
  const BoxWorld world{{wall_at(3.02), {{1.72, -0.1, 0.9}, {1.9, 0.1, 1.1}}}};
  Frame frame = world.frame(0, kinect(160, 120), eye());
  frame.joint_positions = Eigen::Vector3d(1.9, 0.0, 1.0);
  const MapUpdate update = map.integrate(frame);
  EXPECT_GT(update.counts.self, 50);
  EXPECT_EQ(update.counts.self + update.counts.out_of_range, update.counts.points);
  EXPECT_EQ(map.at(1.72, 0.02, 1.02), '?');
  EXPECT_EQ(map.at(1.52, 0.02, 1.02), '?');
  EXPECT_EQ(map.at(2.3, 0.6, 1.02), '.');
  EXPECT_EQ(map.at(3.02, 0.8, 1.02), '?');
}

using WrongOption = testing_support::WrongOption<OctomapOptions>;

class WrongOctomapOptions : public ::testing::TestWithParam<WrongOption> {};

TEST_P(WrongOctomapOptions, FailNamingTheParameter) { expect_told(GetParam()); }

INSTANTIATE_TEST_SUITE_P(
    each, WrongOctomapOptions,
    ::testing::Values(WrongOption{"size_vox", [](OctomapOptions& o) { o.size_vox.x() = 40000; }},
                      WrongOption{"size_vox", [](OctomapOptions& o) { o.size_vox.fill(30000); }},
                      WrongOption{"origin_m[0]", [](OctomapOptions& o) { o.origin_m.x() = 0.02; }},
                      WrongOption{"prob_hit", [](OctomapOptions& o) { o.prob_hit = 0.5; }},
                      WrongOption{"prob_miss", [](OctomapOptions& o) { o.prob_miss = 0.6; }},
                      WrongOption{"clamp_min", [](OctomapOptions& o) { o.clamp_min = 0.98; }},
                      WrongOption{"clamp_min", [](OctomapOptions& o) { o.clamp_max = 1.0; }},
                      WrongOption{"occupied_at", [](OctomapOptions& o) { o.occupied_at = 0.1; }},
                      WrongOption{"max_range_m", [](OctomapOptions& o) { o.max_range_m = 0.0; }}));

}  // namespace
}  // namespace sidestep::octomap_mapper
