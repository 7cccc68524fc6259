#include "envelope_line.hpp"

#include <algorithm>
#include <cmath>
#include <cstring>

#include <sidestep/core/index.hpp>
#include <sidestep/core/lanes.hpp>

#define SIDESTEP_AVX2_CLONES SIDESTEP_CLONES_FOR("avx2", "default")

namespace sidestep::edt {
namespace {

/// The values of a tile of a row, on which operators work lane by lane; a comparison is all
/// ones where it holds. A vector extension of GCC and Clang: g++ 12 unrolls plain loops over 16
/// values before it could vectorise them, which takes five times as long. Pointers to them may
/// alias and need no alignment. Not to be passed by value: how that is done depends on the target.
using Lanes16 = std::uint16_t __attribute__((vector_size(32), aligned(2), may_alias));

/// Whether any lane of a comparison holds.
SIDESTEP_INLINE bool any(const Lanes16& comparison) {
  using Words = std::uint64_t __attribute__((vector_size(32)));
  const auto words = (Words)comparison;
  return (words[0] | words[1] | words[2] | words[3]) != 0;
}

constexpr std::size_t kTileBytes = kTile * sizeof(std::uint16_t);

/// An envelope computed anew costs about as much as this many rows of a change spread to them.
constexpr std::int64_t kSpreadsPerEnvelope = 12;

/// Beyond the reach of any cap.
constexpr int kFarthest = 1 << 16;

/// So many rows on either side of a change are asked whether they bound what it can change. Inside
/// obstacles and in free space, the first one does as a rule; where none of these does, to ask on
/// would cost as much as it could save.
constexpr int kAskedRows = 3;

/// Largest d >= 0 with d^2 < limit; -1 where there is none.
int largest_offset(int limit) {
  return limit <= 0 ? -1 : static_cast<int>(std::ceil(std::sqrt(static_cast<double>(limit)))) - 1;
}

const Lanes16& lanes(const std::uint16_t* tile) { return *reinterpret_cast<const Lanes16*>(tile); }
Lanes16& lanes(std::uint16_t* tile) { return *reinterpret_cast<Lanes16*>(tile); }

/// The least of the values, old or new, of the voxels that changed.
SIDESTEP_AVX2_CLONES
std::uint16_t least_changed(const std::uint16_t* was_tile, const std::uint16_t* is_tile) {
  const Lanes16 was = lanes(was_tile);
  const Lanes16 is = lanes(is_tile);
  const Lanes16 lower = (was < is ? was : is) | (Lanes16)(was == is);
  std::uint16_t least = lower[0];
  for (int i = 1; i < kTile; ++i) least = std::min(least, lower[i]);
  return least;
}

/// How many rows beyond `from`, towards `step` (1 or -1) and at most `most`, its change may change.
///
/// A row r whose own value is at most the changed one plus the square of their distance stands
/// nearer to all that lies beyond it, and is at most as high there: neither before nor after the
/// update does the envelope come from `from` alone at r or beyond. Each of the 16 voxels of a tile
/// has such a row of its own.
SIDESTEP_AVX2_CLONES
int extent(const TileLine& line, int from, int step, int most, const std::uint8_t* row_changed) {
  constexpr std::uint16_t kUnchanged = 32767;  // at least any cap
  const Lanes16 was = lanes(line.in_previous + from * line.in_previous_stride);
  const Lanes16 is = lanes(line.in + from * line.stride);
  const Lanes16 least = was < is ? was : is;
  const Lanes16 lower = was == is ? Lanes16{} + kUnchanged : least;
  Lanes16 open = ~Lanes16{};
  const int asked = std::min(most, kAskedRows);
  for (int d = 1; d <= asked; ++d) {
    const int row = from + step * d;
    const Lanes16 after = lanes(line.in + row * line.stride);
    const Lanes16 before =
        row_changed[row] != 0 ? lanes(line.in_previous + row * line.in_previous_stride) : after;
    const Lanes16 higher = before > after ? before : after;
    const Lanes16 via = lower + static_cast<std::uint16_t>(d * d);
    open = higher > via ? open : Lanes16{};
    if (!any(open)) return d - 1;
  }
  return most;
}

/// The envelope of one row, from the row outwards until the square of the offset exceeds every
/// value so far. `in` is row 0 of the line.
SIDESTEP_AVX2_CLONES
void envelope_of_row(const std::uint16_t* in, std::ptrdiff_t stride, int length, int row, int reach,
                     std::uint16_t* out) {
  const std::uint16_t* centre = in + row * stride;
  Lanes16 best = lanes(centre);
  for (int d = 1; d <= reach; ++d) {
    const auto square = static_cast<std::uint16_t>(d * d);
    if (!any((Lanes16)(best > square))) break;
    if (row >= d) {
      const Lanes16 via = lanes(centre - d * stride) + square;
      best = via < best ? via : best;
    }
    if (row + d < length) {
      const Lanes16 via = lanes(centre + d * stride) + square;
      best = via < best ? via : best;
    }
  }
  lanes(out) = best;
}

/// The same from those rows alone that hold anything below the cap: `before` and `after` give the
/// nearest on either side of each row.
SIDESTEP_AVX2_CLONES
void envelope_of_row_among(const std::uint16_t* in, std::ptrdiff_t stride, int row, int reach,
                           const int* before, const int* after, std::uint16_t* out) {
  Lanes16 best = lanes(in + row * stride);
  int low = before[row];
  int high = after[row];
  for (;;) {
    const bool is_low = row - low <= high - row;
    const int from = is_low ? low : high;
    const int d = is_low ? row - low : high - row;
    if (d > reach) break;
    const auto square = static_cast<std::uint16_t>(d * d);
    if (!any((Lanes16)(best > square))) break;
    const Lanes16 via = lanes(in + from * stride) + square;
    best = via < best ? via : best;
    (is_low ? low : high) = is_low ? before[from] : after[from];
  }
  lanes(out) = best;
}

/// Whether any voxel of a tile is below the cap.
SIDESTEP_AVX2_CLONES
bool is_below(const std::uint16_t* tile, std::uint16_t cap) {
  return any((Lanes16)(lanes(tile) < cap));
}

}  // namespace

struct EnvelopeLine::Spread {
  /// Spreads the change of row `from` of line.in to the rows [low, high] of line.out.
  SIDESTEP_AVX2_CLONES
  static void spread(const TileLine& line, int from, int low, int high, Fate* fates) {
    const Lanes16 was = lanes(line.in_previous + from * line.in_previous_stride);
    const Lanes16 is = lanes(line.in + from * line.stride);
    const auto risen = (Lanes16)(is > was);
    const std::ptrdiff_t stride = line.stride;
    std::uint16_t* out = line.out + low * stride;
    for (int row = low; row <= high; ++row, out += stride) {
      const auto square = static_cast<std::uint16_t>((row - from) * (row - from));
      const Lanes16 now = lanes(out);
      const Lanes16 via = is + square;
      const Lanes16 least = via < now ? via : now;
      const Lanes16 lost = (Lanes16)((was + square) == now) & risen;
      if (!any(lost | (now ^ least))) continue;
      if (fates[row] == Fate::kKept) {
        lanes(line.out_previous + row * kTile) = now;
        fates[row] = Fate::kLowered;
      }
      lanes(out) = least;
      if (any(lost)) fates[row] = Fate::kLost;
    }
  }
};

EnvelopeLine::EnvelopeLine(int longest, std::uint16_t cap)
    : cap_(cap),
      reach_(largest_offset(cap)),
      row_changed_(static_cast<std::size_t>(longest), 0),
      fates_(static_cast<std::size_t>(longest), Fate::kKept),
      before_(static_cast<std::size_t>(longest)),
      after_(static_cast<std::size_t>(longest)) {}

void EnvelopeLine::find_sources(const TileLine& line, std::span<const int> changed) {
  sources_.clear();
  first_ = line.length;
  last_ = -1;
  total_reach_ = 0;
  for (const int row : changed) row_changed_[idx(row)] = 1;
  for (const int row : changed) {
    const std::uint16_t least = least_changed(line.in_previous + row * line.in_previous_stride,
                                              line.in + row * line.stride);
    const int reach = largest_offset(cap_ - least);
    if (reach < 0) continue;
    const int before = extent(line, row, -1, std::min(reach, row), row_changed_.data());
    const int after =
        extent(line, row, 1, std::min(reach, line.length - 1 - row), row_changed_.data());
    sources_.push_back({row, row - before, row + after});
    first_ = std::min(first_, row - before);
    last_ = std::max(last_, row + after);
    total_reach_ += before + after + 1;
  }
  for (const int row : changed) row_changed_[idx(row)] = 0;
}

void EnvelopeLine::mark_all_lost(const TileLine& line) {
  for (const Source& source : sources_) {
    for (int row = source.low; row <= source.high; ++row) {
      Fate& fate = fates_[idx(row)];
      if (fate == Fate::kLost) continue;
      fate = Fate::kLost;
      std::memcpy(line.out_previous + row * kTile, line.out + row * line.stride, kTileBytes);
    }
  }
}

void EnvelopeLine::find_filled(const TileLine& line) {
  // Beyond every reach, and the offset to them no overflow.
  int before = -kFarthest;
  const int low = std::max(first_ - reach_, 0);
  const int high = std::min(last_ + reach_, line.length - 1);
  for (int row = low; row <= high; ++row) {
    before_[idx(row)] = before;
    after_[idx(row)] = kFarthest;
    if (!is_below(line.in + row * line.stride, cap_)) continue;
    for (int r = std::max(before, low); r < row; ++r) after_[idx(r)] = row;
    before = row;
  }
}

void EnvelopeLine::recompute(const TileLine& line, int row, bool knows_filled) const {
  std::uint16_t* out = line.out + row * line.stride;
  if (knows_filled) {
    envelope_of_row_among(line.in, line.stride, row, reach_, before_.data(), after_.data(), out);
  } else {
    envelope_of_row(line.in, line.stride, line.length, row, reach_, out);
  }
}

std::span<const int> EnvelopeLine::update(const TileLine& line, std::span<const int> changed) {
  find_sources(line, changed);
  const bool is_heavy = total_reach_ > kSpreadsPerEnvelope * (last_ - first_ + 1);
  if (is_heavy) {
    mark_all_lost(line);
    find_filled(line);
  } else {
    for (const Source& source : sources_) {
      Spread::spread(line, source.row, source.low, source.high, fates_.data());
    }
  }
  changed_.clear();
  for (int row = first_; row <= last_; ++row) {
    Fate& fate = fates_[idx(row)];
    if (fate == Fate::kKept) continue;
    if (fate == Fate::kLost) recompute(line, row, is_heavy);
    fate = Fate::kKept;
    if (std::memcmp(line.out + row * line.stride, line.out_previous + row * kTile, kTileBytes) !=
        0) {
      changed_.push_back(row);
    }
  }
  return changed_;
}

}  // namespace sidestep::edt
