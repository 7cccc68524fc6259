#include "voxel_grid.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <memory>
#include <random>
#include <string>

#include "conformance/map_bits.hpp"
#include "support/ball_robot.hpp"
#include "support/mapper_probe.hpp"
#include "support/wrong_option.hpp"

namespace sidestep::voxel_grid {
namespace {

using testing_support::BallRobot;
using testing_support::BoxWorld;
using testing_support::eye;
using testing_support::kinect;
using testing_support::look_at;
using testing_support::wall_at;

constexpr double kResolution_m = 0.05;

using Probe = testing_support::MapperProbe<VoxelGrid>;

VoxelGridOptions options_of(const std::string& method) {
  auto options = testing_support::small_map_options<VoxelGridOptions>();
  options.method = method;
  return options;
}

/// Both paths give the same answer to everything here, on images.
class VoxelGridTest : public ::testing::TestWithParam<std::string> {};

TEST_P(VoxelGridTest, WallIsOneLayerAtItsDistance) {
  Probe map(options_of(GetParam()));
  map.see({{wall_at(3.02)}});
  for (const double y_m : {-0.7, 0.0, 0.9}) {
    EXPECT_EQ(map.at(3.02, y_m, 1.02), '#') << y_m;
    EXPECT_EQ(map.at(2.97, y_m, 1.02), '.') << y_m;
    EXPECT_EQ(map.at(1.5, y_m / 4, 1.02), '.') << y_m;
    EXPECT_EQ(map.at(3.07, y_m, 1.02), '?') << "behind the wall at y " << y_m;
  }
}

TEST_P(VoxelGridTest, RemovedWallIsGoneAfterTheFramesThatTheLogOddsImply) {
  VoxelGridOptions options = options_of(GetParam());
  options.l_max = 1.5;
  options.l_miss = -0.4;
  Probe map(options);
  for (int f = 0; f < 10; ++f) map.see({{wall_at(2.02)}});
  // 1.5 - 0.4 n < 0 from n = 4 on.
  for (int f = 1; f <= 3; ++f) {
    map.see({{wall_at(3.02)}});
    EXPECT_EQ(map.at(2.02, 0.0, 1.02), '#') << "after " << f;
  }
  const MapUpdate update = map.see({{wall_at(3.02)}});
  EXPECT_EQ(map.at(2.02, 0.0, 1.02), '.');
  EXPECT_FALSE(update.changed_blocks.empty());
  for (double y_m = -0.7; y_m < 0.7; y_m += kResolution_m) EXPECT_EQ(map.at(2.02, y_m, 1.02), '.');
}

TEST_P(VoxelGridTest, NewWallAppearsAfterTheFramesThatTheLogOddsImply) {
  VoxelGridOptions options = options_of(GetParam());
  options.l_min = -1.2;
  options.l_hit = 0.85;
  Probe map(options);
  for (int f = 0; f < 10; ++f) map.see({{wall_at(3.02)}});
  map.see({{wall_at(2.02)}});  // -1.2 + 0.85 < 0
  EXPECT_EQ(map.at(2.02, 0.0, 1.02), '.');
  map.see({{wall_at(2.02)}});
  EXPECT_EQ(map.at(2.02, 0.0, 1.02), '#');
}

TEST_P(VoxelGridTest, ThinPostIsKept) {
  Probe map(options_of(GetParam()));
  const BoxWorld world{{wall_at(3.02), {{1.52, 0.02, -9}, {1.53, 0.03, 9}}}};
  for (int f = 0; f < 5; ++f) map.see(world);
  for (double z_m = 0.6; z_m < 1.4; z_m += kResolution_m) EXPECT_EQ(map.at(1.525, 0.025, z_m), '#');
}

TEST_P(VoxelGridTest, FloorIsClearedNotInserted) {
  Probe map(options_of(GetParam()));
  // The floor, and a step of 4 cm on it that is an obstacle.
  const BoxWorld world{{{{-9, -9, -1}, {9, 9, 0.01}}, {{1.5, 0.3, 0}, {2.0, 0.8, 0.04}}}};
  const MapUpdate update = map.see(world, look_at({0.52, 0.02, 1.3}, {1.7, 0.1, 0.0}));
  EXPECT_GT(update.counts.floor, 1000);
  EXPECT_GT(update.counts.inserted, 100);
  EXPECT_EQ(map.at(1.7, -0.2, 0.02), '.') << "the layer above the floor";
  EXPECT_EQ(map.at(1.7, -0.2, 0.12), '.');
  EXPECT_EQ(map.at(1.7, 0.5, 0.035), '#') << "the step";
  for (double x_m = 1.2; x_m < 2.2; x_m += kResolution_m) EXPECT_NE(map.at(x_m, -0.2, 0.02), '#');
}

TEST_P(VoxelGridTest, RaysBeyondTheRangeClearUpToIt) {
  VoxelGridOptions options = options_of(GetParam());
  options.max_range_m = 2.0;
  Probe map(options);
  const MapUpdate update = map.see({{wall_at(3.02)}});
  EXPECT_EQ(update.counts.out_of_range, update.counts.points);
  EXPECT_EQ(update.counts.inserted, 0);
  EXPECT_EQ(map.at(0.52 + 1.9, 0.02, 1.02), '.');
  EXPECT_EQ(map.at(0.52 + 2.1, 0.02, 1.02), '?');
  EXPECT_EQ(map.at(3.02, 0.02, 1.02), '?');
}

TEST_P(VoxelGridTest, PointsBelowTheLeastRangeAreNoMeasurement) {
  VoxelGridOptions options = options_of(GetParam());
  options.min_range_m = 0.5;
  Probe map(options);
  const MapUpdate update = map.see({{wall_at(0.82)}});
  EXPECT_EQ(update.counts.points + update.counts.invalid, 160 * 120);
  EXPECT_EQ(map.at(0.82, 0.02, 1.02), '?');
  EXPECT_GT(update.counts.invalid, 0);
}

TEST_P(VoxelGridTest, PixelsWithoutReturnClearOnlyOnRequest) {
  Probe map(options_of(GetParam()));
  EXPECT_TRUE(map.see({}).changed_blocks.empty());
  EXPECT_EQ(map.at(2.0, 0.02, 1.02), '?');
  VoxelGridOptions options = options_of(GetParam());
  options.clear_no_return = true;
  options.max_range_m = 3.0;
  Probe clearing(options);
  EXPECT_EQ(clearing.see({}).counts.invalid, 160 * 120);
  EXPECT_EQ(clearing.at(3.4, 0.02, 1.02), '.');
  EXPECT_EQ(clearing.at(3.6, 0.02, 1.02), '?');
}

TEST_P(VoxelGridTest, KnownWrongPixelsNeverClear) {
  VoxelGridOptions options = options_of(GetParam());
  options.clear_no_return = true;
  Probe map(options);
  Frame frame = BoxWorld{}.frame(0, kinect(160, 120), eye());
  for (float& depth_m : std::get<DepthImage>(frame.measurement).depth_m) depth_m = std::nanf("");
  EXPECT_TRUE(map.integrate(frame).changed_blocks.empty());
}

TEST_P(VoxelGridTest, RobotsOwnPointsNeitherInsertNorClear) {
  Probe map(options_of(GetParam()), 2, std::make_shared<BallRobot>(0.3));
  // A box where the robot's ball is: its front face lies inside the inflated ball.
  const BoxWorld world{{wall_at(3.02), {{1.72, -0.1, 0.9}, {1.9, 0.1, 1.1}}}};
  Frame frame = world.frame(0, kinect(160, 120), eye());
  frame.joint_positions = Eigen::Vector3d(1.9, 0.0, 1.0);
  const MapUpdate update = map.integrate(frame);
  EXPECT_GT(update.counts.self, 50);
  EXPECT_EQ(map.at(1.72, 0.02, 1.02), '?');
  EXPECT_EQ(map.at(1.52, 0.02, 1.02), '?') << "the ray to the robot says nothing";
  EXPECT_EQ(map.at(3.02, 0.02, 1.02), '?') << "nor of what is behind it";
  EXPECT_EQ(map.at(3.02, 0.8, 1.02), '#');
  frame.joint_positions.reset();
  EXPECT_EQ(map.integrate(frame).counts.self, 0);
  EXPECT_EQ(map.at(1.72, 0.02, 1.02), '#') << "without joint positions it is an obstacle";
}

TEST_P(VoxelGridTest, RobotAroundTheCameraIsRemoved) {
  Probe map(options_of(GetParam()), 2, std::make_shared<BallRobot>(0.5));
  Frame frame = BoxWorld{{wall_at(0.82)}}.frame(0, kinect(160, 120), eye());
  frame.joint_positions = Eigen::Vector3d(0.52, 0.02, 1.02);
  const MapUpdate update = map.integrate(frame);
  EXPECT_EQ(update.counts.self, 160 * 120);
  EXPECT_TRUE(update.changed_blocks.empty());
}

TEST_P(VoxelGridTest, JointPositionsThatDoNotFitAreABadFrame) {
  Probe map(options_of(GetParam()), 2, std::make_shared<BallRobot>(0.3));
  Frame frame = BoxWorld{{wall_at(3.02)}}.frame(17, kinect(160, 120), eye());
  frame.joint_positions = Eigen::Vector2d(0.0, 0.0);
  const auto update = map.mapper().integrate(frame);
  ASSERT_FALSE(update);
  EXPECT_EQ(update.error().code, ErrorCode::kBadFrame);
  EXPECT_EQ(update.error().where, "frame 17");
  frame.joint_positions = Eigen::Vector3d(0.0, std::nan(""), 0.0);
  EXPECT_FALSE(map.mapper().integrate(frame));
  EXPECT_EQ(map.mapper().known().words[0], 0U);
}

TEST_P(VoxelGridTest, ChangedBlocksAreExactUnderRandomViews) {
  Probe map(options_of(GetParam()));
  std::mt19937 random(5);
  std::uniform_real_distribution<double> uniform(-1.0, 1.0);
  conformance::MapBits before = conformance::copy_bits(map.mapper());
  for (int f = 0; f < 40; ++f) {
    const Eigen::Vector3d box(2.0 + uniform(random), uniform(random), 0.9 + uniform(random));
    const BoxWorld world{{{{-9, -9, -1}, {9, 9, 0}},
                          {{4.52, -9, -9}, {9, 9, 9}},
                          {box, box + Eigen::Vector3d(0.4, 0.4, 0.4)}}};
    // Now and then from outside the grid, from beside it, or looking straight down.
    const Eigen::Vector3d eye(0.5 + uniform(random), 2.0 * uniform(random),
                              1.4 + uniform(random) * (f % 5 == 0 ? 3.0 : 0.3));
    const Eigen::Vector3d target =
        f % 7 == 0 ? Eigen::Vector3d(eye.x(), eye.y(), -5.0) : Eigen::Vector3d(2.5, 0.0, 0.8);
    const MapUpdate update = map.see(world, look_at(eye, target));
    conformance::MapBits after = conformance::copy_bits(map.mapper());
    ASSERT_EQ(update.changed_blocks, conformance::differing_blocks(map.grid(), before, after))
        << "frame " << f;
    before = std::move(after);
  }
}

TEST_P(VoxelGridTest, LogOddsStayWithinTheClamps) {
  Probe map(options_of(GetParam()));
  for (int f = 0; f < 20; ++f) map.see({{wall_at(3.02)}});
  const auto voxel = [&](double x_m) { return map.grid().voxel_at({x_m, 0.02, 1.02}); };
  EXPECT_DOUBLE_EQ(map.mapper().log_odds(voxel(3.02)), 1.5);
  EXPECT_DOUBLE_EQ(map.mapper().log_odds(voxel(1.5)), -1.2);
  EXPECT_DOUBLE_EQ(map.mapper().log_odds(voxel(3.2)), 0.0);
}

INSTANTIATE_TEST_SUITE_P(methods, VoxelGridTest, ::testing::Values("projective", "raycast"),
                         [](const auto& test) { return test.param; });

TEST(VoxelGridMethod, ProjectiveRefusesClouds) {
  conformance::TestHost host;
  VoxelGrid map(options_of("projective"), host.context());
  Frame frame;
  frame.sequence = 3;
  frame.measurement = PointCloud{{{0.0F, 0.0F, 1.0F}}};
  const auto update = map.integrate(frame);
  ASSERT_FALSE(update);
  EXPECT_EQ(update.error().code, ErrorCode::kUnsupported);
  EXPECT_EQ(update.error().where, "frame 3");
}

using WrongOption = testing_support::WrongOption<VoxelGridOptions>;

class WrongOptions : public ::testing::TestWithParam<WrongOption> {};

TEST_P(WrongOptions, FailNamingTheParameter) { expect_told(GetParam()); }

INSTANTIATE_TEST_SUITE_P(
    each, WrongOptions,
    ::testing::Values(
        WrongOption{"size_vox", [](VoxelGridOptions& o) { o.size_vox.fill(1 << 20); }},
        WrongOption{"occupied_at", [](VoxelGridOptions& o) { o.occupied_at = o.l_min; }},
        WrongOption{"occupied_at", [](VoxelGridOptions& o) { o.occupied_at = o.l_max + 0.1; }},
        WrongOption{"max_range_m", [](VoxelGridOptions& o) { o.max_range_m = o.min_range_m; }}));

TEST(VoxelGridOptionsTest, TooLargeAGridSaysHowMuchItNeeds) {
  VoxelGridOptions options;
  options.size_vox = {65536, 65536, 65536};
  const auto mistakes = options.check();
  ASSERT_EQ(mistakes.size(), 1U);
  EXPECT_NE(mistakes[0].what.find("MiB"), std::string::npos) << mistakes[0].what;
  EXPECT_NEAR(memory_mib(VoxelGridOptions{}), 320 * 320 * 128 * 2.625 / (1 << 20), 0.01);
}

}  // namespace
}  // namespace sidestep::voxel_grid
