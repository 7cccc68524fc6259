#pragma once

#include <atomic>
#include <cstdint>
#include <string>
#include <utility>
#include <vector>

#include <sidestep/core/index.hpp>
#include <sidestep/core/large_array.hpp>
#include <sidestep/geometry/grid.hpp>
#include <sidestep/mapping/occupancy_view.hpp>
#include <sidestep/plugin/map_options.hpp>
#include <sidestep/plugin/plugin.hpp>

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

struct VoxelGridOptions : MapOptions {
  double l_hit = 0.85;
  double l_miss = -0.4;
  double l_min = -1.2;
  double l_max = 1.5;
  double occupied_at = 0.0;
  double surface_band_vox = 0.5;
  std::string method = "auto";
  bool sliding_window = false;
  double fade_half_life_s = 0.0;

  static Parameters<VoxelGridOptions> parameters();
  [[nodiscard]] std::vector<OptionMistake> check() const;
};

/// Adds the inverse sensor model and the method. `O` is VoxelGridOptions or derives from it.
template <class O>
[[nodiscard]] Parameters<O> declare_sensor_model(Parameters<O> parameters) {
  using V = VoxelGridOptions;
  return std::move(parameters)
      .add("l_hit", &V::l_hit, "Log-odds that a hit adds, in steps of 0.001.",
           {.min = 0.001, .max = LogOdds::kLargest})
      .add("l_miss", &V::l_miss, "Log-odds that a ray passing through adds; negative.",
           {.min = -LogOdds::kLargest, .max = -0.001})
      .add("l_min", &V::l_min, "Lower clamp: with l_hit, frames until a new obstacle appears.",
           {.min = -LogOdds::kLargest, .max = -0.001})
      .add("l_max", &V::l_max, "Upper clamp: with l_miss, frames until a removed one is gone.",
           {.min = 0.001, .max = LogOdds::kLargest})
      .add("occupied_at", &V::occupied_at, "A voxel is occupied from these log-odds on.",
           {.min = -LogOdds::kLargest, .max = LogOdds::kLargest})
      .add("surface_band_vox", &V::surface_band_vox,
           "Projective method: half-width of the band around the measured depth that is hit.",
           {.unit = "vox", .min = 0.0, .max = 10.0})
      .add("method", &V::method,
           "How frames are integrated; auto: images projective, clouds raycast.",
           {.choices = {"auto", "projective", "raycast"}});
}

/// The log-odds of the options in fixed point.
[[nodiscard]] LogOdds log_odds_of(const VoxelGridOptions& options);

/// Memory that a map with these options takes once all of it has been seen.
[[nodiscard]] double memory_mib(const VoxelGridOptions& options);

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
  [[nodiscard]] std::uint8_t& saturated_free(std::int32_t linear) noexcept {
    return saturated_free_[slot(linear)];
  }
  /// When a block was last seen or aged, in seconds of the frames' stamps; 0 at first.
  [[nodiscard]] double& last_update_s(std::int32_t linear) noexcept {
    return last_update_s_[slot(linear)];
  }
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
  LargeArray<std::int16_t> log_odds_;
  std::vector<std::uint64_t> occupied_;
  std::vector<std::uint64_t> known_;
  std::vector<std::uint8_t> saturated_free_;  ///< By slot.
  std::vector<double> last_update_s_;         ///< By slot.
  std::vector<std::uint8_t> changed_;
};

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
