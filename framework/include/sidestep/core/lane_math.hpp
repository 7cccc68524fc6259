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

/// Absolute values; written, since vectors cannot be returned before the target is known.
SIDESTEP_INLINE void find_sizes(const Lanes& values, Lanes& sizes) noexcept {
  sizes = values < 0.0 ? -values : values;
}

}  // namespace sidestep
