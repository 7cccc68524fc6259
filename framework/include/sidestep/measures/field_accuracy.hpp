#pragma once

#include <cstdint>
#include <vector>

#include <sidestep/field/distance_field.hpp>
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

/// How far a field is from the exact transform of the map it was made of, over the voxels that it
/// calls known and that it or the exact transform puts nearer to a surface than the cut-off.
struct FieldAccuracy {
  std::int64_t compared_vox = 0;
  std::int64_t differing_vox = 0;  ///< By more than kSame_m.
  double max_error_m = 0.0;        ///< Infinity where the field has a value that is not finite.
  double sum_error_m = 0.0;

  /// Less than this comes of 32-bit distances and interpolation at voxel centres.
  static constexpr double kSame_m = 1e-5;

  [[nodiscard]] double mean_error_m() const noexcept {
    return compared_vox > 0 ? sum_error_m / static_cast<double>(compared_vox) : 0.0;
  }
  void add(const FieldAccuracy& other) noexcept;
};

/// Compares every voxel. `unknown_occupied`: the field takes unseen voxels for obstacles.
[[nodiscard]] FieldAccuracy compare_with_exact(const DistanceField& field, const OccupancyView& map,
                                               double max_distance_m, bool unknown_occupied);

}  // namespace sidestep
