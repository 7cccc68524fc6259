#pragma once

#include <cstdint>
#include <memory>
#include <vector>

#include <sidestep/geometry/grid.hpp>
#include <sidestep/mapping/occupancy_view.hpp>

namespace sidestep::voxel_grid {

/// The inverse sensor model in fixed point: 1000 units are a log-odds of 1.
struct LogOdds {
  static constexpr double kUnits = 1000.0;
  static constexpr double kLargest = 16.0;  // so that any sum of two fits 16 bits

  std::int16_t hit = 0;
  std::int16_t miss = 0;
  std::int16_t min = 0;
  std::int16_t max = 0;
  std::int16_t occupied_at = 0;
};

/// Gives pages back to the system.
struct Unmap {
  std::size_t bytes = 0;
  void operator()(std::int16_t* memory) const noexcept;
};

/// Log-odds of every voxel, stored block by block (kBlockSide_vox^3 each, x fastest), and the
/// occupied and known bits in the layout of OccupancyView. Rows of blocks along x may be
/// changed by different threads at once: no two share a word.
///
/// The grid can be moved by whole blocks. Blocks lie in memory as in a ring along x and y
/// (Usenko et al. 2017): those that stay in the grid stay where they are.
class LogOddsGrid {
 public:
  static constexpr int kBlockVoxels = kBlockSide_vox * kBlockSide_vox * kBlockSide_vox;

  LogOddsGrid(const GridSpec& spec, LogOdds model);

  [[nodiscard]] const GridSpec& spec() const noexcept { return spec_; }
  [[nodiscard]] const LogOdds& model() const noexcept { return model_; }
  [[nodiscard]] const Eigen::Vector3i& counts() const noexcept { return counts_; }
  [[nodiscard]] int block_count() const noexcept { return counts_.prod(); }
  [[nodiscard]] int words_per_row() const noexcept { return words_per_row_; }
  [[nodiscard]] std::size_t row(int y, int z) const noexcept {
    return static_cast<std::size_t>(y) +
           static_cast<std::size_t>(spec_.size_vox.y()) * static_cast<std::size_t>(z);
  }

  [[nodiscard]] std::int16_t* block(std::int32_t linear) noexcept {
    return log_odds_.get() + slot(linear) * kBlockVoxels;
  }
  [[nodiscard]] double log_odds(const Eigen::Vector3i& voxel) const noexcept;

  [[nodiscard]] std::uint64_t* occupied_words() noexcept { return occupied_.data(); }
  [[nodiscard]] std::uint64_t* known_words() noexcept { return known_.data(); }
  [[nodiscard]] VoxelBits occupied() const noexcept { return {occupied_, words_per_row_}; }
  [[nodiscard]] VoxelBits known() const noexcept { return {known_, words_per_row_}; }

  /// Whether every voxel of a block is known and at the lower clamp, so that misses change
  /// nothing. Kept by whoever writes the block.
  [[nodiscard]] std::uint8_t& settled_free(std::int32_t linear) noexcept {
    return settled_free_[slot(linear)];
  }
  /// When a block was last seen or aged, in seconds of the frames' stamps; 0 at first.
  [[nodiscard]] double& touched_s(std::int32_t linear) noexcept { return touched_s_[slot(linear)]; }
  [[nodiscard]] std::uint8_t& changed(std::int32_t linear) noexcept {
    return changed_[static_cast<std::size_t>(linear)];
  }
  /// The blocks marked as changed, ascending; the marks are taken off.
  [[nodiscard]] std::vector<std::int32_t> take_changed_blocks();

  /// Moves the grid by whole blocks along x and y. What enters it is unknown, all is marked as
  /// changed. The grid is whole blocks wide along both.
  void move(const Eigen::Vector2i& blocks);

 private:
  /// Where a block lies in memory.
  [[nodiscard]] std::size_t slot(std::int32_t linear) const noexcept {
    return static_cast<std::size_t>(slots_[static_cast<std::size_t>(linear)]);
  }
  void find_slots();
  void forget(std::int32_t linear);
  [[nodiscard]] std::vector<std::uint64_t> moved(const std::vector<std::uint64_t>& words,
                                                 const Eigen::Vector2i& blocks) const;

  GridSpec spec_;
  LogOdds model_;
  Eigen::Vector3i counts_;
  int words_per_row_ = 0;
  Eigen::Vector2i ring_ = Eigen::Vector2i::Zero();  ///< Slot of block (0, 0, .) along x and y.
  std::vector<std::int32_t> slots_;                 ///< By block_linear.
  std::unique_ptr<std::int16_t[], Unmap> log_odds_;
  std::vector<std::uint64_t> occupied_;
  std::vector<std::uint64_t> known_;
  std::vector<std::uint8_t> settled_free_;  ///< By slot.
  std::vector<double> touched_s_;           ///< By slot.
  std::vector<std::uint8_t> changed_;
};

}  // namespace sidestep::voxel_grid
