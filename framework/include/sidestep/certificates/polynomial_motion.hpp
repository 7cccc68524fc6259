#pragma once

#include <array>
#include <vector>

#include <sidestep/core/export.hpp>
#include <sidestep/trajectory/trajectory.hpp>

namespace sidestep {

/// What a robot does between two states that are given.
enum class Joining { kLinear, kCubic, kQuintic };

/// All joints from one time to the next: joint j is at the sum of coefficients[j][k] s^k, s seconds
/// after begin_s.
struct PolynomialPiece {
  static constexpr std::size_t kTerms = 6;
  double begin_s = 0.0;
  double end_s = 0.0;
  std::vector<std::array<double, kTerms>> coefficients;
};

/// A motion as polynomials, one piece after the other, from time 0. Plain data.
struct PolynomialMotion {
  std::vector<PolynomialPiece> pieces;
  bool has_times = true;  ///< False: waypoints without times; their speed says nothing.
  Joining joining = Joining::kLinear;

  [[nodiscard]] double duration_s() const { return pieces.empty() ? 0.0 : pieces.back().end_s; }
};

/// A trajectory as it is followed: by cubics.
[[nodiscard]] SIDESTEP_EXPORT PolynomialMotion polynomials_of(const Trajectory& trajectory);

/// The cubic from one state of a joint to another, `span_s` later.
[[nodiscard]] SIDESTEP_EXPORT std::array<double, PolynomialPiece::kTerms> cubic(
    double from, double from_speed, double to, double to_speed, double span_s);

}  // namespace sidestep
