#pragma once

#include <cstddef>

namespace sidestep::detail {

/// A cubic piece of a path, q0 + v0 s + c2 s^2 + c3 s^3: a row of joints for each coefficient, in
/// whole lanes, with zeros beyond the joints.
struct CubicLanes {
  const double* rows = nullptr;
  std::size_t width = 0;

  static constexpr std::size_t kRows = 4;
  [[nodiscard]] const double* q0() const noexcept { return rows; }
  [[nodiscard]] const double* v0() const noexcept { return rows + width; }
  [[nodiscard]] const double* c2() const noexcept { return rows + 2 * width; }
  [[nodiscard]] const double* c3() const noexcept { return rows + 3 * width; }
};

struct CubicRates {
  double speed;   ///< |dq/ds|
  double change;  ///< d|dq/ds|^2 / ds / 2
  double bend;    ///< |d2q/ds2|
};
[[nodiscard]] CubicRates rates_at(const CubicLanes& cubic, double s) noexcept;

/// By Gauss and Legendre's rule of five points.
[[nodiscard]] double arc_length(const CubicLanes& cubic, double from_s, double to_s) noexcept;

/// dq/dl and d2q/dl2, rows of joints, where the speed is not 0.
void derive_by_length(const CubicLanes& cubic, double s, double* tangent,
                      double* curvature) noexcept;

}  // namespace sidestep::detail
