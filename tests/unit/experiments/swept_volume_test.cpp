#include <sidestep/measures/swept_volume.hpp>

#include <array>

#include <gtest/gtest.h>

#include "support/ball_robot.hpp"

namespace sidestep {
namespace {

/// A ball that covers the voxel of its centre and the six beside it moves on along a row, of whose
/// voxels a frame has seen six.
TEST(SweptVolume, CountsWhatIsEnteredOnceAndWhatOfItWasSeen) {
  const GridSpec grid{Eigen::Vector3d::Zero(), 0.1, {20, 5, 5}};
  const std::vector<std::uint64_t> words(25, 0b111111);
  const VoxelBits known{words, 1};
  SweptVolume swept(std::make_shared<testing_support::BallRobot>(0.12), grid, 0.2);
  for (int k = 0; k <= 6; ++k) swept.enter(std::array{0.25 + 0.1 * k, 0.25, 0.25}, known);
  // Each step one ahead and three beside: those below are too low.
  EXPECT_EQ(swept.entered_vox(), 24);
  EXPECT_EQ(swept.seen_vox(), 2 + 9);
  for (int k = 6; k >= 0; --k) swept.enter(std::array{0.25 + 0.1 * k, 0.25, 0.25}, known);
  swept.enter(std::array{-5.0, 0.25, 0.25}, known);
  EXPECT_EQ(swept.entered_vox(), 24);
}

}  // namespace
}  // namespace sidestep
