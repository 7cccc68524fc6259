#include "full_transform.hpp"

#include <algorithm>
#include <bit>
#include <cmath>
#include <cstring>
#include <vector>

#include "lanes.hpp"
#include "row_scan.hpp"

namespace sidestep::edt {
namespace {

/// Bits that hold a row's number on a line.
int index_bits(int length) { return std::bit_width(static_cast<unsigned>(length - 1)); }

/// Rows that are computed together, from one reading of the list.
constexpr int kLeaf = 4;

/// The rows of one line, one tile wide, that matter to the envelope: not at the cap throughout.
/// Rows are held as keys, value << bits | number in this list, whose least is the least value's.
struct LineKeys {
  LineKeys(int length, int bits)
      : keys(static_cast<std::size_t>(length) * kTile),
        positions(static_cast<std::size_t>(length)),
        squares(2 * static_cast<std::size_t>(length) + kLeaf) {
    // Beyond the length only rows of a leaf that there are not.
    for (std::size_t i = 0; i < squares.size(); ++i) {
      const int d = static_cast<int>(i) - length;
      squares[i] = static_cast<std::uint32_t>(d * d) << bits;
    }
  }

  /// The key of a square, by the offset in (-length, length + kLeaf).
  [[nodiscard]] const std::uint32_t* squares_from(int offset) const noexcept {
    return squares.data() + (static_cast<std::ptrdiff_t>(positions.size()) + offset);
  }

  std::vector<std::uint32_t> keys;
  std::vector<int> positions;  ///< Of each row on the line.
  std::vector<std::uint32_t> squares;
  int count = 0;
};

/// A line, one tile wide, in place.
struct Line {
  std::uint32_t* values;
  std::ptrdiff_t stride;
  int length;
  int bits;  ///< index_bits() of the length.
  std::uint32_t cap;
};

const Lanes32& lanes(const std::uint32_t* tile) { return *reinterpret_cast<const Lanes32*>(tile); }
Lanes32& lanes(std::uint32_t* tile) { return *reinterpret_cast<Lanes32*>(tile); }

SIDESTEP_WIDE_SIMD_CLONES
void gather(const Line& line, LineKeys& rows) {
  std::uint32_t count = 0;
  const std::uint32_t* values = line.values;
  for (int i = 0; i < line.length; ++i, values += line.stride) {
    const Lanes32 row = lanes(values);
    __builtin_prefetch(values + kTile);  // the next line's
    lanes(rows.keys.data() + count * kTile) = (row << line.bits) | count;
    rows.positions[count] = i;
    count += any(row < line.cap) ? 1 : 0;
  }
  rows.count = static_cast<int>(count);
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
SIDESTEP_WIDE_SIMD_CLONES
Numbers solve_middle(const Line& line, const LineKeys& rows, int row, int from, int to) {
  Lanes32 best = ~Lanes32{};
  const std::uint32_t* keys = rows.keys.data() + from * kTile;
  const int* positions = rows.positions.data();
  for (int j = from; j <= to; ++j, keys += kTile) {
    const Lanes32 via = lanes(keys) + *rows.squares_from(row - positions[j]);
    best = via < best ? via : best;
  }
  const Lanes32 value = best >> line.bits;
  lanes(line.values + row * line.stride) = value < line.cap ? value : (Lanes32{} + line.cap);
  best &= (std::uint32_t{1} << line.bits) - 1;
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
  return {static_cast<int>(std::min({least[0], least[1], least[2], least[3]})),
          static_cast<int>(std::max({greatest[0], greatest[1], greatest[2], greatest[3]}))};
}

/// Computes a part of at most kLeaf rows.
SIDESTEP_WIDE_SIMD_CLONES
void solve_leaf(const Line& line, const LineKeys& rows, const Part& part) {
  Lanes32 best[kLeaf] = {~Lanes32{}, ~Lanes32{}, ~Lanes32{}, ~Lanes32{}};
  const std::uint32_t* keys = rows.keys.data() + part.from * kTile;
  const int* positions = rows.positions.data();
  for (int j = part.from; j <= part.to; ++j, keys += kTile) {
    const Lanes32 key = lanes(keys);
    const std::uint32_t* squares = rows.squares_from(part.first - positions[j]);
    for (int i = 0; i < kLeaf; ++i) {
      const Lanes32 via = key + squares[i];
      best[i] = via < best[i] ? via : best[i];
    }
  }
  std::uint32_t* out = line.values + part.first * line.stride;
  for (int i = 0; i <= part.last - part.first; ++i, out += line.stride) {
    const Lanes32 value = best[i] >> line.bits;
    lanes(out) = value < line.cap ? value : (Lanes32{} + line.cap);
  }
}

void solve(const Line& line, const LineKeys& rows, const Part& part) {
  if (part.last - part.first < kLeaf) return solve_leaf(line, rows, part);
  const int middle = part.first + (part.last - part.first) / 2;
  const Numbers numbers = solve_middle(line, rows, middle, part.from, part.to);
  solve(line, rows, {part.first, middle - 1, part.from, numbers.greatest});
  solve(line, rows, {middle + 1, part.last, numbers.least, part.to});
}

void envelope(const Line& line, LineKeys& rows) {
  gather(line, rows);
  if (rows.count == 0) return;
  solve(line, rows, {0, line.length - 1, 0, rows.count - 1});
}

}  // namespace

bool FullTransform::fits(const Eigen::Vector3i& size_vox, std::uint32_t cap) {
  const int longest = std::max(size_vox.y(), size_vox.z());
  const std::uint64_t largest = std::uint64_t{cap} + static_cast<std::uint64_t>(longest) *
                                                         static_cast<std::uint64_t>(longest);
  return largest << index_bits(longest) <= 0xffffffffu;
}

FullTransform::FullTransform(const Eigen::Vector3i& size_vox, std::uint32_t cap,
                             WorkerPool& workers)
    : size_(size_vox), cap_(cap), workers_(workers), values_(size_vox) {}

void FullTransform::update(const VoxelBits& obstacles) {
  const int reach = static_cast<int>(std::ceil(std::sqrt(static_cast<double>(cap_)))) - 1;
  workers_.run_banded(size_.z(), 1, [&](int begin, int end) {
    LineKeys rows(size_.y(), index_bits(size_.y()));
    for (int z = begin; z < end; ++z) {
      for (int y = 0; y < size_.y(); ++y) {
        const auto row = static_cast<std::size_t>(y) +
                         static_cast<std::size_t>(size_.y()) * static_cast<std::size_t>(z);
        scan_row(obstacles.words.data() + row * static_cast<std::size_t>(obstacles.words_per_row),
                 static_cast<int>(values_.pitch()), cap_, reach, values_.row(y, z));
      }
      for (int x = 0; x < size_.x(); x += kTile) {
        envelope({values_.row(0, z) + x, values_.pitch(), size_.y(), index_bits(size_.y()), cap_},
                 rows);
      }
    }
  });
  workers_.run_banded(size_.y(), 1, [&](int begin, int end) {
    LineKeys rows(size_.z(), index_bits(size_.z()));
    for (int y = begin; y < end; ++y) {
      for (int x = 0; x < size_.x(); x += kTile) {
        envelope(
            {values_.row(y, 0) + x, values_.slice_pitch(), size_.z(), index_bits(size_.z()), cap_},
            rows);
      }
    }
  });
}

}  // namespace sidestep::edt
