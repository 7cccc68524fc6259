#pragma once

#include <sidestep/core/lanes.hpp>

namespace sidestep {

/// The sum over all lanes.
SIDESTEP_INLINE double sum_of(const Lanes& values) noexcept {
  double sum = 0.0;
  for (std::size_t i = 0; i < kLanes; ++i) sum += values[i];
  return sum;
}

/// The least of all lanes.
SIDESTEP_INLINE double least_of(const Lanes& values) noexcept {
  double least = values[0];
  for (std::size_t i = 1; i < kLanes; ++i) least = lesser(least, values[i]);
  return least;
}

/// Whether any lane is something else than 0; no lane may be negative.
SIDESTEP_INLINE bool any_of(const Lanes& values) noexcept {
  using Half = double __attribute__((vector_size(4 * sizeof(double)), may_alias));
  using Quarter = double __attribute__((vector_size(2 * sizeof(double)), may_alias));
  alignas(64) Lanes kept = values;
  const Half* halves = reinterpret_cast<const Half*>(&kept);
  const Half half = halves[0] + halves[1];
  const Quarter* quarters = reinterpret_cast<const Quarter*>(&half);
  const Quarter quarter = quarters[0] + quarters[1];
  return quarter[0] + quarter[1] != 0.0;
}

/// Absolute values; written, since vectors cannot be returned before the target is known.
SIDESTEP_INLINE void find_sizes(const Lanes& values, Lanes& sizes) noexcept {
  sizes = values < 0.0 ? -values : values;
}

}  // namespace sidestep
