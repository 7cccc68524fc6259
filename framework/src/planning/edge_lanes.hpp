#pragma once

#include <cstddef>

#include <sidestep/core/lanes.hpp>

namespace sidestep::detail {

/// How far a point comes from where it is in each lane, within half a part of an edge before or
/// after it. Lanes are the middles of parts that follow each other, 0 to 3 and 4 to 7 alike: the
/// chord to the next lane is the mean of the velocity between the two, so that the way is at most
/// half the chord and `bent_m` (3/2 of the greatest acceleration times the half part's square), nor
/// more than `widest_m`.
void find_ways(const PointLanes& points_m, double widest_m, double bent_m, double* ways_m) noexcept;

/// Whether two points are nearer than a limit in any lane; is_near[lane] becomes 1 there and is
/// left alone elsewhere.
bool find_close(const PointLanes& a_m, const PointLanes& b_m, double limit_m,
                double* is_near) noexcept;

/// ways[row] = sum over columns of |to - from| * table[column * stride + row]; `stride` rows, whole
/// lanes.
void find_products(const double* table, std::size_t stride, std::size_t columns, const double* from,
                   const double* to, double* ways) noexcept;

/// sums = values + addend.
void add_to(const double* values, double addend, double* sums) noexcept;

}  // namespace sidestep::detail
