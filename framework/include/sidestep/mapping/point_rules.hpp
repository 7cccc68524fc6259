#pragma once

#include <cmath>
#include <cstdint>

#include <Eigen/Core>

namespace sidestep {

/// What a map does with one measurement.
enum class PointFate : std::uint8_t {
  kInsert,      ///< Its voxel is hit, the ray up to it is free.
  kFloor,       ///< The ray and its end are free, nothing is hit.
  kOutOfRange,  ///< The ray is free up to the maximum range.
  kInvalid,     ///< No measurement: nothing happens.
};

/// The rules that all occupancy mappers share (Finean 2021, Sec. V: the floor is cut off at a
/// height, sensor range is limited).
struct PointRules {
  double min_range_m = 0.0;  ///< Distance from the camera; a nearer point is no measurement.
  double max_range_m = 5.0;
  double floor_z_m = 0.0;
  double floor_clearance_m = 0.03;  ///< Points lower than this above the floor belong to it.

  [[nodiscard]] double floor_top_m() const noexcept { return floor_z_m + floor_clearance_m; }

  /// p_camera and p_world: the same point in the camera's and in the world frame. [any]
  [[nodiscard]] PointFate fate(const Eigen::Vector3d& p_camera,
                               const Eigen::Vector3d& p_world) const noexcept {
    const double range_m = p_camera.norm();
    if (!std::isfinite(range_m) || range_m <= min_range_m) return PointFate::kInvalid;
    if (range_m > max_range_m) return PointFate::kOutOfRange;
    if (p_world.z() < floor_top_m()) return PointFate::kFloor;
    return PointFate::kInsert;
  }
};

}  // namespace sidestep
