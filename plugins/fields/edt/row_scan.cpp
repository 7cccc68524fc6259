#include "row_scan.hpp"

#include <algorithm>
#include <bit>

#include <sidestep/core/lanes.hpp>

namespace sidestep::edt {
namespace {

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

/// Voxels [begin, end) between the obstacles `left` and `right` of a row: the square of the
/// distance to the nearer one, as far as the reach goes.
SIDESTEP_SIMD_CLONES
void fill_between(int left, int right, int begin, int end, std::uint16_t cap, int reach,
                  std::uint16_t* out) {
  for (int x = begin; x < end; ++x) {
    const int to_left = x - left;
    const int to_right = right - x;
    const int d = to_left < to_right ? to_left : to_right;
    out[x] = d <= reach ? static_cast<std::uint16_t>(d * d) : cap;
  }
}

}  // namespace

void scan_row(const std::uint64_t* words, int size, std::uint16_t cap, int reach,
              std::uint16_t* out) {
  int before = -1 - reach;  // the obstacle before; at first one beyond the reach
  for_each_run(words, size, [&](int begin, int end) {
    fill_between(before, begin, std::max(before + 1, 0), begin, cap, reach, out);
    std::fill(out + begin, out + end, std::uint16_t{0});
    before = end - 1;
  });
  fill_between(before, size + reach, std::max(before + 1, 0), size, cap, reach, out);
}

}  // namespace sidestep::edt
