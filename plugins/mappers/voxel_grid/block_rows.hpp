#pragma once

#include <algorithm>

#include "kernels.hpp"
#include "voxel_marks.hpp"

namespace sidestep::voxel_grid {

/// A block of the map as the kernels see it.
[[nodiscard]] inline BlockRows block_rows(LogOddsGrid& map, const Eigen::Vector3i& block) {
  const Eigen::Vector3i first = block * kBlockSide_vox;
  const Eigen::Vector3i inside =
      (map.spec().size_vox - first).cwiseMin(Eigen::Vector3i::Constant(kBlockSide_vox));
  const std::size_t words = static_cast<std::size_t>(map.words_per_row());
  const std::size_t word =
      map.row(first.y(), first.z()) * words + static_cast<std::size_t>(block.x()) / 4;
  BlockRows rows;
  rows.log_odds = map.block(block_linear(block, map.counts()));
  rows.occupied = map.occupied_words() + word;
  rows.known = map.known_words() + word;
  rows.y_stride = words;
  rows.z_stride = words * static_cast<std::size_t>(map.spec().size_vox.y());
  rows.shift = static_cast<unsigned>(block.x()) % 4U * 16U;
  rows.nx = inside.x();
  rows.ny = inside.y();
  rows.nz = inside.z();
  return rows;
}

/// The marked voxels of a block, row by row; they leave the set. Returns whether there are any.
inline bool take_marks(VoxelMarks& marks, const LogOddsGrid& map, const Eigen::Vector3i& block,
                       const BlockRows& rows, std::uint16_t (&bits)[kBlockRows]) {
  std::fill(bits, bits + kBlockRows, std::uint16_t{0});
  const std::int32_t linear = block_linear(block, map.counts());
  if (!marks.in_block(linear)) return false;
  for (int z = 0; z < rows.nz; ++z) {
    for (int y = 0; y < rows.ny; ++y) {
      const std::size_t row =
          map.row(block.y() * kBlockSide_vox + y, block.z() * kBlockSide_vox + z);
      bits[y + kLanes * z] = marks.take_row(row, block.x());
    }
  }
  marks.leave_block(linear);
  return true;
}

/// Records what a kernel did to a block that a frame of this stamp saw.
inline void note(LogOddsGrid& map, const Eigen::Vector3i& block, double stamp_s,
                 BlockOutcome outcome) {
  const std::int32_t linear = block_linear(block, map.counts());
  map.touched_s(linear) = stamp_s;
  if (outcome.changed) map.changed(linear) = 1;
  map.settled_free(linear) = outcome.settled_free ? 1 : 0;
}

}  // namespace sidestep::voxel_grid
