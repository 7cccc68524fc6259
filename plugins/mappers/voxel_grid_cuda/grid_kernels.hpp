#pragma once

#include <cstddef>
#include <cstdint>

#include "cuda/kernel.hpp"
#include "cuda/occupancy_on_device.hpp"

/// The log-odds of a grid as kernels see them, and what one frame does to a row of them. The same
/// integers as in the mapper voxel_grid.
namespace sidestep::voxel_grid_cuda {

/// The inverse sensor model in fixed point: 1000 units are a log-odds of 1.
struct Model {
  std::int16_t hit = 0;
  std::int16_t miss = 0;
  std::int16_t min = 0;
  std::int16_t max = 0;
  std::int16_t occupied_at = 0;
};

/// The log-odds of a row of 16 voxels, in two parts that one access reads or writes.
struct alignas(16) HalfRow {
  std::int16_t values[cuda::kBlockSide / 2];
};

/// A set of voxels of one frame: rows of 16 bits in the order of occupancy_on_device.hpp, two to a
/// word, the lower one first, and a flag for each block that holds any.
struct Marks {
  std::uint32_t* words = nullptr;
  std::uint8_t* blocks = nullptr;

  SIDESTEP_HOST_DEVICE void insert(std::int32_t block, int x, int y, int z) const {
    constexpr int kSide = cuda::kBlockSide;
    const int row = y % kSide + kSide * (z % kSide);
    std::uint32_t& word = words[(std::ptrdiff_t{block} * cuda::kBlockRows + row) / 2];
    const std::uint32_t bit = 1u << (row % 2 * kSide + x % kSide);
    // Most voxels are inserted many times: a plain read is cheaper than a write that others wait
    // for.
    if ((word & bit) != 0) return;
    cuda::set_bits(word, bit);
    blocks[block] = 1;
  }
  [[nodiscard]] SIDESTEP_HOST_DEVICE std::uint32_t row(std::int64_t block, int row) const {
    const std::uint32_t word = words[(block * cuda::kBlockRows + row) / 2];
    return row % 2 == 0 ? word & 0xffffu : word >> cuda::kBlockSide;
  }
  /// Takes a row out with its neighbour; for rows of even number.
  SIDESTEP_HOST_DEVICE void clear_pair(std::int64_t block, int row) const {
    words[(block * cuda::kBlockRows + row) / 2] = 0;
  }
};

/// The grid on the device.
struct Grid {
  cuda::Extent size;
  cuda::Extent blocks;
  Model model;
  HalfRow* log_odds = nullptr;        ///< Two a row.
  std::uint16_t* occupied = nullptr;  ///< By row, as occupancy_on_device.hpp.
  std::uint16_t* known = nullptr;
  std::uint8_t* settled =
      nullptr;  ///< Blocks all of whose voxels are known and at the lower clamp.
  std::uint8_t* changed = nullptr;  ///< Blocks in which a bit of occupied or known changed.

  [[nodiscard]] SIDESTEP_HOST_DEVICE std::int32_t block_of(int x, int y, int z) const {
    constexpr int kSide = cuda::kBlockSide;
    return x / kSide + blocks.x * (y / kSide + blocks.y * (z / kSide));
  }
  [[nodiscard]] SIDESTEP_HOST_DEVICE cuda::Extent first_voxel(std::int64_t block) const {
    constexpr int kSide = cuda::kBlockSide;
    const int row = static_cast<int>(block / blocks.x);
    return {static_cast<int>(block % blocks.x) * kSide, row % blocks.y * kSide,
            row / blocks.y * kSide};
  }
  [[nodiscard]] SIDESTEP_HOST_DEVICE bool has_row(const cuda::Extent& first, int row) const {
    constexpr int kSide = cuda::kBlockSide;
    return first.y + row % kSide < size.y && first.z + row / kSide < size.z;
  }
};

/// What a frame adds to a row.
struct RowChange {
  std::int16_t delta[cuda::kBlockSide];
};
struct RowOutcome {
  bool changed;  ///< A bit of occupied or known.
  bool settled;  ///< What was touched is at the lower clamp.
};

/// Adds to a row, clamps, and brings its bits up to date; 0 leaves a voxel as it is, and voxels
/// beyond the grid stay untouched.
SIDESTEP_HOST_DEVICE inline RowOutcome add_row(const Grid& grid, std::int64_t block, int row,
                                               int columns, const RowChange& change) {
  constexpr int kHalf = cuda::kBlockSide / 2;
  const std::ptrdiff_t at = block * cuda::kBlockRows + row;
  std::uint32_t touched = 0;
  std::uint32_t high = 0;
  bool settled = true;
  for (int half = 0; half < 2; ++half) {
    HalfRow values = grid.log_odds[2 * at + half];
    for (int i = 0; i < kHalf; ++i) {
      const int x = half * kHalf + i;
      const int delta = x < columns ? change.delta[x] : 0;
      const int sum = values.values[i] + delta;
      const int clamped =
          cuda::least_of<int>(cuda::most_of<int>(sum, grid.model.min), grid.model.max);
      values.values[i] = static_cast<std::int16_t>(clamped);
      if (delta != 0) touched |= 1u << x;
      if (delta != 0 && clamped != grid.model.min) settled = false;
      if (clamped >= grid.model.occupied_at) high |= 1u << x;
    }
    grid.log_odds[2 * at + half] = values;
  }
  const std::uint32_t known_before = grid.known[at];
  const std::uint32_t occupied_before = grid.occupied[at];
  const std::uint32_t known = known_before | touched;
  const std::uint32_t occupied = known & high;
  grid.known[at] = static_cast<std::uint16_t>(known);
  grid.occupied[at] = static_cast<std::uint16_t>(occupied);
  return {known != known_before || occupied != occupied_before, settled};
}

/// The bits of blocks, one block after the other: rows of occupied, then rows of known.
struct PackBits {
  static constexpr int kThreads = cuda::kBlockRows;
  static constexpr int kPhases = 1;
  struct Shared {};

  const std::int32_t* blocks = nullptr;
  const std::uint16_t* occupied = nullptr;
  const std::uint16_t* known = nullptr;
  std::uint16_t* packed = nullptr;

  template <int kPhase>
  SIDESTEP_HOST_DEVICE void run(std::int64_t item, int row, Shared&) const {
    const std::ptrdiff_t from = std::ptrdiff_t{blocks[item]} * cuda::kBlockRows + row;
    std::uint16_t* to = packed + 2 * item * cuda::kBlockRows + row;
    to[0] = occupied[from];
    to[cuda::kBlockRows] = known[from];
  }
};

}  // namespace sidestep::voxel_grid_cuda
