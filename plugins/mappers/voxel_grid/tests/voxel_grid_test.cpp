#include "voxel_grid.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <memory>
#include <random>
#include <string>

#include "conformance/map_bits.hpp"
#include "support/ball_robot.hpp"
#include "support/box_world.hpp"
#include "support/test_host.hpp"

namespace sidestep::voxel_grid {
namespace {

using testing_support::BallRobot;
using testing_support::BoxWorld;
using testing_support::kinect;
using testing_support::look_at;
using testing_support::TestHost;

constexpr double kResolution_m = 0.05;

/// 4.8 x 4.8 x 2.4 m from (0, -2.4, -0.4) on, so that the floor lies between two layers.
VoxelGridOptions options_of(const std::string& method) {
  VoxelGridOptions options;
  options.resolution_m = kResolution_m;
  options.size_vox = {96, 96, 48};
  options.origin_m = {0.0, -2.4, -0.4};
  options.method = method;
  return options;
}

BoxWorld::Box wall_at(double x_m) { return {{x_m, -9, -9}, {x_m + 0.2, 9, 9}}; }

/// Looks along +x from 1 m above the floor.
const Transform kEye = look_at({0.52, 0.02, 1.02}, {9.0, 0.02, 1.02});

/// Both paths give the same answer to everything here, on images.
class VoxelGridTest : public ::testing::TestWithParam<std::string> {
 protected:
  void make(const VoxelGridOptions& options, std::shared_ptr<const RobotModel> robot = nullptr) {
    ASSERT_TRUE(options.check().empty());
    host_ = std::make_unique<TestHost>(2, std::move(robot));
    map_ = std::make_unique<VoxelGrid>(options, host_->context());
  }
  MapUpdate integrate(const Frame& frame) {
    auto update = map_->integrate(frame);
    if (!update) {
      ADD_FAILURE() << update.error().describe();
      return {};
    }
    return *update;
  }
  MapUpdate see(const BoxWorld& world, const Transform& pose = kEye) {
    return integrate(world.frame(sequence_++, kinect(160, 120), pose));
  }
  [[nodiscard]] char at(double x_m, double y_m, double z_m) const {
    const Eigen::Vector3i voxel = map_->grid().voxel_at({x_m, y_m, z_m});
    if (map_->occupied().at(map_->grid(), voxel)) return '#';
    return map_->known().at(map_->grid(), voxel) ? '.' : '?';
  }

  std::unique_ptr<TestHost> host_;
  std::unique_ptr<VoxelGrid> map_;
  std::int64_t sequence_ = 0;
};

TEST_P(VoxelGridTest, WallIsOneLayerAtItsDistance) {
  make(options_of(GetParam()));
  see({{wall_at(3.02)}});
  for (const double y_m : {-0.7, 0.0, 0.9}) {
    EXPECT_EQ(at(3.02, y_m, 1.02), '#') << y_m;
    EXPECT_EQ(at(2.97, y_m, 1.02), '.') << y_m;
    EXPECT_EQ(at(1.5, y_m / 4, 1.02), '.') << y_m;
    EXPECT_EQ(at(3.07, y_m, 1.02), '?') << "behind the wall at y " << y_m;
  }
}

TEST_P(VoxelGridTest, RemovedWallIsGoneAfterTheFramesThatTheLogOddsImply) {
  VoxelGridOptions options = options_of(GetParam());
  options.l_max = 1.5;
  options.l_miss = -0.4;
  make(options);
  for (int f = 0; f < 10; ++f) see({{wall_at(2.02)}});
  // 1.5 - 0.4 n < 0 from n = 4 on.
  for (int f = 1; f <= 3; ++f) {
    see({{wall_at(3.02)}});
    EXPECT_EQ(at(2.02, 0.0, 1.02), '#') << "after " << f;
  }
  const MapUpdate update = see({{wall_at(3.02)}});
  EXPECT_EQ(at(2.02, 0.0, 1.02), '.');
  EXPECT_FALSE(update.changed_blocks.empty());
  for (double y_m = -0.7; y_m < 0.7; y_m += kResolution_m) EXPECT_EQ(at(2.02, y_m, 1.02), '.');
}

TEST_P(VoxelGridTest, NewWallAppearsAfterTheFramesThatTheLogOddsImply) {
  VoxelGridOptions options = options_of(GetParam());
  options.l_min = -1.2;
  options.l_hit = 0.85;
  make(options);
  for (int f = 0; f < 10; ++f) see({{wall_at(3.02)}});
  see({{wall_at(2.02)}});  // -1.2 + 0.85 < 0
  EXPECT_EQ(at(2.02, 0.0, 1.02), '.');
  see({{wall_at(2.02)}});
  EXPECT_EQ(at(2.02, 0.0, 1.02), '#');
}

TEST_P(VoxelGridTest, ThinPostIsKept) {
  make(options_of(GetParam()));
  const BoxWorld world{{wall_at(3.02), {{1.52, 0.02, -9}, {1.53, 0.03, 9}}}};
  for (int f = 0; f < 5; ++f) see(world);
  for (double z_m = 0.6; z_m < 1.4; z_m += kResolution_m) EXPECT_EQ(at(1.525, 0.025, z_m), '#');
}

TEST_P(VoxelGridTest, FloorIsClearedNotInserted) {
  make(options_of(GetParam()));
  // The floor, and a step of 4 cm on it that is an obstacle.
  const BoxWorld world{{{{-9, -9, -1}, {9, 9, 0.01}}, {{1.5, 0.3, 0}, {2.0, 0.8, 0.04}}}};
  const MapUpdate update = see(world, look_at({0.52, 0.02, 1.3}, {1.7, 0.1, 0.0}));
  EXPECT_GT(update.counts.floor, 1000);
  EXPECT_GT(update.counts.inserted, 100);
  EXPECT_EQ(at(1.7, -0.2, 0.02), '.') << "the layer above the floor";
  EXPECT_EQ(at(1.7, -0.2, 0.12), '.');
  EXPECT_EQ(at(1.7, 0.5, 0.035), '#') << "the step";
  for (double x_m = 1.2; x_m < 2.2; x_m += kResolution_m) EXPECT_NE(at(x_m, -0.2, 0.02), '#');
}

TEST_P(VoxelGridTest, RaysBeyondTheRangeClearUpToIt) {
  VoxelGridOptions options = options_of(GetParam());
  options.max_range_m = 2.0;
  make(options);
  const MapUpdate update = see({{wall_at(3.02)}});
  EXPECT_EQ(update.counts.out_of_range, update.counts.points);
  EXPECT_EQ(update.counts.inserted, 0);
  EXPECT_EQ(at(0.52 + 1.9, 0.02, 1.02), '.');
  EXPECT_EQ(at(0.52 + 2.1, 0.02, 1.02), '?');
  EXPECT_EQ(at(3.02, 0.02, 1.02), '?');
}

TEST_P(VoxelGridTest, PointsBelowTheLeastRangeAreNoMeasurement) {
  VoxelGridOptions options = options_of(GetParam());
  options.min_range_m = 0.5;
  make(options);
  const MapUpdate update = see({{wall_at(0.82)}});
  EXPECT_EQ(update.counts.points + update.counts.invalid, 160 * 120);
  EXPECT_EQ(at(0.82, 0.02, 1.02), '?');
  EXPECT_GT(update.counts.invalid, 0);
}

TEST_P(VoxelGridTest, PixelsWithoutReturnClearOnlyOnRequest) {
  make(options_of(GetParam()));
  EXPECT_TRUE(see({}).changed_blocks.empty());
  EXPECT_EQ(at(2.0, 0.02, 1.02), '?');
  VoxelGridOptions options = options_of(GetParam());
  options.clear_no_return = true;
  options.max_range_m = 3.0;
  make(options);
  EXPECT_EQ(see({}).counts.invalid, 160 * 120);
  EXPECT_EQ(at(3.4, 0.02, 1.02), '.');
  EXPECT_EQ(at(3.6, 0.02, 1.02), '?');
}

TEST_P(VoxelGridTest, KnownWrongPixelsNeverClear) {
  VoxelGridOptions options = options_of(GetParam());
  options.clear_no_return = true;
  make(options);
  Frame frame = BoxWorld{}.frame(0, kinect(160, 120), kEye);
  for (float& depth_m : std::get<DepthImage>(frame.measurement).depth_m) depth_m = std::nanf("");
  EXPECT_TRUE(integrate(frame).changed_blocks.empty());
}

TEST_P(VoxelGridTest, RobotsOwnPointsNeitherInsertNorClear) {
  make(options_of(GetParam()), std::make_shared<BallRobot>(0.3));
  // A box where the robot's ball is: its front face lies inside the inflated ball.
  const BoxWorld world{{wall_at(3.02), {{1.72, -0.1, 0.9}, {1.9, 0.1, 1.1}}}};
  Frame frame = world.frame(0, kinect(160, 120), kEye);
  frame.joint_positions = Eigen::Vector3d(1.9, 0.0, 1.0);
  const MapUpdate update = integrate(frame);
  EXPECT_GT(update.counts.self, 50);
  EXPECT_EQ(at(1.72, 0.02, 1.02), '?');
  EXPECT_EQ(at(1.52, 0.02, 1.02), '?') << "the ray to the robot says nothing";
  EXPECT_EQ(at(3.02, 0.02, 1.02), '?') << "nor of what is behind it";
  EXPECT_EQ(at(3.02, 0.8, 1.02), '#');
  frame.joint_positions.reset();
  EXPECT_EQ(integrate(frame).counts.self, 0);
  EXPECT_EQ(at(1.72, 0.02, 1.02), '#') << "without joint positions it is an obstacle";
}

TEST_P(VoxelGridTest, RobotAroundTheCameraIsRemoved) {
  make(options_of(GetParam()), std::make_shared<BallRobot>(0.5));
  Frame frame = BoxWorld{{wall_at(0.82)}}.frame(0, kinect(160, 120), kEye);
  frame.joint_positions = Eigen::Vector3d(0.52, 0.02, 1.02);
  const MapUpdate update = integrate(frame);
  EXPECT_EQ(update.counts.self, 160 * 120);
  EXPECT_TRUE(update.changed_blocks.empty());
}

TEST_P(VoxelGridTest, JointPositionsThatDoNotFitAreABadFrame) {
  make(options_of(GetParam()), std::make_shared<BallRobot>(0.3));
  Frame frame = BoxWorld{{wall_at(3.02)}}.frame(17, kinect(160, 120), kEye);
  frame.joint_positions = Eigen::Vector2d(0.0, 0.0);
  const auto update = map_->integrate(frame);
  ASSERT_FALSE(update);
  EXPECT_EQ(update.error().code, ErrorCode::kBadFrame);
  EXPECT_EQ(update.error().where, "frame 17");
  frame.joint_positions = Eigen::Vector3d(0.0, std::nan(""), 0.0);
  EXPECT_FALSE(map_->integrate(frame));
  EXPECT_EQ(map_->known().words[0], 0U);
}

TEST_P(VoxelGridTest, ChangedBlocksAreExactUnderRandomViews) {
  make(options_of(GetParam()));
  std::mt19937 random(5);
  std::uniform_real_distribution<double> uniform(-1.0, 1.0);
  conformance::MapBits before = conformance::copy_bits(*map_);
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
    const MapUpdate update = see(world, look_at(eye, target));
    conformance::MapBits after = conformance::copy_bits(*map_);
    ASSERT_EQ(update.changed_blocks, conformance::differing_blocks(map_->grid(), before, after))
        << "frame " << f;
    before = std::move(after);
  }
}

TEST_P(VoxelGridTest, LogOddsStayWithinTheClamps) {
  make(options_of(GetParam()));
  for (int f = 0; f < 20; ++f) see({{wall_at(3.02)}});
  const auto voxel = [&](double x_m) { return map_->grid().voxel_at({x_m, 0.02, 1.02}); };
  EXPECT_DOUBLE_EQ(map_->log_odds(voxel(3.02)), 1.5);
  EXPECT_DOUBLE_EQ(map_->log_odds(voxel(1.5)), -1.2);
  EXPECT_DOUBLE_EQ(map_->log_odds(voxel(3.2)), 0.0);
}

INSTANTIATE_TEST_SUITE_P(methods, VoxelGridTest, ::testing::Values("projective", "raycast"),
                         [](const auto& test) { return test.param; });

TEST(VoxelGridMethod, ProjectiveRefusesClouds) {
  TestHost host;
  VoxelGrid map(options_of("projective"), host.context());
  Frame frame;
  frame.sequence = 3;
  frame.measurement = PointCloud{{{0.0F, 0.0F, 1.0F}}};
  const auto update = map.integrate(frame);
  ASSERT_FALSE(update);
  EXPECT_EQ(update.error().code, ErrorCode::kUnsupported);
  EXPECT_EQ(update.error().where, "frame 3");
}

struct WrongOption {
  std::string parameter;
  void (*spoil)(VoxelGridOptions&);
};

class WrongOptions : public ::testing::TestWithParam<WrongOption> {};

TEST_P(WrongOptions, FailNamingTheParameter) {
  VoxelGridOptions options;
  GetParam().spoil(options);
  const auto mistakes = options.check();
  ASSERT_EQ(mistakes.size(), 1U);
  EXPECT_EQ(mistakes[0].parameters.at(0), GetParam().parameter);
}

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
