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

/// The rows of one line, one tile wide, that matter to the envelope: not at the cap throughout.
/// Rows are held as keys, value << bits | number in this list, whose least is the least value's.
struct LineKeys {
  explicit LineKeys(int longest)
      : keys(static_cast<std::size_t>(longest) * kTile),
        positions(static_cast<std::size_t>(longest)) {}

  std::vector<std::uint32_t> keys;
  std::vector<int> positions;  ///< Of each row on the line.
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

const Lanes32& lanes(const std::uint32_t* half) { return *reinterpret_cast<const Lanes32*>(half); }
Lanes32& lanes(std::uint32_t* half) { return *reinterpret_cast<Lanes32*>(half); }

constexpr int kHalf = kTile / 2;

SIDESTEP_SIMD_CLONES
void gather(const Line& line, LineKeys& rows) {
  std::uint32_t count = 0;
  const std::uint32_t* values = line.values;
  for (int i = 0; i < line.length; ++i, values += line.stride) {
    const Lanes32 low = lanes(values);
    const Lanes32 high = lanes(values + kHalf);
    std::uint32_t* keys = rows.keys.data() + count * kTile;
    lanes(keys) = (low << line.bits) | count;
    lanes(keys + kHalf) = (high << line.bits) | count;
    rows.positions[count] = i;
    const auto below = (Lanes64)((low < line.cap) | (high < line.cap));
    count += (below[0] | below[1] | below[2] | below[3]) != 0 ? 1 : 0;
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

/// Computes one row of the line from rows [from, to] of the list.
SIDESTEP_SIMD_CLONES
Numbers minimise(const Line& line, const LineKeys& rows, int row, int from, int to) {
  Lanes32 best_low = ~Lanes32{};
  Lanes32 best_high = ~Lanes32{};
  const std::uint32_t* keys = rows.keys.data() + from * kTile;
  const int* positions = rows.positions.data();
  for (int j = from; j <= to; ++j, keys += kTile) {
    const int d = row - positions[j];
    const auto square = static_cast<std::uint32_t>(d * d) << line.bits;
    const Lanes32 via_low = lanes(keys) + square;
    const Lanes32 via_high = lanes(keys + kHalf) + square;
    best_low = via_low < best_low ? via_low : best_low;
    best_high = via_high < best_high ? via_high : best_high;
  }
  std::uint32_t* out = line.values + row * line.stride;
  const Lanes32 value_low = best_low >> line.bits;
  const Lanes32 value_high = best_high >> line.bits;
  lanes(out) = value_low < line.cap ? value_low : (Lanes32{} + line.cap);
  lanes(out + kHalf) = value_high < line.cap ? value_high : (Lanes32{} + line.cap);
  if (from == to) return {from, from};
  const std::uint32_t mask = (std::uint32_t{1} << line.bits) - 1;
  best_low &= mask;
  best_high &= mask;
  // Halved until the extremes of all lanes stand in the first.
  Lanes32 lesser = best_low < best_high ? best_low : best_high;
  Lanes32 greater = best_low < best_high ? best_high : best_low;
  Lanes32 other = __builtin_shufflevector(lesser, lesser, 4, 5, 6, 7, 0, 1, 2, 3);
  lesser = other < lesser ? other : lesser;
  other = __builtin_shufflevector(lesser, lesser, 2, 3, 0, 1, 6, 7, 4, 5);
  lesser = other < lesser ? other : lesser;
  other = __builtin_shufflevector(greater, greater, 4, 5, 6, 7, 0, 1, 2, 3);
  greater = other > greater ? other : greater;
  other = __builtin_shufflevector(greater, greater, 2, 3, 0, 1, 6, 7, 4, 5);
  greater = other > greater ? other : greater;
  return {static_cast<int>(std::min(lesser[0], lesser[1])),
          static_cast<int>(std::max(greater[0], greater[1]))};
}

void solve(const Line& line, const LineKeys& rows, const Part& part) {
  if (part.from == part.to) {
    for (int row = part.first; row <= part.last; ++row) {
      minimise(line, rows, row, part.from, part.to);
    }
    return;
  }
  const int middle = part.first + (part.last - part.first) / 2;
  const Numbers numbers = minimise(line, rows, middle, part.from, part.to);
  if (part.first < middle) {
    solve(line, rows, {part.first, middle - 1, part.from, numbers.greatest});
  }
  if (middle < part.last) solve(line, rows, {middle + 1, part.last, numbers.least, part.to});
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
    LineKeys rows(size_.y());
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
    LineKeys rows(size_.z());
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
