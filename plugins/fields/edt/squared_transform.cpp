#include "squared_transform.hpp"

#include <algorithm>
#include <bit>
#include <cmath>
#include <cstring>

// One kernel, compiled for the baseline and for AVX2, chosen when the library is loaded.
// Sanitizers intercept the resolver before they are ready, so they get the baseline.
#if defined(__x86_64__) && !defined(__SANITIZE_ADDRESS__) && !defined(__SANITIZE_THREAD__)
#define SIDESTEP_CLONES __attribute__((target_clones("avx2", "default")))
#else
#define SIDESTEP_CLONES
#endif

namespace sidestep::edt {
namespace {

/// How many offsets pass between two looks at whether larger ones can still matter.
constexpr int kLookEvery = 4;

/// One tile of a line: out = min over |d| <= reach of in[row + d] + d^2. `in` points at the
/// tile in row `row` of the line; `filled[i * stride] & bit` says whether the tile of row i holds
/// anything below the cap. Offsets go outwards until their square exceeds every value so far.
template <class Value>
__attribute__((always_inline)) inline void envelope_tile(const Value* in, std::size_t row_step,
                                                         const std::uint64_t* filled,
                                                         std::size_t filled_step, std::uint64_t bit,
                                                         int row, int length, int reach,
                                                         Value* out) {
  Value best[kTile];
  std::memcpy(best, in, sizeof(best));
  const int last = std::min(reach, std::max(row, length - 1 - row));
  for (int d = 1; d <= last; ++d) {
    const auto square = static_cast<Value>(d * d);
    if (d % kLookEvery == 1) {
      Value largest = 0;
      for (int i = 0; i < kTile; ++i) largest = std::max(largest, best[i]);
      if (largest <= square) break;
    }
    const auto offset = static_cast<std::size_t>(d);
    if (row >= d && (*(filled - offset * filled_step) & bit) != 0) {
      const Value* g = in - offset * row_step;
      for (int i = 0; i < kTile; ++i) {
        best[i] = std::min(best[i], static_cast<Value>(g[i] + square));
      }
    }
    if (row + d < length && (filled[offset * filled_step] & bit) != 0) {
      const Value* g = in + offset * row_step;
      for (int i = 0; i < kTile; ++i) {
        best[i] = std::min(best[i], static_cast<Value>(g[i] + square));
      }
    }
  }
  std::memcpy(out, best, sizeof(best));
}

SIDESTEP_CLONES void envelope_kernel(const std::uint16_t* in, std::size_t row_step,
                                     const std::uint64_t* filled, std::size_t filled_step,
                                     std::uint64_t bit, int row, int length, int reach,
                                     std::uint16_t* out) {
  envelope_tile(in, row_step, filled, filled_step, bit, row, length, reach, out);
}

SIDESTEP_CLONES void envelope_kernel(const std::uint32_t* in, std::size_t row_step,
                                     const std::uint64_t* filled, std::size_t filled_step,
                                     std::uint64_t bit, int row, int length, int reach,
                                     std::uint32_t* out) {
  envelope_tile(in, row_step, filled, filled_step, bit, row, length, reach, out);
}

/// Squared distance along x of every voxel of a row to the nearest obstacle in it.
template <class Value>
void scan_row(const std::uint64_t* words, int size, int pitch, Value cap, int reach, Value* out) {
  std::fill(out, out + pitch, cap);
  int previous = -1 - reach;  // the obstacle before; far enough to be beyond the reach
  const auto fill_between = [&](int left, int right) {
    // Voxels in (left, right): nearer to one of two obstacles, as far as the reach goes.
    for (int x = std::max(left + 1, 0); x <= std::min({left + reach, right - 1, size - 1}); ++x) {
      out[x] = static_cast<Value>((x - left) * (x - left));
    }
    for (int x = std::min(right - 1, size - 1); x >= std::max({right - reach, left + 1, 0}); --x) {
      out[x] = std::min(out[x], static_cast<Value>((right - x) * (right - x)));
    }
  };
  for (int w = 0; w * 64 < size; ++w) {
    for (std::uint64_t word = words[w]; word != 0; word &= word - 1) {
      const int x = w * 64 + std::countr_zero(word);
      if (x >= size) break;
      fill_between(previous, x);
      out[x] = 0;
      previous = x;
    }
  }
  fill_between(previous, size + reach);
}

template <class Value>
bool holds_below(const Value* tile, Value cap) {
  Value smallest = cap;
  for (int i = 0; i < kTile; ++i) smallest = std::min(smallest, tile[i]);
  return smallest < cap;
}

}  // namespace

template <class Value>
SquaredTransform<Value>::SquaredTransform(const Eigen::Vector3i& size_vox, std::uint32_t cap,
                                          WorkerPool& workers)
    : size_(size_vox),
      cap_(static_cast<Value>(cap)),
      reach_(static_cast<int>(std::ceil(std::sqrt(static_cast<double>(cap)))) - 1),
      tiles_((size_vox.x() + kTile - 1) / kTile),
      pitch_(tiles_ * kTile),
      workers_(workers) {
  const std::size_t rows =
      static_cast<std::size_t>(size_.y()) * static_cast<std::size_t>(size_.z());
  for (auto* grid : {&along_x_, &along_y_, &final_}) {
    grid->assign(rows * static_cast<std::size_t>(pitch_), cap_);
  }
  for (Pass* pass : {&pass_x_, &pass_y_, &pass_z_}) {
    pass->changed.assign(rows, 0);
    pass->filled.assign(rows, 0);
  }
}

template <class Value>
void SquaredTransform<Value>::scan_rows(const VoxelBits& obstacles,
                                        std::span<const std::uint8_t> row_changed) {
  const int rows = size_.y() * size_.z();
  workers_.run_banded(rows, 64, [&](int begin, int end) {
    std::vector<Value> fresh(static_cast<std::size_t>(pitch_));
    for (int r = begin; r < end; ++r) {
      const auto row = static_cast<std::size_t>(r);
      pass_x_.changed[row] = 0;
      if (row_changed[row] == 0) continue;
      scan_row(obstacles.words.data() + row * static_cast<std::size_t>(obstacles.words_per_row),
               size_.x(), pitch_, cap_, reach_, fresh.data());
      Value* old = along_x_.data() + row * static_cast<std::size_t>(pitch_);
      std::uint64_t filled = 0;
      for (int t = 0; t < tiles_; ++t) {
        const Value* tile = fresh.data() + t * kTile;
        if (std::memcmp(tile, old + t * kTile, sizeof(Value) * kTile) != 0) {
          pass_x_.changed[row] |= std::uint64_t{1} << t;
          std::memcpy(old + t * kTile, tile, sizeof(Value) * kTile);
        }
        if (holds_below(tile, cap_)) filled |= std::uint64_t{1} << t;
      }
      pass_x_.filled[row] = filled;
    }
  });
}

template <class Value>
template <class LineStart>
void SquaredTransform<Value>::envelope(const std::vector<Value>& in, const Pass& in_pass,
                                       std::vector<Value>& out, Pass& out_pass, int lines,
                                       int length, std::size_t stride, LineStart line_start) {
  const auto pitch = static_cast<std::size_t>(pitch_);
  workers_.run(lines, [&](int line) {
    const std::size_t start = line_start(line);
    const auto index = [&](int i) { return start + static_cast<std::size_t>(i) * stride; };

    // A tile must be computed where the tile of some row within reach changed: for each tile,
    // how many rows ahead the last change lies, as a sliding window over the line.
    std::vector<int> last_change(static_cast<std::size_t>(tiles_), -1 - length - reach_);
    std::vector<std::uint64_t> needed(static_cast<std::size_t>(length), 0);
    for (int direction : {1, -1}) {
      std::ranges::fill(last_change, -1 - length - reach_);
      for (int step = 0; step < length; ++step) {
        const int i = direction > 0 ? step : length - 1 - step;
        for (int t = 0; t < tiles_; ++t) {
          const std::uint64_t bit = std::uint64_t{1} << t;
          if ((in_pass.changed[index(i)] & bit) != 0) {
            last_change[static_cast<std::size_t>(t)] = step;
          }
          if (step - last_change[static_cast<std::size_t>(t)] <= reach_) {
            needed[static_cast<std::size_t>(i)] |= bit;
          }
        }
      }
    }

    alignas(64) Value fresh[kTile];
    for (int i = 0; i < length; ++i) {
      const std::size_t row = index(i);
      out_pass.changed[row] = 0;
      for (std::uint64_t mask = needed[static_cast<std::size_t>(i)]; mask != 0; mask &= mask - 1) {
        const int t = std::countr_zero(mask);
        const std::uint64_t bit = std::uint64_t{1} << t;
        const std::size_t at = row * pitch + static_cast<std::size_t>(t * kTile);
        envelope_kernel(in.data() + at, stride * pitch, in_pass.filled.data() + row, stride, bit, i,
                        length, reach_, fresh);
        if (std::memcmp(fresh, out.data() + at, sizeof(fresh)) == 0) continue;
        std::memcpy(out.data() + at, fresh, sizeof(fresh));
        out_pass.changed[row] |= bit;
        out_pass.filled[row] =
            holds_below(fresh, cap_) ? out_pass.filled[row] | bit : out_pass.filled[row] & ~bit;
      }
    }
  });
}

template <class Value>
std::span<const std::uint64_t> SquaredTransform<Value>::update(
    const VoxelBits& obstacles, std::span<const std::uint8_t> row_changed) {
  const auto ny = static_cast<std::size_t>(size_.y());
  scan_rows(obstacles, row_changed);
  envelope(along_x_, pass_x_, along_y_, pass_y_, size_.z(), size_.y(), 1,
           [ny](int z) { return static_cast<std::size_t>(z) * ny; });
  envelope(along_y_, pass_y_, final_, pass_z_, size_.y(), size_.z(), ny,
           [](int y) { return static_cast<std::size_t>(y); });
  return pass_z_.changed;
}

template class SquaredTransform<std::uint16_t>;
template class SquaredTransform<std::uint32_t>;

}  // namespace sidestep::edt
