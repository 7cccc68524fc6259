#pragma once

#include <cstdint>
#include <vector>

#include <sidestep/geometry/grid.hpp>
#include <sidestep/mapping/occupancy_view.hpp>

namespace sidestep {

/// Distances in metres from every voxel's centre to the nearest obstacle's centre, in linear
/// order, cut off at `max_distance_m`: what distance fields are held against. `obstacles` has one
/// byte a voxel, not 0 for an obstacle. With `is_signed`, minus the distance to the nearest free
/// centre inside obstacles.
///
/// Shares nothing with any field plugin: along each axis, the least of value + offset^2 over all
/// offsets up to the cut-off, in whole numbers. Slow, plain, and exact.
[[nodiscard]] std::vector<float> exact_distances_m(const GridSpec& grid,
                                                   const std::vector<std::uint8_t>& obstacles,
                                                   double max_distance_m, bool is_signed);

/// The obstacles of a map: occupied voxels and, if `unknown_occupied`, those never observed.
[[nodiscard]] std::vector<std::uint8_t> obstacles_of(const OccupancyView& map,
                                                     bool unknown_occupied);

}  // namespace sidestep
