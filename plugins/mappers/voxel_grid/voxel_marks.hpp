#pragma once

#include <atomic>
#include <cstdint>
#include <vector>

#include <sidestep/core/index.hpp>
#include <sidestep/geometry/grid.hpp>

namespace sidestep::voxel_grid {

/// A set of voxels of one frame, filled by many threads at once: a bit a voxel, in rows as in
/// OccupancyView, and a flag for each block that holds any. What is in the set does not depend
/// on the order of insertion.
class VoxelMarks {
 public:
  explicit VoxelMarks(const GridSpec& spec)
      : ny_(static_cast<std::size_t>(spec.size_vox.y())),
        words_per_row_(static_cast<std::size_t>((spec.size_vox.x() + 63) / 64)),
        counts_(block_counts(spec)),
        words_(words_per_row_ * ny_ * static_cast<std::size_t>(spec.size_vox.z())),
        blocks_(static_cast<std::size_t>(counts_.prod())) {}

  void insert(int x, int y, int z) noexcept {
    const std::size_t row = static_cast<std::size_t>(y) + ny_ * static_cast<std::size_t>(z);
    std::atomic_ref<std::uint64_t> word(
        words_[row * words_per_row_ + static_cast<std::size_t>(x) / 64]);
    const std::uint64_t bit = std::uint64_t{1} << (static_cast<unsigned>(x) % 64u);
    // Most voxels are inserted many times: a plain read is cheaper than a locked write.
    if ((word.load(std::memory_order_relaxed) & bit) != 0) return;
    word.fetch_or(bit, std::memory_order_relaxed);
    const int block =
        block_linear({x / kBlockSide_vox, y / kBlockSide_vox, z / kBlockSide_vox}, counts_);
    std::atomic_ref<std::uint8_t> flag(blocks_[idx(block)]);
    if (flag.load(std::memory_order_relaxed) == 0) flag.store(1, std::memory_order_relaxed);
  }

  /// What follows is for the one thread that owns the row of blocks.
  [[nodiscard]] bool in_block(std::int32_t block) const noexcept {
    return blocks_[idx(block)] != 0;
  }
  /// The 16 voxels of one row of a block.
  [[nodiscard]] std::uint16_t row(std::size_t row, int block_x) const noexcept {
    const std::uint64_t word = words_[row * words_per_row_ + static_cast<std::size_t>(block_x) / 4];
    return static_cast<std::uint16_t>(word >> (static_cast<unsigned>(block_x) % 4u * 16u));
  }
  /// The 16 voxels of one row of a block, which leave the set.
  [[nodiscard]] std::uint16_t take_row(std::size_t row, int block_x) noexcept {
    std::uint64_t& word = words_[row * words_per_row_ + static_cast<std::size_t>(block_x) / 4];
    const unsigned shift = static_cast<unsigned>(block_x) % 4u * 16u;
    const auto bits = static_cast<std::uint16_t>(word >> shift);
    word &= ~(std::uint64_t{0xffff} << shift);
    return bits;
  }
  void leave_block(std::int32_t block) noexcept { blocks_[idx(block)] = 0; }

 private:
  std::size_t ny_;
  std::size_t words_per_row_;
  Eigen::Vector3i counts_;
  std::vector<std::uint64_t> words_;
  std::vector<std::uint8_t> blocks_;
};

}  // namespace sidestep::voxel_grid
