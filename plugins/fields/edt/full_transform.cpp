#include "full_transform.hpp"

#include <algorithm>
#include <atomic>
#include <bit>
#include <cmath>

#if defined(__SSE2__)
#include <xmmintrin.h>
#endif

#include "lanes.hpp"

namespace sidestep::edt {
namespace {

/// Bits that hold a row's number on a line.
int index_bits(int length) { return std::bit_width(static_cast<unsigned>(length - 1)); }

/// Rows that are computed together, from one reading of the list.
constexpr int kLeaf = 4;

/// Farther than any grid is wide; its square fits 32 bits.
constexpr int kFar = 1 << 15;

/// One tile of a row, aligned so that it lies in one line of the cache.
template <class Value>
struct alignas(64) TileOf {
  Value values[kTile];
};
using Tile = TileOf<std::uint32_t>;

const Lanes32& lanes(const Tile& tile) { return *reinterpret_cast<const Lanes32*>(tile.values); }
Lanes32& lanes(Tile& tile) { return *reinterpret_cast<Lanes32*>(tile.values); }

/// A line of rows, one tile wide: those that matter to its envelope, in order. Rows are held as
/// keys, value << bits | number in this list, whose least is the least value's.
struct LineKeys {
  LineKeys(int length, std::uint32_t the_cap)
      : bits(index_bits(length)),
        cap(the_cap),
        keys(static_cast<std::size_t>(length)),
        positions(static_cast<std::size_t>(length)),
        squares(2 * static_cast<std::size_t>(length) + kLeaf) {
    for (std::size_t i = 0; i < squares.size(); ++i) {
      const int d = static_cast<int>(i) - length;
      squares[i] = static_cast<std::uint32_t>(d * d) << bits;
    }
  }

  /// Squares, in the place of a key's value, of this offset in [-length, length) and those after.
  [[nodiscard]] const std::uint32_t* squares_from(int offset) const noexcept {
    return squares.data() + (static_cast<std::ptrdiff_t>(positions.size()) + offset);
  }

  int bits;
  std::uint32_t cap;
  std::vector<Tile> keys;
  std::vector<int> positions;  ///< Of each row on the line.
  std::vector<std::uint32_t> squares;
  int count = 0;
};

SIDESTEP_INLINE void append(LineKeys& rows, int position, const Lanes32& values) {
  const auto at = static_cast<std::size_t>(rows.count++);
  lanes(rows.keys[at]) = (values << rows.bits) | static_cast<std::uint32_t>(at);
  rows.positions[at] = position;
}

/// The obstacles next to a tile of a row, on either side.
struct Neighbours {
  int before, after;
};

Neighbours neighbours(const std::uint64_t* words, int words_per_row, int x) {
  int w = x / 64;
  std::uint64_t below = words[w] & ((std::uint64_t{1} << (x % 64)) - 1);
  while (below == 0 && w > 0) below = words[--w];
  const int before = below == 0 ? -kFar : w * 64 + 63 - std::countl_zero(below);
  const int end = x + kTile;
  w = end / 64;
  std::uint64_t above = w < words_per_row ? words[w] >> (end % 64) << (end % 64) : 0;
  while (above == 0 && w + 1 < words_per_row) above = words[++w];
  return {before, above == 0 ? kFar : w * 64 + std::countr_zero(above)};
}

/// Appends the squared distances along x of a tile of a row that holds obstacles.
SIDESTEP_AVX512_CLONES
void append_scanned(const std::uint64_t* words, int words_per_row, int x, int position,
                    LineKeys& rows) {
  constexpr Lanes32 kLane = {0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11, 12, 13, 14, 15};
  const Neighbours next = neighbours(words, words_per_row, x);
  const Lanes32 to_before = kLane + static_cast<std::uint32_t>(x - next.before);
  const Lanes32 to_after = static_cast<std::uint32_t>(next.after - x) - kLane;
  Lanes32 d = to_before < to_after ? to_before : to_after;
  for (auto bits = static_cast<std::uint16_t>(words[x / 64] >> (x % 64)); bits != 0;
       bits = static_cast<std::uint16_t>(bits & (bits - 1))) {
    const auto at = static_cast<std::uint32_t>(std::countr_zero(bits));
    const Lanes32 offset = kLane > at ? kLane - at : at - kLane;
    d = offset < d ? offset : d;
  }
  const Lanes32 square = d * d;
  append(rows, position, square < rows.cap ? square : (Lanes32{} + rows.cap));
}

/// Appends rows that the pass before has left, `stride` tiles apart.
SIDESTEP_AVX512_CLONES
void append_line(const Tile* tiles, std::ptrdiff_t stride, const std::vector<int>& positions,
                 LineKeys& rows) {
  for (const int position : positions) {
    const Tile* tile = tiles + position * stride;
    __builtin_prefetch(tile + 1);  // the next line's
    append(rows, position, lanes(*tile));
  }
}

/// Rows [first, last] of a line, whose minima lie in rows [from, to] of the list.
struct Part {
  int first, last, from, to;
};

/// The numbers, in the list, of the rows that gave the minima of one row: the least and the
/// greatest over the lanes.
struct Numbers {
  int least, greatest;
};

/// Computes the middle row of a part.
SIDESTEP_AVX512_CLONES
Numbers solve_middle(const LineKeys& rows, int row, int from, int to, Tile* out) {
  Lanes32 best = ~Lanes32{};
  const Tile* keys = rows.keys.data() + from;
  const int* positions = rows.positions.data();
  for (int j = from; j <= to; ++j, ++keys) {
    const Lanes32 via = lanes(*keys) + *rows.squares_from(row - positions[j]);
    best = via < best ? via : best;
  }
  const Lanes32 value = best >> rows.bits;
  lanes(out[row]) = value < rows.cap ? value : (Lanes32{} + rows.cap);
  best &= (std::uint32_t{1} << rows.bits) - 1;
  // Halved until the extremes of all lanes stand in the first.
  Lanes32 least = best;
  Lanes32 greatest = best;
  Lanes32 other =
      __builtin_shufflevector(best, best, 8, 9, 10, 11, 12, 13, 14, 15, 0, 1, 2, 3, 4, 5, 6, 7);
  least = other < least ? other : least;
  greatest = other > greatest ? other : greatest;
  other =
      __builtin_shufflevector(least, least, 4, 5, 6, 7, 0, 1, 2, 3, 12, 13, 14, 15, 8, 9, 10, 11);
  least = other < least ? other : least;
  other = __builtin_shufflevector(greatest, greatest, 4, 5, 6, 7, 0, 1, 2, 3, 12, 13, 14, 15, 8, 9,
                                  10, 11);
  greatest = other > greatest ? other : greatest;
  other =
      __builtin_shufflevector(least, least, 2, 3, 0, 1, 6, 7, 4, 5, 10, 11, 8, 9, 14, 15, 12, 13);
  least = other < least ? other : least;
  other = __builtin_shufflevector(greatest, greatest, 2, 3, 0, 1, 6, 7, 4, 5, 10, 11, 8, 9, 14, 15,
                                  12, 13);
  greatest = other > greatest ? other : greatest;
  return {static_cast<int>(std::min(least[0], least[1])),
          static_cast<int>(std::max(greatest[0], greatest[1]))};
}

/// Computes a part of at most kLeaf rows.
SIDESTEP_AVX512_CLONES
void solve_leaf(const LineKeys& rows, const Part& part, Tile* out) {
  Lanes32 best[kLeaf] = {~Lanes32{}, ~Lanes32{}, ~Lanes32{}, ~Lanes32{}};
  const Tile* keys = rows.keys.data() + part.from;
  const int* positions = rows.positions.data();
  for (int j = part.from; j <= part.to; ++j, ++keys) {
    const Lanes32 key = lanes(*keys);
    const std::uint32_t* squares = rows.squares_from(part.first - positions[j]);
    for (int i = 0; i < kLeaf; ++i) {
      const Lanes32 via = key + squares[i];
      best[i] = via < best[i] ? via : best[i];
    }
  }
  for (int i = 0; i <= part.last - part.first; ++i) {
    const Lanes32 value = best[i] >> rows.bits;
    lanes(out[part.first + i]) = value < rows.cap ? value : (Lanes32{} + rows.cap);
  }
}

/// Writes what is not read again soon without reading the line of the cache before.
void write_past_cache(const TileOf<float>& tile, float* out) {
#if defined(__SSE2__)
  for (int i = 0; i < kTile; i += 4) _mm_stream_ps(out + i, _mm_load_ps(tile.values + i));
#else
  std::copy_n(tile.values, kTile, out);
#endif
}

/// Such writes become visible with what other threads see of this one from here on.
void finish_writing_past_cache() {
#if defined(__SSE2__)
  _mm_sfence();
#endif
}

/// Computes a part into `out`, one tile a row.
void solve(const LineKeys& rows, const Part& part, Tile* out) {
  if (part.last - part.first < kLeaf) return solve_leaf(rows, part, out);
  const int middle = part.first + (part.last - part.first) / 2;
  const Numbers numbers = solve_middle(rows, middle, part.from, part.to, out);
  solve(rows, {part.first, middle - 1, part.from, numbers.greatest}, out);
  solve(rows, {middle + 1, part.last, numbers.least, part.to}, out);
}

}  // namespace

/// What one thread needs.
struct FullTransform::Workspace {
  Workspace(const Eigen::Vector3i& size, std::uint32_t cap)
      : along_y(size.y(), cap),
        along_z(size.z(), cap),
        // Slices a multiple of 4096 bytes apart would compete for the same few cache lines.
        slice_pitch(size.y() + 1),
        squared(std::make_unique_for_overwrite<Tile[]>(static_cast<std::size_t>(slice_pitch) *
                                                       static_cast<std::size_t>(size.z()))),
        column(static_cast<std::size_t>(size.z())),
        column_m(static_cast<std::size_t>(size.z())) {}

  LineKeys along_y, along_z;
  std::ptrdiff_t slice_pitch;
  std::unique_ptr<Tile[]> squared;  ///< After the pass along y, one tile a row.
  std::vector<int> slices;          ///< Those of it in which there is any obstacle.
  std::vector<Tile> column;
  std::vector<TileOf<float>> column_m;
};

bool FullTransform::fits(const Eigen::Vector3i& size_vox, std::uint32_t cap) {
  const int longest = std::max(size_vox.y(), size_vox.z());
  const std::uint64_t largest = std::uint64_t{cap} + static_cast<std::uint64_t>(longest) *
                                                         static_cast<std::uint64_t>(longest);
  return size_vox.maxCoeff() < kFar / 2 && largest << index_bits(longest) <= 0xffffffffu;
}

FullTransform::FullTransform(const Eigen::Vector3i& size_vox, std::vector<float> metres,
                             WorkerPool& workers)
    : size_(size_vox),
      metres_(std::move(metres)),
      workers_(workers),
      row_filled_(static_cast<std::size_t>(size_vox.y()) * static_cast<std::size_t>(size_vox.z())),
      distances_m_(size_vox) {
  const auto cap = static_cast<std::uint32_t>(metres_.size() - 1);
  for (int i = 0; i < workers.thread_count(); ++i) {
    spaces_.push_back(std::make_unique<Workspace>(size_, cap));
  }
}

FullTransform::~FullTransform() = default;

void FullTransform::update(const VoxelBits& obstacles) {
  const auto words = static_cast<std::size_t>(obstacles.words_per_row);
  for (std::size_t row = 0; row < row_filled_.size(); ++row) {
    const auto bits = obstacles.words.subspan(row * words, words);
    row_filled_[row] = std::ranges::any_of(bits, [](std::uint64_t word) { return word != 0; });
  }
  const int tiles = (size_.x() + kTile - 1) / kTile;
  std::atomic<int> next{0};
  workers_.run(static_cast<int>(spaces_.size()), [&](int thread) {
    Workspace& space = *spaces_[static_cast<std::size_t>(thread)];
    for (int tile = next++; tile < tiles; tile = next++) {
      transform_tile(obstacles, tile * kTile, space);
    }
    finish_writing_past_cache();
  });
}

void FullTransform::transform_tile(const VoxelBits& obstacles, int x, Workspace& space) {
  space.slices.clear();
  std::size_t row = 0;
  for (int z = 0; z < size_.z(); ++z) {
    LineKeys& line = space.along_y;
    line.count = 0;
    for (int y = 0; y < size_.y(); ++y, ++row) {
      if (row_filled_[row] == 0) continue;
      append_scanned(
          obstacles.words.data() + row * static_cast<std::size_t>(obstacles.words_per_row),
          obstacles.words_per_row, x, y, line);
    }
    if (line.count == 0) continue;
    space.slices.push_back(z);
    solve(line, {0, size_.y() - 1, 0, line.count - 1}, space.squared.get() + z * space.slice_pitch);
  }
  const auto cap = static_cast<std::uint32_t>(metres_.size() - 1);
  for (int y = 0; y < size_.y(); ++y) {
    LineKeys& line = space.along_z;
    line.count = 0;
    append_line(space.squared.get() + y, space.slice_pitch, space.slices, line);
    if (line.count == 0) {
      for (Tile& tile : space.column) std::ranges::fill(tile.values, cap);
    } else {
      solve(line, {0, size_.z() - 1, 0, line.count - 1}, space.column.data());
    }
    for (std::size_t i = 0; i < space.column.size(); ++i) {
      for (int lane = 0; lane < kTile; ++lane) {
        space.column_m[i].values[lane] = metres_[space.column[i].values[lane]];
      }
    }
    for (int z = 0; z < size_.z(); ++z) {
      write_past_cache(space.column_m[static_cast<std::size_t>(z)], distances_m_.row(y, z) + x);
    }
  }
}

}  // namespace sidestep::edt
