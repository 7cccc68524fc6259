#pragma once

#include <cstddef>
#include <cstdint>

#include "cuda/kernel.hpp"
#include "cuda/occupancy_on_device.hpp"

/// The kernels of the exact transform. Values are squared distances in voxels, cut off at a cap:
/// positive to the nearest obstacle, and, where the field is signed, negative to the nearest free
/// voxel from within an obstacle. At any voxel one of the two transforms is zero, so that one value
/// holds both.
namespace sidestep::edt_cuda {

/// A grid as kernels see it: `pitch` values from row to row, rows of y next to each other.
struct Shape {
  cuda::Extent size;
  cuda::Extent blocks;
  std::ptrdiff_t pitch = 0;

  [[nodiscard]] SIDESTEP_HOST_DEVICE std::ptrdiff_t at(int x, int y, int z) const {
    return x + pitch * (y + static_cast<std::ptrdiff_t>(size.y) * z);
  }
  [[nodiscard]] SIDESTEP_HOST_DEVICE std::ptrdiff_t values() const {
    return pitch * size.y * size.z;
  }
  [[nodiscard]] SIDESTEP_HOST_DEVICE int block(int bx, int by, int bz) const {
    return bx + blocks.x * (by + blocks.y * bz);
  }
  /// The voxels of a row of block bx that lie in the grid.
  [[nodiscard]] SIDESTEP_HOST_DEVICE std::uint32_t inside(int bx) const {
    const int left = size.x - bx * cuda::kBlockSide;
    return left >= cuda::kBlockSide ? 0xffffu : (1u << left) - 1u;
  }
};

/// Rows along which a transform is brought up to date: columns tile * 32 ... of rows segment * 64
/// ... along an axis, for all 16 places of a slab of the other axis.
struct LinePart {
  int tile = 0;
  int segment = 0;
  int slab = 0;
};
inline constexpr int kSegment = 64;

/// Copies the obstacles of blocks: from rows of these blocks alone, one block after the other, or
/// from a map of them all.
struct TakeObstacles {
  static constexpr int kThreads = cuda::kBlockRows;
  static constexpr int kPhases = 1;
  struct Shared {};

  Shape shape;
  const std::int32_t* blocks = nullptr;
  const std::uint16_t* packed = nullptr;    ///< Or, where this is null,
  const std::uint16_t* occupied = nullptr;  ///< all occupied voxels
  const std::uint16_t* known = nullptr;     ///< and, if not null, all that are not known.
  std::uint16_t* obstacles = nullptr;

  template <int kPhase>
  SIDESTEP_HOST_DEVICE void run(std::int64_t item, int row, Shared&) const {
    const std::int32_t block = blocks[item];
    const std::ptrdiff_t to = std::ptrdiff_t{block} * cuda::kBlockRows + row;
    if (packed != nullptr) {
      obstacles[to] = packed[item * cuda::kBlockRows + row];
      return;
    }
    std::uint32_t bits = occupied[to];
    if (known != nullptr) bits |= ~std::uint32_t{known[to]};
    const int y = block / shape.blocks.x % shape.blocks.y * cuda::kBlockSide + row % 16;
    const int z = block / (shape.blocks.x * shape.blocks.y) * cuda::kBlockSide + row / 16;
    const bool is_inside = y < shape.size.y && z < shape.size.z;
    obstacles[to] =
        static_cast<std::uint16_t>(is_inside ? bits & shape.inside(block % shape.blocks.x) : 0u);
  }
};

/// The pass along x, for the rows of whole rows of blocks: a warp a row, a thread a column.
template <class Value>
struct ScanRows {
  static constexpr int kThreads = 256;
  static constexpr int kPhases = 1;
  static constexpr int kRowsPerBlock = kThreads / cuda::kWarp;
  static constexpr int kBlocksPerItem = cuda::kBlockRows / kRowsPerBlock;
  struct Shared {};

  Shape shape;
  const std::int32_t* items = nullptr;  ///< by + blocks.y * bz each.
  const std::uint16_t* obstacles = nullptr;
  Value* out = nullptr;
  int cap = 0;
  int reach = 0;  ///< Largest offset whose square is below the cap.
  bool is_signed = false;

  template <int kPhase>
  SIDESTEP_HOST_DEVICE void run(std::int64_t block, int thread, Shared&) const {
    const int item = items[block / kBlocksPerItem];
    const int by = item % shape.blocks.y;
    const int bz = item / shape.blocks.y;
    const int row = static_cast<int>(block % kBlocksPerItem) * kRowsPerBlock + thread / cuda::kWarp;
    const int y = by * cuda::kBlockSide + row % cuda::kBlockSide;
    const int z = bz * cuda::kBlockSide + row / cuda::kBlockSide;
    if (y >= shape.size.y || z >= shape.size.z) return;
    const std::uint16_t* rows =
        obstacles + std::ptrdiff_t{shape.block(0, by, bz)} * cuda::kBlockRows + row;
    for (int x = thread % cuda::kWarp; x < shape.size.x; x += cuda::kWarp) {
      out[shape.at(x, y, z)] = static_cast<Value>(value(rows, x));
    }
  }

 private:
  /// `rows` is this row in the first block along x.
  [[nodiscard]] SIDESTEP_HOST_DEVICE int value(const std::uint16_t* rows, int x) const {
    const int own = x / cuda::kBlockSide;
    const bool is_obstacle = ((bits_of(rows, own) >> (x % cuda::kBlockSide)) & 1u) != 0;
    if (is_obstacle && !is_signed) return 0;
    const int d = nearest(rows, x, is_obstacle);
    const int square = d > reach ? cap : cuda::least_of(d * d, cap);
    return is_obstacle ? -square : square;
  }

  [[nodiscard]] SIDESTEP_HOST_DEVICE std::uint32_t bits_of(const std::uint16_t* rows,
                                                           int bx) const {
    return rows[std::ptrdiff_t{bx} * cuda::kBlockRows];
  }
  /// What is searched for: obstacles, or what is free.
  [[nodiscard]] SIDESTEP_HOST_DEVICE std::uint32_t wanted(const std::uint16_t* rows, int bx,
                                                          bool is_free_wanted) const {
    const std::uint32_t bits = bits_of(rows, bx);
    return is_free_wanted ? ~bits & shape.inside(bx) : bits;
  }

  /// Distance to the nearest voxel that is wanted; more than the reach where there is none in it.
  [[nodiscard]] SIDESTEP_HOST_DEVICE int nearest(const std::uint16_t* rows, int x,
                                                 bool is_free_wanted) const {
    constexpr int kSide = cuda::kBlockSide;
    const int own = x / kSide;
    int least = reach + 1;
    for (int bx = own; bx >= 0; --bx) {
      std::uint32_t below = wanted(rows, bx, is_free_wanted);
      if (bx == own) below &= (1u << (x % kSide)) - 1u;
      if (below != 0) {
        least = cuda::least_of(least, x - (bx * kSide + cuda::highest_bit(below)));
        break;
      }
      if (x - bx * kSide >= least) break;
    }
    for (int bx = own; bx < shape.blocks.x; ++bx) {
      std::uint32_t above = wanted(rows, bx, is_free_wanted);
      if (bx == own) above = above >> (x % kSide) << (x % kSide);
      if (above != 0) {
        least = cuda::least_of(least, bx * kSide + cuda::lowest_bit(above) - x);
        break;
      }
      if ((bx + 1) * kSide - x > least) break;
    }
    return least;
  }
};

/// The pass along y or z: out[i] = min over j of in[j] + (i - j)^2.
///
/// The minimising j grows with i, so that those of two rows bound those of the rows between them
/// (monotone matrix search; Aggarwal et al. 1987): a block of threads computes every 64th row of
/// its 32 columns first, then every 8th, then the rest, each within the bounds that the rows before
/// give, and leaves off where the square of the offset alone is too much. Where a minimum has
/// several places, any of them is a bound.
///
/// A row's value is of one kind, to obstacles or to what is free; of the other kind the row itself
/// is the minimum, of value 0. So every row bounds the minima of both kinds.
template <class Value>
struct Envelope {
  static constexpr int kThreads = 256;
  static constexpr int kPhases = 4;
  static constexpr int kStep = 8;
  static constexpr int kAnchors = kSegment / kStep + 1;
  static constexpr int kKinds = 2;
  /// Of every kStep-th row, by kind, the first and the last row that gives a minimum of any column.
  struct Shared {
    int from[kKinds][kAnchors];
    int to[kKinds][kAnchors];
  };

  Shape shape;
  const LinePart* parts = nullptr;
  const Value* in = nullptr;
  Value* out = nullptr;
  std::uint8_t* changed = nullptr;  ///< By block, where values changed; null if nobody asks.
  int cap = 0;
  bool is_along_z = false;

  template <int kPhase>
  SIDESTEP_HOST_DEVICE void run(std::int64_t block, int thread, Shared& shared) const {
    const LinePart part = parts[block / cuda::kBlockSide];
    const int other = part.slab * cuda::kBlockSide + static_cast<int>(block % cuda::kBlockSide);
    if (other >= (is_along_z ? shape.size.y : shape.size.z)) return;
    const int column = part.tile * cuda::kWarp + thread % cuda::kWarp;
    const int warp = thread / cuda::kWarp;
    const Line line{column, other, part.segment * kSegment, length(), column < shape.size.x};
    if constexpr (kPhase == 0) {
      if (thread < kKinds * kAnchors) {
        shared.from[thread / kAnchors][thread % kAnchors] = length();
        shared.to[thread / kAnchors][thread % kAnchors] = 0;
      }
    } else if constexpr (kPhase == 1) {
      if (warp < 2) anchor(line, warp * (kAnchors - 1), 0, 0, shared);
    } else if constexpr (kPhase == 2) {
      if (warp > 0) anchor(line, warp, 0, kAnchors - 1, shared);
    } else {
      const int begin = line.first + warp * kStep;
      for (int row = begin + 1; row < cuda::least_of(begin + kStep, length()); ++row) {
        solve(line, row, warp, warp + 1, shared);
      }
    }
  }

 private:
  /// One of the columns along the axis, and the segment of it that is being computed.
  struct Line {
    int column, other, first, length;
    bool is_inside;
  };
  /// Where a row's minimum is, and of which kind.
  struct Found {
    int place, kind;
  };

  [[nodiscard]] SIDESTEP_HOST_DEVICE int length() const {
    return is_along_z ? shape.size.z : shape.size.y;
  }
  [[nodiscard]] SIDESTEP_HOST_DEVICE std::ptrdiff_t at(const Line& line, int row) const {
    return is_along_z ? shape.at(line.column, line.other, row)
                      : shape.at(line.column, row, line.other);
  }

  /// Computes anchor number `slot` of a segment, between two others, and the bounds that it gives.
  SIDESTEP_HOST_DEVICE void anchor(const Line& line, int slot, int below, int above,
                                   Shared& shared) const {
    const int row = line.first + slot * kStep;
    if (row >= line.length) return;
    const Found found = solve(line, row, below, above, shared);
    for (int kind = 0; kind < kKinds; ++kind) {
      const int place = found.kind == kind ? found.place : row;
      cuda::lower_to_warps(shared.from[kind][slot], line.is_inside ? place : line.length);
      cuda::raise_to_warps(shared.to[kind][slot], line.is_inside ? place : 0);
    }
  }

  /// Computes a row between anchors `below` and `above`, anywhere on the line where these are
  /// equal.
  SIDESTEP_HOST_DEVICE Found solve(const Line& line, int row, int below, int above,
                                   const Shared& shared) const {
    if (!line.is_inside) return {row, 0};
    const std::ptrdiff_t here = at(line, row);
    const int own = in[here];
    const int kind = own < 0 ? 1 : 0;
    Search search{in + here, is_along_z ? shape.pitch * shape.size.y : shape.pitch,
                  kind == 0 ? 1 : -1, kind == 0 ? own : -own, 0};
    if (below == above) {
      search.run(-row, line.length - 1 - row);
    } else {
      const bool has_above = line.first + above * kStep < line.length;
      search.run(shared.from[kind][below] - row,
                 (has_above ? shared.to[kind][above] : line.length - 1) - row);
    }
    store(line, row, here, static_cast<Value>(search.sign * cuda::least_of(search.best, cap)));
    return {row + search.offset, kind};
  }

  /// The search for a row's minimum, from the row itself outwards.
  struct Search {
    const Value* here;
    std::ptrdiff_t stride;
    int sign;    ///< Of the row's kind.
    int best;    ///< So far; the row's own value at first.
    int offset;  ///< Where.

    /// Searches the rows at offsets [from, to].
    SIDESTEP_HOST_DEVICE void run(int from, int to) {
      int d = cuda::most_of(1, cuda::most_of(from, -to));
      const int both = cuda::least_of(-from, to);
      for (; d <= both && d * d < best; ++d) {
        consider(-d, d * d);
        consider(d, d * d);
      }
      const bool is_below = -from > to;
      const int last = is_below ? -from : to;
      for (; d <= last && d * d < best; ++d) consider(is_below ? -d : d, d * d);
    }
    SIDESTEP_HOST_DEVICE void consider(int at, int square) {
      const int via = cuda::most_of(0, here[at * stride] * sign) + square;
      if (via < best) {
        best = via;
        offset = at;
      }
    }
  };

  SIDESTEP_HOST_DEVICE void store(const Line& line, int row, std::ptrdiff_t here,
                                  Value value) const {
    if (out[here] == value) return;
    out[here] = value;
    if (changed == nullptr) return;
    constexpr int kSide = cuda::kBlockSide;
    changed[is_along_z ? shape.block(line.column / kSide, line.other / kSide, row / kSide)
                       : shape.block(line.column / kSide, row / kSide, line.other / kSide)] = 1;
  }
};

/// Gathers blocks of values, one after the other, x fastest; 0 beyond the grid.
template <class Value>
struct PackBlocks {
  static constexpr int kThreads = cuda::kBlockRows;
  static constexpr int kPhases = 1;
  struct Shared {};

  Shape shape;
  const std::int32_t* blocks = nullptr;
  const Value* values = nullptr;
  Value* packed = nullptr;

  template <int kPhase>
  SIDESTEP_HOST_DEVICE void run(std::int64_t item, int row, Shared&) const {
    constexpr int kSide = cuda::kBlockSide;
    const std::int32_t block = blocks[item];
    const int x = block % shape.blocks.x * kSide;
    const int y = block / shape.blocks.x % shape.blocks.y * kSide + row % kSide;
    const int z = block / (shape.blocks.x * shape.blocks.y) * kSide + row / kSide;
    const bool is_inside = y < shape.size.y && z < shape.size.z;
    const Value* from = values + (is_inside ? shape.at(x, y, z) : 0);
    Value* to = packed + item * cuda::kBlockVoxels + row * kSide;
    for (int i = 0; i < kSide; ++i) {
      to[i] = is_inside && x + i < shape.size.x ? from[i] : Value{0};
    }
  }
};

}  // namespace sidestep::edt_cuda
