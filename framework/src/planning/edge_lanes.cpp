#ifndef SIDESTEP_KERNELS
#include "edge_lanes.hpp"

#define SIDESTEP_KERNELS "edge_lanes.cpp"
#include <sidestep/core/each_target.hpp>

namespace sidestep::detail {

void find_ways(const PointLanes& points_m, double widest_m, double bent_m,
               double* ways_m) noexcept {
  SIDESTEP_BEST(find_ways)(points_m, widest_m, bent_m, ways_m);
}

bool find_close(const PointLanes& a_m, const PointLanes& b_m, double limit_m,
                double* is_near) noexcept {
  return SIDESTEP_BEST(find_close)(a_m, b_m, limit_m, is_near);
}

void find_products(const double* table, std::size_t stride, std::size_t columns, const double* from,
                   const double* to, double* ways) noexcept {
  SIDESTEP_BEST(find_products)(table, stride, columns, from, to, ways);
}

void add_to(const double* values, double addend, double* sums) noexcept {
  SIDESTEP_BEST(add_to)(values, addend, sums);
}

}  // namespace sidestep::detail

#else

namespace {

using namespace detail;

/// Steps from each lane to the next of its four; the fourth's is the third's.
SIDESTEP_INLINE void add_steps(const double* from, double* squares) noexcept {
  for (std::size_t lane = 0; lane < kLanes; ++lane) {
    const std::size_t first = lane - (lane % 4 == 3 ? 1 : 0);
    const double step = from[first + 1] - from[first];
    squares[lane] += step * step;
  }
}

void find_ways(const PointLanes& points_m, double widest_m, double bent_m,
               double* ways_m) noexcept {
  alignas(64) double squares[kLanes] = {};
  add_steps(points_m.x, squares);
  add_steps(points_m.y, squares);
  add_steps(points_m.z, squares);
  for (std::size_t lane = 0; lane < kLanes; ++lane) {
    ways_m[lane] = lesser(widest_m, 0.5 * __builtin_sqrt(squares[lane]) + bent_m);
  }
}

bool find_close(const PointLanes& a_m, const PointLanes& b_m, double limit_m,
                double* is_near) noexcept {
  const Lanes x = lanes(a_m.x) - lanes(b_m.x), y = lanes(a_m.y) - lanes(b_m.y),
              z = lanes(a_m.z) - lanes(b_m.z);
  const Lanes close = ones_where(x * x + y * y + z * z < limit_m * limit_m);
  lanes(is_near) = greater(close, lanes(is_near));
  return any_of(close);
}

void find_products(const double* table, std::size_t stride, std::size_t columns, const double* from,
                   const double* to, double* ways) noexcept {
  for (std::size_t row = 0; row < stride; row += kLanes) {
    Lanes sum{};
    for (std::size_t column = 0; column < columns; ++column) {
      sum += __builtin_fabs(to[column] - from[column]) * lanes(table + column * stride + row);
    }
    lanes(ways + row) = sum;
  }
}

void add_to(const double* values, double addend, double* sums) noexcept {
  lanes(sums) = lanes(values) + addend;
}

}  // namespace

#endif
