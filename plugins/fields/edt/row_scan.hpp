#pragma once

#include <algorithm>
#include <bit>
#include <cstdint>

namespace sidestep::edt {

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

/// Squared distance of every voxel of a row to the nearest obstacle in it; `cap` where there is
/// none within `reach`, the largest offset whose square is below the cap. Bit i of `words` is voxel
/// i of `size`.
template <class Value>
void scan_row(const std::uint64_t* words, int size, Value cap, int reach, Value* out) {
  std::fill(out, out + size, cap);
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

}  // namespace sidestep::edt
