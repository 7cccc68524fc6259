#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <memory>

#include "conformance/test_host.hpp"
#include "support/box_world.hpp"
#include "voxel_grid.hpp"

namespace sidestep::voxel_grid {
namespace {

using conformance::TestHost;
using testing_support::BoxWorld;
using testing_support::kinect;
using testing_support::look_at;

constexpr double kHalfLife_s = 4.0;
constexpr double kRate_hz = 10.0;

/// A camera that looks at a wall 1.5 m ahead, then turns around for good.
class Fading : public ::testing::Test {
 protected:
  explicit Fading(double half_life_s = kHalfLife_s) {
    VoxelGridOptions options;
    options.resolution_m = 0.05;
    options.size_vox = {96, 96, 48};
    options.origin_m = {-2.4, -2.4, 0.0};
    options.fade_half_life_s = half_life_s;
    map_ = std::make_unique<VoxelGrid>(options, host_.context());
    for (int i = 0; i < 20; ++i) see(1.0);
  }

  MapUpdate see(double towards_x) {
    const BoxWorld world{{{{1.52, -9, -9}, {1.7, 9, 9}}, {{-1.7, -9, -9}, {-1.52, 9, 9}}}};
    Frame frame = world.frame(frames_, kinect(160, 120),
                              look_at({0.02, 0.02, 1.02}, {9.0 * towards_x, 0.02, 1.02}));
    frame.stamp = Stamp::from_seconds(100.0 + frames_ / kRate_hz);
    ++frames_;
    auto update = map_->integrate(frame);
    EXPECT_TRUE(update);
    return update ? *update : MapUpdate{};
  }
  [[nodiscard]] Eigen::Vector3i voxel(double x_m) const {
    return map_->grid().voxel_at({x_m, 0.02, 1.02});
  }
  [[nodiscard]] bool known(double x_m) const { return map_->known().at(map_->grid(), voxel(x_m)); }
  [[nodiscard]] bool occupied(double x_m) const {
    return map_->occupied().at(map_->grid(), voxel(x_m));
  }

  TestHost host_{2};
  std::unique_ptr<VoxelGrid> map_;
  int frames_ = 0;
};

TEST_F(Fading, HalvesTheLogOddsOfWhatIsNotSeen) {
  ASSERT_TRUE(occupied(1.52));
  const double wall = map_->log_odds(voxel(1.52));
  const double air = map_->log_odds(voxel(1.0));
  for (int i = 0; i < static_cast<int>(kHalfLife_s * kRate_hz); ++i) see(-1.0);
  // Scaled eight times a half-life, each block in every sixteenth frame: up to 2.1 s behind.
  const double behind = std::exp2(2.1 / kHalfLife_s);
  for (const auto& [x_m, before] : {std::pair{1.52, wall}, std::pair{1.0, air}}) {
    const double now = map_->log_odds(voxel(x_m)) / before;
    EXPECT_LE(now, 0.5 * behind) << x_m;
    EXPECT_GE(now, 0.49) << x_m;
  }
  EXPECT_TRUE(occupied(1.52)) << "fading alone makes nothing free";
  EXPECT_TRUE(known(1.0));
}

TEST_F(Fading, EndsInTheUnknown) {
  // log2(1.5 / 0.1) = 3.9 half-lives, and at most 2.1 s behind.
  int frames = 0;
  bool named = false;
  while (known(1.52) && frames < 400) {
    const MapUpdate update = see(-1.0);
    const Eigen::Vector3i counts = block_counts(map_->grid());
    const auto block = block_linear((voxel(1.52).array() / kBlockSide_vox).matrix(), counts);
    named = std::ranges::find(update.changed_blocks, block) != update.changed_blocks.end();
    ++frames;
  }
  EXPECT_TRUE(named) << "the frame that forgot it names its block";
  EXPECT_GE(frames, 3.9 * kHalfLife_s * kRate_hz - 1);
  EXPECT_LE(frames, (3.9 * kHalfLife_s + 2.1) * kRate_hz + 1);
  EXPECT_FALSE(occupied(1.52));
  EXPECT_EQ(map_->log_odds(voxel(1.52)), 0.0);
  EXPECT_TRUE(occupied(-1.52)) << "what is in view stays";
  EXPECT_NEAR(map_->log_odds(voxel(-1.0)), VoxelGridOptions{}.l_min, 1e-9);
}

class NoFading : public Fading {
 protected:
  NoFading() : Fading(0.0) {}
};

TEST_F(NoFading, RemembersForGood) {
  const double wall = map_->log_odds(voxel(1.52));
  for (int i = 0; i < 400; ++i) see(-1.0);
  EXPECT_EQ(map_->log_odds(voxel(1.52)), wall);
}

}  // namespace
}  // namespace sidestep::voxel_grid
