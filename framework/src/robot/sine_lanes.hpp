#pragma once

#include <cstdint>

#include <sidestep/core/vectors.hpp>

namespace sidestep::detail {

/// Beyond it the reduction below would lose digits.
inline constexpr double kLargestAngle = 1e5;

/// pi / 2 in three parts of 33 bits, so that up to 2^16 times a part is exact.
inline constexpr double kHalfPi[] = {1.5707963267341256, 6.077100506303966e-11,
                                     2.0222662487111665e-21};

/// Sines and cosines of angles in radians, within 3e-16 of the true ones up to kLargestAngle.
/// Reduces to [-pi/4, pi/4], where Taylor's series to the powers 17 and 16 are exact to rounding.
template <std::size_t kParts>
SIDESTEP_INLINE void sine_lanes(const Line<double, kParts>& x, Line<double, kParts>& sines,
                                Line<double, kParts>& cosines) noexcept {
  using Lanes = Line<double, kParts>;
  using Bits = Mask<double, kParts>;
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

  const Bits quadrant = bits_of(rounded);
  const Bits is_odd = (quadrant & 1) != 0;
  const Lanes turned_sine = choose(is_odd, cosine, sine);
  const Lanes turned_cosine = choose(is_odd, sine, cosine);
  sines = inverted(turned_sine, (quadrant & 2) << 62);
  cosines = inverted(turned_cosine, ((quadrant + 1) & 2) << 62);
}

/// Sixteen numbers as floats.
template <std::size_t kParts>
SIDESTEP_INLINE Line<float, kParts> join(const Line<double, kParts>& a,
                                         const Line<double, kParts>& b) noexcept {
  Line<float, kParts> out;
  if constexpr (kParts == 1) {
    using Half = typename VectorOf<float, 32>::Type;
    const Half low = __builtin_convertvector(a.parts[0], Half);
    const Half high = __builtin_convertvector(b.parts[0], Half);
    out.parts[0] =
        __builtin_shufflevector(low, high, 0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11, 12, 13, 14, 15);
  } else if constexpr (kParts == 2) {
    using Half = typename VectorOf<float, 16>::Type;
    const Line<double, kParts>* of[] = {&a, &b};
#pragma GCC unroll 2
    for (std::size_t i = 0; i < 2; ++i) {
      const Half low = __builtin_convertvector(of[i]->parts[0], Half);
      const Half high = __builtin_convertvector(of[i]->parts[1], Half);
      out.parts[i] = __builtin_shufflevector(low, high, 0, 1, 2, 3, 4, 5, 6, 7);
    }
  } else {
    alignas(64) float numbers[kFloatLanes];
    for (std::size_t i = 0; i < kFloatLanes; ++i) {
      numbers[i] = static_cast<float>(i < kLanes ? a[i] : b[i - kLanes]);
    }
    out = *reinterpret_cast<const Line<float, kParts>*>(numbers);
  }
  return out;
}

/// Sines and cosines of sixteen angles within 2e-7 of the true ones up to kLargestAngle: reduced in
/// double precision, then Taylor's series to the powers 9 and 10.
template <std::size_t kParts>
SIDESTEP_INLINE void sine_lanes(const Line<double, kParts>& low, const Line<double, kParts>& high,
                                Line<float, kParts>& sines, Line<float, kParts>& cosines) noexcept {
  using Lanes = Line<double, kParts>;
  using FloatLanes = Line<float, kParts>;
  using Bits = Mask<float, kParts>;
  constexpr double kRounding = 6755399441055744.0;  // 1.5 * 2^52
  const Lanes low_quarters = (low * 0.63661977236758134308 + kRounding) - kRounding;
  const Lanes high_quarters = (high * 0.63661977236758134308 + kRounding) - kRounding;
  const Lanes low_rest = (low - low_quarters * kHalfPi[0]) - low_quarters * kHalfPi[1];
  const Lanes high_rest = (high - high_quarters * kHalfPi[0]) - high_quarters * kHalfPi[1];
  const FloatLanes r = join(low_rest, high_rest);
  const FloatLanes r2 = r * r;
  FloatLanes odd = r2 * (1.0F / 362880.0F) - 1.0F / 5040.0F;
  odd = odd * r2 + 1.0F / 120.0F;
  odd = odd * r2 - 1.0F / 6.0F;
  FloatLanes even = r2 * (-1.0F / 3628800.0F) + 1.0F / 40320.0F;
  even = even * r2 - 1.0F / 720.0F;
  even = even * r2 + 1.0F / 24.0F;
  const FloatLanes sine = r + r * r2 * odd;
  const FloatLanes cosine = 1.0F - (0.5F * r2 - r2 * r2 * even);

  const Bits quadrant = integers_of(join(low_quarters, high_quarters));
  const Bits is_odd = (quadrant & 1) != 0;
  const FloatLanes turned_sine = choose(is_odd, cosine, sine);
  const FloatLanes turned_cosine = choose(is_odd, sine, cosine);
  sines = inverted(turned_sine, (quadrant & 2) << 30);
  cosines = inverted(turned_cosine, ((quadrant + 1) & 2) << 30);
}

}  // namespace sidestep::detail
