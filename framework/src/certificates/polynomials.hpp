#pragma once

#include <array>
#include <cmath>

#include <sidestep/certificates/polynomial_motion.hpp>

namespace sidestep {

/// A part is no shorter than 2^-kDeepest of a motion.
inline constexpr int kDeepest = 40;

namespace polynomials {

using Coefficients = std::array<double, PolynomialPiece::kTerms>;
/// By which a limit may be broken, for rounding; of joints, in their units.
inline constexpr double kLimit = 1e-6;

inline double value(const Coefficients& c, double s) {
  double sum = 0.0;
  for (std::size_t k = c.size(); k-- > 0;) sum = sum * s + c[k];
  return sum;
}

/// The coefficients about s, and those of the derivative.
inline Coefficients about(Coefficients c, double s) {
  for (std::size_t first = 0; first + 1 < c.size(); ++first) {
    for (std::size_t k = c.size() - 1; k-- > first;) c[k] += s * c[k + 1];
  }
  return c;
}
inline Coefficients derivative(const Coefficients& c) {
  Coefficients d{};
  for (std::size_t k = 1; k < c.size(); ++k) d[k - 1] = static_cast<double>(k) * c[k];
  return d;
}

/// How far a polynomial goes from where it is at s, at most, within `half` to either side.
inline double way(const Coefficients& c, double s, double half) {
  const Coefficients near = about(c, s);
  double sum = 0.0, power = 1.0;
  for (std::size_t k = 1; k < near.size(); ++k) sum += std::abs(near[k]) * (power *= half);
  return sum;
}

/// A time in [from, to] at which a polynomial is beyond a limit; NaN: it never is.
inline double time_beyond(const Coefficients& c, double from, double to, double limit,
                          int depth = 0) {
  const double middle = 0.5 * (from + to);
  if (value(c, middle) > limit + kLimit) return middle;
  const double most = value(c, middle) + way(c, middle, 0.5 * (to - from));
  if (most <= limit + kLimit || depth == kDeepest) return std::nan("");
  const double before = time_beyond(c, from, middle, limit, depth + 1);
  return std::isnan(before) ? time_beyond(c, middle, to, limit, depth + 1) : before;
}

inline Coefficients negative(Coefficients c) {
  for (double& one : c) one = -one;
  return c;
}

}  // namespace polynomials
}  // namespace sidestep
