#pragma once

#include <cstdint>

#include <sidestep/field/distance_field.hpp>
#include <sidestep/mapping/occupancy_view.hpp>

namespace sidestep {

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
