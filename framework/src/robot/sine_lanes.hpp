#pragma once

#include <cstdint>

#include <sidestep/core/lanes.hpp>

namespace sidestep::detail {

/// Beyond it the reduction below would lose digits.
inline constexpr double kLargestAngle = 1e5;

/// pi / 2 in three parts of 33 bits, so that up to 2^16 times a part is exact.
inline constexpr double kHalfPi[] = {1.5707963267341256, 6.077100506303966e-11,
                                     2.0222662487111665e-21};

/// Sines and cosines of angles in radians, within 3e-16 of the true ones up to kLargestAngle.
/// Reduces to [-pi/4, pi/4], where Taylor's series to the powers 17 and 16 are exact to rounding.
SIDESTEP_INLINE void sine_lanes(const Lanes& x, Lanes& sines, Lanes& cosines) noexcept {
  using Bits = std::int64_t __attribute__((vector_size(8 * kLanes), aligned(8), may_alias));
  // Added to this, a number is rounded to an integer, which its last bits then hold.
  constexpr double kRounding = 6755399441055744.0;  // 1.5 * 2^52
  const Lanes rounded = x * 0.63661977236758134308 + kRounding;
  const Lanes quarters = rounded - kRounding;
  const Lanes r = ((x - quarters * kHalfPi[0]) - quarters * kHalfPi[1]) - quarters * kHalfPi[2];
  const Lanes r2 = r * r;
  Lanes odd = r2 * (1.0 / 355687428096000.0) - 1.0 / 1307674368000.0;
  odd = odd * r2 + 1.0 / 6227020800.0;
  odd = odd * r2 - 1.0 / 39916800.0;
  odd = odd * r2 + 1.0 / 362880.0;
  odd = odd * r2 - 1.0 / 5040.0;
  odd = odd * r2 + 1.0 / 120.0;
  odd = odd * r2 - 1.0 / 6.0;
  Lanes even = r2 * (1.0 / 20922789888000.0) - 1.0 / 87178291200.0;
  even = even * r2 + 1.0 / 479001600.0;
  even = even * r2 - 1.0 / 3628800.0;
  even = even * r2 + 1.0 / 40320.0;
  even = even * r2 - 1.0 / 720.0;
  even = even * r2 + 1.0 / 24.0;
  const Lanes sine = r + r * r2 * odd;
  const Lanes cosine = 1.0 - (0.5 * r2 - r2 * r2 * even);

  const Bits quadrant = reinterpret_cast<const Bits&>(rounded);
  const Bits is_odd = (quadrant & 1) != 0;
  const Lanes turned_sine = is_odd ? cosine : sine;
  const Lanes turned_cosine = is_odd ? sine : cosine;
  const Bits sine_sign = (quadrant & 2) << 62;
  const Bits cosine_sign = ((quadrant + 1) & 2) << 62;
  reinterpret_cast<Bits&>(sines) = reinterpret_cast<const Bits&>(turned_sine) ^ sine_sign;
  reinterpret_cast<Bits&>(cosines) = reinterpret_cast<const Bits&>(turned_cosine) ^ cosine_sign;
}

/// Sixteen numbers as floats.
SIDESTEP_INLINE void join(const Lanes& low, const Lanes& high, FloatLanes& out) noexcept {
  using Half = float __attribute__((vector_size(4 * kLanes), aligned(4), may_alias));
  const Half first = __builtin_convertvector(low, Half);
  const Half second = __builtin_convertvector(high, Half);
  out =
      __builtin_shufflevector(first, second, 0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11, 12, 13, 14, 15);
}

/// Sines and cosines of sixteen angles within 2e-7 of the true ones up to kLargestAngle: reduced in
/// double precision, then Taylor's series to the powers 9 and 10.
SIDESTEP_INLINE void sine_lanes(const Lanes& low, const Lanes& high, FloatLanes& sines,
                                FloatLanes& cosines) noexcept {
  using Half = std::int32_t __attribute__((vector_size(4 * kLanes), aligned(4), may_alias));
  using Bits = std::int32_t __attribute__((vector_size(8 * kLanes), aligned(4), may_alias));
  constexpr double kRounding = 6755399441055744.0;  // 1.5 * 2^52
  const Lanes low_quarters = (low * 0.63661977236758134308 + kRounding) - kRounding;
  const Lanes high_quarters = (high * 0.63661977236758134308 + kRounding) - kRounding;
  const Lanes low_rest = (low - low_quarters * kHalfPi[0]) - low_quarters * kHalfPi[1];
  const Lanes high_rest = (high - high_quarters * kHalfPi[0]) - high_quarters * kHalfPi[1];
  FloatLanes r;
  join(low_rest, high_rest, r);
  const FloatLanes r2 = r * r;
  FloatLanes odd = r2 * (1.0F / 362880.0F) - 1.0F / 5040.0F;
  odd = odd * r2 + 1.0F / 120.0F;
  odd = odd * r2 - 1.0F / 6.0F;
  FloatLanes even = r2 * (-1.0F / 3628800.0F) + 1.0F / 40320.0F;
  even = even * r2 - 1.0F / 720.0F;
  even = even * r2 + 1.0F / 24.0F;
  const FloatLanes sine = r + r * r2 * odd;
  const FloatLanes cosine = 1.0F - (0.5F * r2 - r2 * r2 * even);

  const Half low_quadrant = __builtin_convertvector(low_quarters, Half);
  const Half high_quadrant = __builtin_convertvector(high_quarters, Half);
  const Bits quadrant = __builtin_shufflevector(low_quadrant, high_quadrant, 0, 1, 2, 3, 4, 5, 6, 7,
                                                8, 9, 10, 11, 12, 13, 14, 15);
  const Bits is_odd = (quadrant & 1) != 0;
  const FloatLanes turned_sine = is_odd ? cosine : sine;
  const FloatLanes turned_cosine = is_odd ? sine : cosine;
  const Bits sine_sign = (quadrant & 2) << 30;
  const Bits cosine_sign = ((quadrant + 1) & 2) << 30;
  reinterpret_cast<Bits&>(sines) = reinterpret_cast<const Bits&>(turned_sine) ^ sine_sign;
  reinterpret_cast<Bits&>(cosines) = reinterpret_cast<const Bits&>(turned_cosine) ^ cosine_sign;
}

}  // namespace sidestep::detail
