#pragma once

#include <cstddef>
#include <cstdint>
#include <limits>
#include <span>

#include <Eigen/Core>

#include <sidestep/core/export.hpp>
#include <sidestep/core/lanes.hpp>
#include <sidestep/core/time.hpp>
#include <sidestep/geometry/grid.hpp>

namespace sidestep {

/// What a field knows about a point.
enum class FieldStatus : std::uint8_t {
  kKnown,    ///< Observed by the map.
  kUnknown,  ///< Inside the field, never observed; the distance is to known obstacles only.
  kOutside,  ///< Outside the field; distance and gradient are those at the nearest inner point.
};

struct FieldInfo {
  GridSpec grid;
  bool is_signed = false;       ///< Negative inside obstacles; else 0 there.
  double max_distance_m = 0.0;  ///< Distances are cut off here; infinity if they are not.
  /// Lipschitz constant of the distances between voxel centres outside obstacles: 1 where they are
  /// exact, infinity where it is unknown.
  double lipschitz = std::numeric_limits<double>::infinity();
  bool is_exact = false;  ///< Nothing is interpolated: 1-Lipschitz, and the grid is but its bounds.
  std::int64_t sequence = 0;  ///< Number of updates that went into it.
  Stamp stamp;                ///< Of the newest frame in it.
};

/// What a field says of one point of a query.
struct FieldSample {
  std::size_t point;  ///< Index in the query.
  FieldStatus status;
  double distance_m;
  Eigen::Vector3d gradient;
};

/// The Euclidean distance to the nearest obstacle, as one immutable snapshot of a map. [any]
class SIDESTEP_EXPORT DistanceField {
 public:
  explicit DistanceField(FieldInfo info) : info_(std::move(info)) {}
  virtual ~DistanceField() = default;

  [[nodiscard]] const FieldInfo& info() const noexcept { return info_; }

  /// Trilinear interpolation between voxel centres, and its analytic gradient; the distance itself
  /// where info().is_exact, beyond whose grid what follows holds of the grid's own box. A point
  /// beyond the box of the outermost centres has the value of the nearest point of that box, and no
  /// gradient along the axes on which it is beyond. A point that is not finite is outside, with
  /// distance NaN and gradient 0. At voxels never observed the value is what the builder makes
  /// of them (its parameter `unknown`) and the status kUnknown; the nearest voxel decides.
  ///
  /// points_m: n points, world frame. distances_m: n. gradients: n, dimensionless (metres per
  /// metre), or empty where none are wanted. statuses: n, or empty. Does not allocate.
  virtual void query(std::span<const Eigen::Vector3d> points_m, std::span<double> distances_m,
                     std::span<Eigen::Vector3d> gradients,
                     std::span<FieldStatus> statuses) const noexcept = 0;

  /// query() of those points alone whose distance is less than their limit or not a number, those
  /// outside, and, if `also_unknown`, those never observed: what a cost or a check that begins at
  /// a limit has to look at. Point kFloatLanes * i + lane is lane `lane` of points_m[i] and has
  /// the limit limits_m[i]. samples: room for all. Returns how many were written, in order of
  /// points. Does not allocate.
  virtual std::size_t query_below(std::span<const PointFloats> points_m,
                                  std::span<const double> limits_m, bool also_unknown,
                                  std::span<FieldSample> samples) const noexcept;

 private:
  FieldInfo info_;
};

}  // namespace sidestep
