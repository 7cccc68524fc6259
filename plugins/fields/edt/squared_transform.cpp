#include "squared_transform.hpp"

#include <algorithm>
#include <bit>
#include <cmath>
#include <cstdlib>
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

/// The rows of a line, in one column of tiles, that hold anything below the cap: those next to
/// each row, so that the others cost nothing.
struct FilledRows {
  std::vector<int> next;      ///< [i]: the first filled row >= i; beyond any reach if none.
  std::vector<int> previous;  ///< [i]: the last filled row < i; beyond any reach if none.

  void find(const std::uint64_t* filled, std::size_t step, std::uint64_t bit, int length,
            int reach) {
    const auto is_filled = [&](int i) {
      return (filled[static_cast<std::size_t>(i) * step] & bit) != 0;
    };
    next.resize(static_cast<std::size_t>(length) + 1);
    previous.resize(static_cast<std::size_t>(length) + 1);
    int found = -reach - 1;
    for (int i = 0; i <= length; ++i) {
      previous[static_cast<std::size_t>(i)] = found;
      if (i < length && is_filled(i)) found = i;
    }
    found = length + reach;
    for (int i = length; i >= 0; --i) {
      if (i < length && is_filled(i)) found = i;
      next[static_cast<std::size_t>(i)] = found;
    }
  }
};

/// How many rows are taken in between two looks at whether farther ones can still matter.
constexpr int kLookEvery = 4;

/// One tile of a line: out = min over |d| <= reach of in[row + d] + d^2. `in` points at the
/// tile in row `row` of the line; `next` and `previous` are those of FilledRows. Goes outwards,
/// row by filled row, until the square of the offset exceeds every value so far.
template <class Value>
__attribute__((always_inline)) inline void envelope_tile(const Value* in, std::ptrdiff_t row_step,
                                                         const int* next, const int* previous,
                                                         int row, int reach, Value* out) {
  Value best[kTile];
  std::memcpy(best, in, sizeof(best));
  int above = next[row + 1];
  int below = previous[row];
  for (int taken = 0;; ++taken) {
    const bool upwards = above - row <= row - below;
    const int offset = upwards ? above - row : below - row;
    const int d = std::abs(offset);
    if (d > reach) break;
    const auto square = static_cast<Value>(d * d);
    if (taken % kLookEvery == 0) {
      Value largest = 0;
      for (int i = 0; i < kTile; ++i) largest = std::max(largest, best[i]);
      if (largest <= square) break;
    }
    const Value* g = in + offset * row_step;
    for (int i = 0; i < kTile; ++i) {
      best[i] = std::min(best[i], static_cast<Value>(g[i] + square));
    }
    if (upwards) {
      above = next[above + 1];
    } else {
      below = previous[below];
    }
  }
  std::memcpy(out, best, sizeof(best));
}

SIDESTEP_CLONES void envelope_kernel(const std::uint16_t* in, std::ptrdiff_t row_step,
                                     const int* next, const int* previous, int row, int reach,
                                     std::uint16_t* out) {
  envelope_tile(in, row_step, next, previous, row, reach, out);
}

SIDESTEP_CLONES void envelope_kernel(const std::uint32_t* in, std::ptrdiff_t row_step,
                                     const int* next, const int* previous, int row, int reach,
                                     std::uint32_t* out) {
  envelope_tile(in, row_step, next, previous, row, reach, out);
}

/// masks[i] becomes the union of masks[i - reach .. i + reach].
void widen(std::vector<std::uint64_t>& masks, int reach) {
  const std::size_t length = masks.size();
  const auto pad = std::min(static_cast<std::size_t>(reach), length);
  const std::size_t window = 2 * pad + 1;
  masks.insert(masks.begin(), pad, 0);
  masks.resize(length + 2 * pad, 0);
  // Unions of 1, 2, 4, ... masks from each on; two of them that overlap make the window.
  std::size_t span = 1;
  for (; 2 * span <= window; span *= 2) {
    for (std::size_t i = 0; i + span < masks.size(); ++i) masks[i] |= masks[i + span];
  }
  for (std::size_t i = 0; i < length; ++i) masks[i] |= masks[i + window - span];
  masks.resize(length);
}

/// Calls visit(begin, end) for each run of set bits among the first `size`, in order.
template <class Visit>
void for_each_run(const std::uint64_t* words, int size, Visit visit) {
  int begin = -1;  // of a run that reached the end of the word before
  for (int w = 0; w * 64 < size; ++w) {
    std::uint64_t word = words[w];
    int at = w * 64;
    int left = 64;
    while (left > 0) {
      const int step = std::min(left, begin < 0 ? std::countr_zero(word) : std::countr_one(word));
      word = step < 64 ? word >> step : 0;
      at += step;
      left -= step;
      if (left == 0) break;
      if (begin >= 0) visit(begin, at);
      begin = begin < 0 ? at : -1;
    }
  }
  if (begin >= 0) visit(begin, size);
}

/// Squared distance along x of every voxel of a row to the nearest obstacle in it. Bits beyond
/// the row's end are 0; so are the values.
template <class Value>
void scan_row(const std::uint64_t* words, int size, int pitch, Value cap, int reach, Value* out) {
  std::fill(out, out + size, cap);
  std::fill(out + size, out + pitch, Value{0});
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
  for_each_run(words, size, [&](int begin, int end) {
    fill_between(previous, begin);
    std::fill(out + begin, out + end, Value{0});
    previous = end - 1;
  });
  fill_between(previous, size + reach);
}

template <class Value>
bool holds_below(const Value* tile, int lanes, Value cap) {
  Value smallest = cap;
  for (int i = 0; i < lanes; ++i) smallest = std::min(smallest, tile[i]);
  return smallest < cap;
}

}  // namespace

template <class Value>
SquaredTransform<Value>::SquaredTransform(const Eigen::Vector3i& size_vox, std::uint32_t cap,
                                          Start start, WorkerPool& workers)
    : size_(size_vox),
      cap_(static_cast<Value>(cap)),
      reach_(static_cast<int>(std::ceil(std::sqrt(static_cast<double>(cap)))) - 1),
      tiles_((size_vox.x() + kTile - 1) / kTile),
      pitch_(tiles_ * kTile),
      // Slices a multiple of 4096 bytes apart would compete for the same few cache lines.
      slice_pitch_(static_cast<std::size_t>(size_vox.y()) * static_cast<std::size_t>(pitch_) +
                   kTile),
      workers_(workers) {
  const std::size_t rows =
      static_cast<std::size_t>(size_.y()) * static_cast<std::size_t>(size_.z());
  const bool none = start == Start::kNoObstacles;
  for (auto* grid : {&along_x_, &along_y_, &final_}) {
    grid->assign(static_cast<std::size_t>(size_.z()) * slice_pitch_, 0);
    for (int row = 0; none && row < static_cast<int>(rows); ++row) {
      std::fill_n(grid->data() + offset_of(row % size_.y(), row / size_.y()), size_.x(), cap_);
    }
  }
  for (Pass* pass : {&pass_x_, &pass_y_, &pass_z_}) {
    pass->changed.assign(rows, 0);
    pass->filled.assign(rows, none ? 0 : ~std::uint64_t{0});
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
      Value* old = along_x_.data() + offset_of(r % size_.y(), r / size_.y());
      for (int t = 0; t < tiles_; ++t) {
        store(fresh.data() + t * kTile, old + t * kTile, row, t, pass_x_);
      }
    }
  });
}

template <class Value>
void SquaredTransform<Value>::envelope(int y, int z, const Line& line, const std::vector<Value>& in,
                                       const Pass& in_pass, std::vector<Value>& out,
                                       Pass& out_pass) const {
  const std::size_t first_row = row_index(y, z);
  // A tile must be computed where the tile of some row within reach changed.
  std::vector<std::uint64_t> needed(static_cast<std::size_t>(line.length));
  std::uint64_t columns = 0;
  for (std::size_t i = 0; i < needed.size(); ++i) {
    needed[i] = in_pass.changed[first_row + i * line.row_step];
    out_pass.changed[first_row + i * line.row_step] = 0;
    columns |= needed[i];
  }
  if (columns == 0) return;
  widen(needed, reach_);
  FilledRows filled;
  for (; columns != 0; columns &= columns - 1) {
    const int tile = std::countr_zero(columns);
    filled.find(in_pass.filled.data() + first_row, line.row_step, std::uint64_t{1} << tile,
                line.length, reach_);
    const std::size_t first = offset_of(y, z) + static_cast<std::size_t>(tile * kTile);
    for (std::size_t i = 0; i < needed.size(); ++i) {
      if (((needed[i] >> tile) & 1u) == 0) continue;
      alignas(64) Value fresh[kTile];
      envelope_kernel(in.data() + first + i * line.step, static_cast<std::ptrdiff_t>(line.step),
                      filled.next.data(), filled.previous.data(), static_cast<int>(i), reach_,
                      fresh);
      store(fresh, out.data() + first + i * line.step, first_row + i * line.row_step, tile,
            out_pass);
    }
  }
}

template <class Value>
void SquaredTransform<Value>::store(const Value* fresh, Value* old, std::size_t row, int tile,
                                    Pass& pass) const {
  if (std::memcmp(fresh, old, sizeof(Value) * kTile) == 0) return;
  std::memcpy(old, fresh, sizeof(Value) * kTile);
  const std::uint64_t bit = std::uint64_t{1} << tile;
  pass.changed[row] |= bit;
  if (holds_below(fresh, lanes_of(tile), cap_)) {
    pass.filled[row] |= bit;
  } else {
    pass.filled[row] &= ~bit;
  }
}

template <class Value>
std::span<const std::uint64_t> SquaredTransform<Value>::update(
    const VoxelBits& obstacles, std::span<const std::uint8_t> row_changed) {
  const auto ny = static_cast<std::size_t>(size_.y());
  const Line along_y{size_.y(), 1, static_cast<std::size_t>(pitch_)};
  const Line along_z{size_.z(), ny, slice_pitch_};
  scan_rows(obstacles, row_changed);
  workers_.run_banded(size_.z(), 1, [&](int begin, int end) {
    for (int z = begin; z < end; ++z) {
      envelope(0, z, along_y, along_x_, pass_x_, along_y_, pass_y_);
    }
  });
  workers_.run_banded(size_.y(), 1, [&](int begin, int end) {
    for (int y = begin; y < end; ++y) {
      envelope(y, 0, along_z, along_y_, pass_y_, final_, pass_z_);
    }
  });
  return pass_z_.changed;
}

template class SquaredTransform<std::uint16_t>;
template class SquaredTransform<std::uint32_t>;

}  // namespace sidestep::edt
