#ifndef SIDESTEP_KERNELS
#include "cubic_lanes.hpp"

#include <array>

#define SIDESTEP_KERNELS "cubic_lanes.cpp"
#include <sidestep/core/each_target.hpp>

namespace sidestep::detail {

CubicRates rates_at(const CubicLanes& cubic, double s) noexcept {
  return SIDESTEP_BEST(rates_at)(cubic, s);
}

double arc_length(const CubicLanes& cubic, double from_s, double to_s) noexcept {
  return SIDESTEP_BEST(arc_length)(cubic, from_s, to_s);
}

void derive_by_length(const CubicLanes& cubic, double s, double* tangent,
                      double* curvature) noexcept {
  SIDESTEP_BEST(derive_by_length)(cubic, s, tangent, curvature);
}

}  // namespace sidestep::detail

#else

namespace {

using namespace detail;

/// dq/ds of the joints from j on.
SIDESTEP_INLINE void find_velocity(const CubicLanes& cubic, std::size_t j, double s,
                                   Lanes& v) noexcept {
  v = lanes(cubic.v0() + j) + s * (2.0 * lanes(cubic.c2() + j) + 3.0 * s * lanes(cubic.c3() + j));
}

/// d2q/ds2 of them.
SIDESTEP_INLINE void find_acceleration(const CubicLanes& cubic, std::size_t j, double s,
                                       Lanes& a) noexcept {
  a = 2.0 * lanes(cubic.c2() + j) + 6.0 * s * lanes(cubic.c3() + j);
}

CubicRates rates_at(const CubicLanes& cubic, double s) noexcept {
  Lanes speed{}, change{}, bend{};
  for (std::size_t j = 0; j < cubic.width; j += kLanes) {
    Lanes v, a;
    find_velocity(cubic, j, s, v);
    find_acceleration(cubic, j, s, a);
    speed += v * v;
    change += v * a;
    bend += a * a;
  }
  return {__builtin_sqrt(sum_of(speed)), sum_of(change), __builtin_sqrt(sum_of(bend))};
}

double arc_length(const CubicLanes& cubic, double from_s, double to_s) noexcept {
  constexpr std::array kNodes{-0.9061798459386640, -0.5384693101056831, 0.0, 0.5384693101056831,
                              0.9061798459386640};
  constexpr std::array kWeights{0.2369268850561891, 0.4786286704993665, 0.5688888888888889,
                                0.4786286704993665, 0.2369268850561891};
  const double middle = 0.5 * (from_s + to_s), half = 0.5 * (to_s - from_s);
  double sum = 0.0;
  for (std::size_t k = 0; k < kNodes.size(); ++k) {
    const double s = middle + half * kNodes[k];
    Lanes squares{};
    for (std::size_t j = 0; j < cubic.width; j += kLanes) {
      Lanes v;
      find_velocity(cubic, j, s, v);
      squares += v * v;
    }
    sum += kWeights[k] * __builtin_sqrt(sum_of(squares));
  }
  return half * sum;
}

void derive_by_length(const CubicLanes& cubic, double s, double* tangent,
                      double* curvature) noexcept {
  Lanes squares{}, products{};
  for (std::size_t j = 0; j < cubic.width; j += kLanes) {
    Lanes v, a;
    find_velocity(cubic, j, s, v);
    find_acceleration(cubic, j, s, a);
    squares += v * v;
    products += v * a;
  }
  const double per_square = 1.0 / sum_of(squares), per_speed = __builtin_sqrt(per_square);
  const double along = sum_of(products) * per_square;  // of the acceleration, in velocities
  for (std::size_t j = 0; j < cubic.width; j += kLanes) {
    Lanes v, a;
    find_velocity(cubic, j, s, v);
    find_acceleration(cubic, j, s, a);
    lanes(tangent + j) = v * per_speed;
    lanes(curvature + j) = (a - along * v) * per_square;
  }
}

}  // namespace

#endif
