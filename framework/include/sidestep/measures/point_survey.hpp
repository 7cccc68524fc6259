#pragma once

#include <cstdint>
#include <limits>
#include <string>

#include <Eigen/Geometry>

#include <sidestep/core/node.hpp>
#include <sidestep/geometry/grid.hpp>
#include <sidestep/mapping/occupancy_view.hpp>
#include <sidestep/sensing/frame.hpp>

namespace sidestep {

/// Where the points of frames lie, by a sparse sample of them: what there is to say of a map in
/// which there are none. [mapping]
class PointSurvey {
 public:
  /// Keys of a configuration that say where a map lies.
  enum class Keys { kMapper, kMappingBenchmark };

  /// Points farther from the camera than this are no part of a map; infinity: none is.
  explicit PointSurvey(double max_range_m = std::numeric_limits<double>::infinity())
      : max_range_m_(max_range_m) {}
  /// With the range that a `mapper` block gives, if it gives any.
  [[nodiscard]] static PointSurvey of_mapper(const Node& block);

  /// `grid`: the map's, as this frame finds it. Malformed frames are passed over.
  void add(const Frame& frame, const GridSpec& grid);

  /// Whether any point lies in the grid.
  [[nodiscard]] bool reaches_grid() const noexcept { return in_grid_ > 0; }
  /// Why a map is empty, in words of `keys`; empty if it is not. A map is empty that knows nothing,
  /// and one without an occupied voxel, unless all that lies in its grid is bare floor.
  [[nodiscard]] std::string emptiness(const OccupancyView& map, Keys keys) const;
  /// Where the points lie against the grid, and what would hold them.
  [[nodiscard]] std::string describe(const GridSpec& grid, Keys keys) const;

 private:
  void add_point(const Eigen::Vector3d& p_camera, const Transform& T_world_camera,
                 const GridSpec& grid);

  double max_range_m_;
  double nearest_m_ = std::numeric_limits<double>::infinity();  ///< To the camera, out of range.
  std::int64_t in_grid_ = 0;
  std::int64_t above_floor_ = 0;  ///< Of those, higher than a floor may appear.
  Eigen::AlignedBox3d box_m_;     ///< Of the points within range, world frame.
};

}  // namespace sidestep
