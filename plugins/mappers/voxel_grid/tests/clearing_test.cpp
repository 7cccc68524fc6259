#include <gtest/gtest.h>

#include "conformance/test_host.hpp"
#include "support/box_world.hpp"
#include "voxel_grid.hpp"

namespace sidestep::voxel_grid {
namespace {

using conformance::TestHost;
using testing_support::BoxWorld;
using testing_support::kinect;
using testing_support::look_at;

class Clearing : public ::testing::TestWithParam<double> {};

/// A camera that never moves sees only parts of the voxels at the image's border. What it has put
/// into them it must be able to take out again.
TEST_P(Clearing, LeavesNoGhostsAtTheBorderOfACameraThatStandsStill) {
  VoxelGridOptions options;
  options.resolution_m = GetParam();
  options.size_vox = (Eigen::Vector3d(4.8, 4.8, 2.4) / options.resolution_m).cast<int>();
  options.origin_m = {0.0, -2.4, -0.4};
  TestHost host;
  VoxelGrid map(options, host.context());
  // A wall that fills the image, oblique, so that its voxels lie at any offset to the border.
  const BoxWorld::Box near{{1.81, -9, -9}, {1.9, 9, 9}};
  const BoxWorld::Box far{{3.51, -9, -9}, {3.6, 9, 9}};
  const Transform eye = look_at({0.52, 0.02, 1.02}, {9.0, 2.3, 0.2});
  const auto occupied_nearer_than = [&](double x_m) {
    const GridSpec& grid = map.grid();
    int count = 0;
    for (int n = 0; n < grid.size_vox.prod(); ++n) {
      const Eigen::Vector3i voxel(n % grid.size_vox.x(), n / grid.size_vox.x() % grid.size_vox.y(),
                                  n / (grid.size_vox.x() * grid.size_vox.y()));
      count += grid.centre_m(voxel).x() < x_m && map.occupied().at(grid, voxel);
    }
    return count;
  };
  std::int64_t sequence = 0;
  const auto see = [&](const BoxWorld::Box& wall) {
    ASSERT_TRUE(map.integrate(BoxWorld{{wall}}.frame(sequence++, kinect(160, 120), eye)));
  };
  for (int f = 0; f < 10; ++f) see(near);
  ASSERT_GT(occupied_nearer_than(2.5), 100);
  // l_max 1.5 and l_miss -0.4: gone after four frames that see through.
  for (int f = 0; f < 4; ++f) see(far);
  EXPECT_EQ(occupied_nearer_than(2.5), 0);
}

INSTANTIATE_TEST_SUITE_P(resolutions, Clearing, ::testing::Values(0.025, 0.05, 0.1));

}  // namespace
}  // namespace sidestep::voxel_grid
