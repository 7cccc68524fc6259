#include "voxel_fader.hpp"

#include <cmath>

#include "block_rows.hpp"

namespace sidestep::voxel_grid {
namespace {

constexpr int kTurns = 16;
/// Voxels are scaled this often in a half-life, so that integers hold the steps.
constexpr double kStepsPerHalfLife = 8.0;
/// A probability between 0.475 and 0.525 says nothing.
constexpr double kForgetBelow = 0.1;

}  // namespace

VoxelFader::VoxelFader(double half_life_s, LogOddsGrid& map, WorkerPool& workers)
    : half_life_s_(half_life_s), map_(map), workers_(workers) {}

void VoxelFader::fade(Stamp now) {
  const double now_s = now.seconds();
  const int turn = turn_;
  turn_ = (turn_ + 1) % kTurns;
  const Eigen::Vector3i counts = map_.counts();
  // Rows of blocks along x: no two share a word of the occupied or known bits.
  workers_.run(counts.y() * counts.z(), [&](int row) {
    if (row % kTurns != turn) return;
    Eigen::Vector3i block(0, row % counts.y(), row / counts.y());
    for (block.x() = 0; block.x() < counts.x(); ++block.x()) {
      const std::int32_t linear = block_linear(block, counts);
      const double unseen_s = now_s - map_.touched_s(linear);
      if (unseen_s * kStepsPerHalfLife < half_life_s_) continue;
      map_.touched_s(linear) = now_s;
      const Fading fading{
          static_cast<std::int32_t>(std::exp2(-unseen_s / half_life_s_) * (1 << 15)),
          static_cast<std::int16_t>(kForgetBelow * LogOdds::kUnits)};
      note(map_, block, now_s,
           sidestep::voxel_grid::fade(map_.model(), block_rows(map_, block), fading));
    }
  });
}

}  // namespace sidestep::voxel_grid
