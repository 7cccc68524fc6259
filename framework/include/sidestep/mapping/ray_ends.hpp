#pragma once

#include <cstddef>
#include <optional>

#include <Eigen/Core>

#include <sidestep/geometry/grid.hpp>
#include <sidestep/mapping/mapper.hpp>
#include <sidestep/mapping/point_rules.hpp>
#include <sidestep/mapping/self_filter.hpp>

namespace sidestep {

/// What one measurement says about a grid: the space from the camera to `p_vox` is free, and
/// the voxel there is hit, or free as well.
struct RayEnd {
  Eigen::Vector3d p_vox;  ///< Inside the grid, in voxels from its lower corner.
  bool hit = false;
};

/// The share [enter, leave] of a line from one point to another.
struct LinePart {
  double enter = 0.0;
  double leave = 1.0;
};
/// The part of a line that lies in the box from zero to `size`; nothing where it misses. [any]
[[nodiscard]] std::optional<LinePart> clip_to_box(const Eigen::Vector3d& from,
                                                  const Eigen::Vector3d& to,
                                                  const Eigen::Vector3d& size);

/// The voxel of a point in voxels, drawn into the grid where rounding put it outside. [any]
[[nodiscard]] Eigen::Vector3i nearest_voxel(const GridSpec& grid, const Eigen::Vector3d& p_vox);

/// Sorts the measurements of one frame, one by one, into rays: applies the rules, the
/// self-filter and the grid's bounds, and counts. For mappers that cast rays. [any]: threads
/// may share an object, each with its own counts. Borrows everything it is given.
class RayEnds {
 public:
  RayEnds(const GridSpec& grid, const PointRules& rules, bool clear_no_return,
          const SelfFilter& self, const Frame& frame);

  /// Pixels of the image or points of the cloud.
  [[nodiscard]] std::size_t size() const noexcept;

  /// The ray of measurement `index`; nothing where it says nothing about the grid.
  [[nodiscard]] std::optional<RayEnd> at(std::size_t index, IntegrationCounts& counts) const;

  /// The camera, in voxels from the grid's lower corner; may lie outside.
  [[nodiscard]] Eigen::Vector3d camera_vox() const;

 private:
  [[nodiscard]] std::optional<RayEnd> of_point(const Eigen::Vector3d& p_camera,
                                               IntegrationCounts& counts) const;
  [[nodiscard]] std::optional<RayEnd> free_to(const Eigen::Vector3d& p_world) const;
  [[nodiscard]] Eigen::Vector3d to_vox(const Eigen::Vector3d& p_world) const;

  const GridSpec& grid_;
  const PointRules& rules_;
  bool clear_no_return_;
  const SelfFilter& self_;
  const Frame& frame_;
};

/// Adds the counts of one part of a frame to those of another.
void add_counts(IntegrationCounts& to, const IntegrationCounts& more) noexcept;

}  // namespace sidestep
