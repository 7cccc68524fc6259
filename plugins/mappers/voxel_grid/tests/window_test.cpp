#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <memory>
#include <string>
#include <vector>

#include "conformance/test_host.hpp"
#include "support/box_world.hpp"
#include "voxel_grid.hpp"

namespace sidestep::voxel_grid {
namespace {

using conformance::TestHost;
using testing_support::BoxWorld;
using testing_support::kinect;
using testing_support::look_at;

/// A corridor along x with boxes in it.
BoxWorld corridor() {
  BoxWorld world{{{{-9, -9, -1}, {30, 9, 0}},  // floor
                  {{-9, 1.6, 0}, {30, 2, 3}},
                  {{-9, -2, 0}, {30, -1.6, 3}}}};
  for (int i = 0; i < 12; ++i) {
    const double x = 1.2 + 1.3 * i;
    const double y = i % 2 == 0 ? 0.7 : -1.3;
    world.boxes.push_back({{x, y, 0}, {x + 0.4, y + 0.5, 0.5 + 0.1 * i}});
  }
  return world;
}

/// 8 x 6 x 2 m around where the camera starts; all that it sees, up to 4 m away, lies within, also
/// when the grid is a block of 1 m behind.
VoxelGridOptions window_of(const std::string& method) {
  VoxelGridOptions options;
  options.resolution_m = 0.0625;  // so that positions are exact
  options.size_vox = {128, 96, 32};
  options.origin_m = {-2.0, -3.0, 0.0};
  options.max_range_m = 4.0;
  options.method = method;
  return options;
}

Transform eye(double x_m, double y_m) {
  return look_at({x_m, y_m, 1.0}, {x_m + 5.0, y_m - 0.3, 0.7});
}

class SlidingWindow : public ::testing::TestWithParam<std::string> {
 protected:
  SlidingWindow() {
    VoxelGridOptions options = window_of(GetParam());
    options.sliding_window = true;
    window_ = std::make_unique<VoxelGrid>(options, host_.context());
    options.sliding_window = false;
    options.size_vox.x() = 320;
    fixed_ = std::make_unique<VoxelGrid>(options, host_.context());
  }

  MapUpdate see(double x_m, double y_m) {
    const Frame frame = world_.frame(sequence_++, kinect(160, 120), eye(x_m, y_m));
    EXPECT_TRUE(fixed_->integrate(frame));
    auto update = window_->integrate(frame);
    EXPECT_TRUE(update);
    return update ? *update : MapUpdate{};
  }

  /// The voxel of the fixed grid at a voxel of the window.
  [[nodiscard]] Eigen::Vector3i in_fixed(const Eigen::Vector3i& voxel) const {
    return fixed_->grid().voxel_at(window_->grid().centre_m(voxel));
  }

  /// Compares all voxels of the window that `chosen` accepts; returns how many are known.
  template <class Chosen>
  std::int64_t expect_equal(Chosen chosen) const {
    const GridSpec& grid = window_->grid();
    std::int64_t known = 0;
    std::int64_t different = 0;
    for (int z = 0; z < grid.size_vox.z(); ++z) {
      for (int y = 0; y < grid.size_vox.y(); ++y) {
        for (int x = 0; x < grid.size_vox.x(); ++x) {
          const Eigen::Vector3i voxel(x, y, z);
          const Eigen::Vector3i other = in_fixed(voxel);
          if (!fixed_->grid().contains(other) || !chosen(voxel)) continue;
          const bool is_known = window_->known().at(grid, voxel);
          known += is_known;
          different +=
              is_known != fixed_->known().at(fixed_->grid(), other) ||
              window_->occupied().at(grid, voxel) != fixed_->occupied().at(fixed_->grid(), other) ||
              window_->log_odds(voxel) != fixed_->log_odds(other);
        }
      }
    }
    // The projective method finds a voxel's pixel from the block's corner on in single precision:
    // at most an error of 2^-22 of the image's width in u and v, either way, so that less than one
    // voxel in 2000 may be taken for the neighbouring pixel's.
    EXPECT_LE(different, GetParam() == "projective" ? known / 2000 : 0) << "of " << known;
    return known;
  }

  BoxWorld world_ = corridor();
  TestHost host_{2};
  std::unique_ptr<VoxelGrid> window_, fixed_;
  std::int64_t sequence_ = 0;
};

TEST_P(SlidingWindow, HoldsWhatAFixedGridHoldsThere) {
  int moves = 0;
  for (double x_m = 0.0; x_m <= 8.0; x_m += 0.25) {
    const Eigen::Vector3d before = window_->grid().origin_m;
    const MapUpdate update = see(x_m, 0.0);
    EXPECT_EQ(update.grid_moved, window_->grid().origin_m != before);
    EXPECT_LE(std::abs(window_->grid().origin_m.x() - (x_m - 2.0)), 1.0) << "a block";
    if (update.grid_moved) {
      ++moves;
      EXPECT_EQ(update.changed_blocks.size(),
                static_cast<std::size_t>(block_counts(window_->grid()).prod()));
    }
    EXPECT_GT(expect_equal([](const Eigen::Vector3i&) { return true; }), 1000);
    if (HasFailure()) return;
  }
  EXPECT_EQ(moves, 8);
  EXPECT_EQ(window_->grid().origin_m.y(), -3.0);
}

TEST_P(SlidingWindow, ForgetsWhatHasLeftIt) {
  for (double x_m = 0.0; x_m <= 6.0; x_m += 0.5) see(x_m, 0.0);
  const double rear_m = window_->grid().origin_m.x();
  ASSERT_GT(rear_m, 2.0);
  // Back in one step: what lay behind the grid and is not in view from here must be unknown.
  const MapUpdate update = see(3.0, 0.0);
  EXPECT_TRUE(update.grid_moved);
  const GridSpec& grid = window_->grid();
  std::int64_t was_known = 0;
  for (int n = 0; n < grid.size_vox.prod(); ++n) {
    const Eigen::Vector3i voxel(n % grid.size_vox.x(), n / grid.size_vox.x() % grid.size_vox.y(),
                                n / (grid.size_vox.x() * grid.size_vox.y()));
    const double x_m = grid.centre_m(voxel).x();
    if (x_m > rear_m || x_m > 2.9 || !fixed_->grid().contains(in_fixed(voxel))) continue;
    was_known += fixed_->known().at(fixed_->grid(), in_fixed(voxel));
    ASSERT_FALSE(window_->known().at(grid, voxel)) << x_m;
    ASSERT_FALSE(window_->occupied().at(grid, voxel)) << x_m;
    ASSERT_EQ(window_->log_odds(voxel), 0.0) << x_m;
  }
  EXPECT_GT(was_known, 500) << "there was something to forget";
  EXPECT_GT(expect_equal([&](const Eigen::Vector3i& voxel) {
              return grid.centre_m(voxel).x() > rear_m + 0.1;
            }),
            1000);
}

TEST_P(SlidingWindow, MovesInEveryDirectionAndAnyDistance) {
  see(0.0, 0.0);
  for (const auto& [x_m, y_m] : std::vector<std::pair<double, double>>{
           {5.2, 1.1}, {5.2, -1.2}, {1.7, 1.3}, {400.0, -300.0}, {0.4, 0.4}}) {
    see(x_m, y_m);
    const Eigen::Vector3d& origin_m = window_->grid().origin_m;
    EXPECT_LE(std::abs(origin_m.x() + 2.0 - x_m), 1.0);
    EXPECT_LE(std::abs(origin_m.y() + 3.0 - y_m), 1.0);
    EXPECT_EQ(origin_m.z(), 0.0);
  }
  VoxelGridOptions options = window_of(GetParam());
  options.origin_m = window_->grid().origin_m;
  VoxelGrid fresh(options, host_.context());
  // After the jumps nothing is left of what was seen before the last frame.
  ASSERT_TRUE(fresh.integrate(world_.frame(0, kinect(160, 120), eye(0.4, 0.4))));
  EXPECT_TRUE(std::ranges::equal(fresh.occupied().words, window_->occupied().words));
  EXPECT_TRUE(std::ranges::equal(fresh.known().words, window_->known().words));
}

INSTANTIATE_TEST_SUITE_P(methods, SlidingWindow, ::testing::Values("projective", "raycast"),
                         [](const auto& test) { return test.param; });

TEST(SlidingWindowOptions, WantWholeBlocks) {
  VoxelGridOptions options;
  options.sliding_window = true;
  EXPECT_TRUE(options.check().empty());
  options.size_vox.y() = 100;
  const auto mistakes = options.check();
  ASSERT_EQ(mistakes.size(), 1U);
  EXPECT_EQ(mistakes[0].parameters[0], "size_vox");
}

}  // namespace
}  // namespace sidestep::voxel_grid
