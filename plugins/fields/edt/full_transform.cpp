#ifndef SIDESTEP_KERNELS
#include "full_transform.hpp"

#include <algorithm>
#include <atomic>
#include <bit>
#include <cmath>
#include <utility>

#if defined(__SSE2__)
#include <xmmintrin.h>
#endif

namespace sidestep::edt {
namespace {

/// One tile of a row, aligned so that it lies in one line of the cache.
template <class Value>
struct alignas(64) TileOf {
  Value values[kTile];
};
using Tile = TileOf<std::uint32_t>;

/// Farther than any grid is wide; its square fits 32 bits.
constexpr int kFar = 1 << 15;

/// Bits that hold a row's number on a line.
int index_bits(int length) { return std::bit_width(static_cast<unsigned>(length - 1)); }

/// Rows that are computed together, from one reading of the list.
constexpr int kLeaf = 4;

/// The rows of a line, for kernels.
struct Rows {
  int bits;
  std::uint32_t cap;
  const Tile* keys;
  const int* positions;
  const std::uint32_t* squares;  ///< Of offset 0.
};

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

/// Rows [first, last] of a line, whose minima lie in rows [from, to] of the list.
struct Part {
  int first, last, from, to;
};

/// The numbers, in the list, of the rows that gave the minima of one row: the least and the
/// greatest over the lanes.
struct Numbers {
  int least, greatest;
};

}  // namespace
}  // namespace sidestep::edt

#define SIDESTEP_KERNELS "full_transform.cpp"
#include <sidestep/core/each_target.hpp>

namespace sidestep::edt {
namespace {

/// Computes a part into `out`, one tile a row.
void solve_part(const Rows& rows, const Part& part, Tile* out) {
  if (part.last - part.first < kLeaf) return SIDESTEP_DISPATCH(solve_leaf)(rows, part, out);
  const int middle = part.first + (part.last - part.first) / 2;
  const Numbers numbers = SIDESTEP_DISPATCH(solve_middle)(rows, middle, part.from, part.to, out);
  solve_part(rows, {part.first, middle - 1, part.from, numbers.greatest}, out);
  solve_part(rows, {middle + 1, part.last, numbers.least, part.to}, out);
}

/// A line of rows, one tile wide: those that matter to its envelope, in order. Rows are held as
/// keys, value << bits | number in this list, whose least is the least value's.
class LineKeys {
 public:
  /// Whether lines of at most `length` rows, with squared distances cut off at `cap`, fit the keys.
  [[nodiscard]] static bool fits(int length, std::uint32_t cap);

  LineKeys(int length, std::uint32_t cap);

  void clear() noexcept { count_ = 0; }
  [[nodiscard]] bool is_empty() const noexcept { return count_ == 0; }

  /// Appends, for the row at `position` of the line, the squared distances along x of the tile that
  /// begins at x of a row of occupancy bits that holds obstacles. Positions rise, and are less than
  /// the length.
  void append_scanned(const std::uint64_t* words, int words_per_row, int x, int position);
  /// Appends the rows at these positions that the pass before has left, `stride` tiles apart.
  void append_line(const Tile* tiles, std::ptrdiff_t stride, const std::vector<int>& positions);

  /// The lower envelope of the rows' parabolas at every position of the line, which is not empty:
  /// one tile each.
  void solve(Tile* out) const;

 private:
  int bits_;
  std::uint32_t cap_;
  std::vector<Tile> keys_;
  std::vector<int> positions_;  ///< Of each row on the line.
  /// Of offsets from -length on, in the place of a key's value.
  std::vector<std::uint32_t> squares_;
  int count_ = 0;
};

bool LineKeys::fits(int length, std::uint32_t cap) {
  const auto rows = static_cast<std::uint64_t>(length);
  return (cap + rows * rows) << index_bits(length) <= 0xffffffffu;
}

LineKeys::LineKeys(int length, std::uint32_t cap)
    : bits_(index_bits(length)),
      cap_(cap),
      keys_(static_cast<std::size_t>(length)),
      positions_(static_cast<std::size_t>(length)),
      squares_(2 * static_cast<std::size_t>(length) + kLeaf) {
  for (std::size_t i = 0; i < squares_.size(); ++i) {
    const int d = static_cast<int>(i) - length;
    squares_[i] = static_cast<std::uint32_t>(d * d) << bits_;
  }
}

void LineKeys::append_scanned(const std::uint64_t* words, int words_per_row, int x, int position) {
  const Neighbours next = neighbours(words, words_per_row, x);
  const auto obstacles = static_cast<std::uint16_t>(words[x / 64] >> (x % 64));
  const auto at = static_cast<std::size_t>(count_++);
  SIDESTEP_DISPATCH(scan_tile)
  (obstacles, {next.before - x, next.after - x}, cap_, bits_, static_cast<std::uint32_t>(at),
   keys_[at]);
  positions_[at] = position;
}

void LineKeys::append_line(const Tile* tiles, std::ptrdiff_t stride,
                           const std::vector<int>& positions) {
  SIDESTEP_DISPATCH(append_keys)
  (tiles, stride, positions, bits_, static_cast<std::uint32_t>(count_), keys_.data() + count_);
  std::ranges::copy(positions, positions_.begin() + count_);
  count_ += static_cast<int>(positions.size());
}

void LineKeys::solve(Tile* out) const {
  const int length = static_cast<int>(positions_.size());
  const Rows rows{bits_, cap_, keys_.data(), positions_.data(), squares_.data() + length};
  solve_part(rows, {0, length - 1, 0, count_ - 1}, out);
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
  return size_vox.maxCoeff() < kFar / 2 &&
         LineKeys::fits(std::max(size_vox.y(), size_vox.z()), cap);
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
    line.clear();
    for (int y = 0; y < size_.y(); ++y, ++row) {
      if (row_filled_[row] == 0) continue;
      line.append_scanned(
          obstacles.words.data() + row * static_cast<std::size_t>(obstacles.words_per_row),
          obstacles.words_per_row, x, y);
    }
    if (line.is_empty()) continue;
    space.slices.push_back(z);
    line.solve(space.squared.get() + z * space.slice_pitch);
  }
  const auto cap = static_cast<std::uint32_t>(metres_.size() - 1);
  for (int y = 0; y < size_.y(); ++y) {
    LineKeys& line = space.along_z;
    line.clear();
    line.append_line(space.squared.get() + y, space.slice_pitch, space.slices);
    if (line.is_empty()) {
      for (Tile& tile : space.column) std::ranges::fill(tile.values, cap);
    } else {
      line.solve(space.column.data());
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

#else

namespace {

using namespace edt;

/// The values of a tile.
using Values = Line<std::uint32_t, kParts>;
static_assert(Values::kCount == kTile);

SIDESTEP_INLINE Values& values(Tile& tile) noexcept {
  return *reinterpret_cast<Values*>(tile.values);
}
SIDESTEP_INLINE const Values& values(const Tile& tile) noexcept {
  return *reinterpret_cast<const Values*>(tile.values);
}

/// The key of squared distances along x in a tile with these obstacles and neighbours, which are
/// given from its first voxel on.
void scan_tile(std::uint16_t obstacles, const Neighbours& next, std::uint32_t cap, int bits,
               std::uint32_t number, Tile& key) {
  Values lane;
  count_lanes(lane);
  Values d = lesser(lane - static_cast<std::uint32_t>(next.before),
                    static_cast<std::uint32_t>(next.after) - lane);
  for (unsigned left = obstacles; left != 0; left &= left - 1) {
    const auto at = static_cast<std::uint32_t>(std::countr_zero(left));
    d = lesser(choose(lane > at, lane - at, at - lane), d);
  }
  values(key) = (lesser(d * d, Values{} + cap) << static_cast<std::uint32_t>(bits)) | number;
}

void append_keys(const Tile* tiles, std::ptrdiff_t stride, const std::vector<int>& positions,
                 int bits, std::uint32_t number, Tile* keys) {
  for (const int position : positions) {
    const Tile* tile = tiles + position * stride;
    __builtin_prefetch(tile + 1);  // the next line's
    values(*keys++) = (values(*tile) << static_cast<std::uint32_t>(bits)) | number++;
  }
}

SIDESTEP_INLINE void write_value(const Values& key, const Rows& rows, Tile& out) {
  values(out) = lesser(key >> static_cast<std::uint32_t>(rows.bits), Values{} + rows.cap);
}

using Half = VectorOf<std::uint32_t, 32>::Type;
using Quarter = VectorOf<std::uint32_t, 16>::Type;

/// A template, so that shuffles that do not fit are not compiled.
template <std::size_t kOf>
SIDESTEP_INLINE void halve(const Line<std::uint32_t, kOf>& of, Half& low, Half& high) {
  if constexpr (kOf == 1) {
    const auto& p = of.parts[0];
    low = __builtin_shufflevector(p, p, 0, 1, 2, 3, 4, 5, 6, 7);
    high = __builtin_shufflevector(p, p, 8, 9, 10, 11, 12, 13, 14, 15);
  } else {
    const auto* halves = reinterpret_cast<const Half*>(&of);
    low = halves[0];
    high = halves[1];
  }
}

/// The least and the greatest over the lanes.
SIDESTEP_INLINE Numbers extremes(const Values& of) {
  Half low, high;
  halve(of, low, high);
  const Half less = low < high ? low : high, more = low > high ? low : high;
  const Quarter a = __builtin_shufflevector(less, less, 0, 1, 2, 3),
                b = __builtin_shufflevector(less, less, 4, 5, 6, 7),
                c = __builtin_shufflevector(more, more, 0, 1, 2, 3),
                d = __builtin_shufflevector(more, more, 4, 5, 6, 7);
  const Quarter least = a < b ? a : b, greatest = c > d ? c : d;
  return {static_cast<int>(std::min({least[0], least[1], least[2], least[3]})),
          static_cast<int>(std::max({greatest[0], greatest[1], greatest[2], greatest[3]}))};
}

/// Computes the middle row of a part.
Numbers solve_middle(const Rows& rows, int row, int from, int to, Tile* out) {
  Values best = Values{} + ~std::uint32_t{0};
  for (int j = from; j <= to; ++j) {
    best = lesser(values(rows.keys[j]) + rows.squares[row - rows.positions[j]], best);
  }
  write_value(best, rows, out[row]);
  return extremes(best & ((std::uint32_t{1} << rows.bits) - 1));
}

/// Computes a part of at most kLeaf rows.
void solve_leaf(const Rows& rows, const Part& part, Tile* out) {
  Values best[kLeaf];
#pragma GCC unroll 4
  for (int i = 0; i < kLeaf; ++i) best[i] = Values{} + ~std::uint32_t{0};
  for (int j = part.from; j <= part.to; ++j) {
    const Values key = values(rows.keys[j]);
    const std::uint32_t* squares = rows.squares + (part.first - rows.positions[j]);
#pragma GCC unroll 4
    for (int i = 0; i < kLeaf; ++i) best[i] = lesser(key + squares[i], best[i]);
  }
  for (int i = 0; i <= part.last - part.first; ++i) {
    write_value(best[i], rows, out[part.first + i]);
  }
}

}  // namespace

#endif
