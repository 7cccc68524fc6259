#pragma once

namespace sidestep::detail {

/// The cubic Hermite basis on an interval of `dt_s` at `fraction` of it. With a = q_i,
/// b = q_{i+1}: position = a + rise * (b - a) + out * a' + in * b', and its time derivative
/// likewise with the rates. Written with b - a, a long way from zero loses no digits.
struct HermiteBasis {
  double rise, out, in;
  double rise_rate, out_rate, in_rate;
};

[[nodiscard]] inline HermiteBasis hermite_basis(double dt_s, double fraction) noexcept {
  const double f = fraction;
  const double g = 1.0 - fraction;
  return {.rise = f * f * (3.0 - 2.0 * f),
          .out = dt_s * f * g * g,
          .in = -dt_s * f * f * g,
          .rise_rate = 6.0 * f * g / dt_s,
          .out_rate = g * (1.0 - 3.0 * f),
          .in_rate = f * (3.0 * f - 2.0)};
}

}  // namespace sidestep::detail
