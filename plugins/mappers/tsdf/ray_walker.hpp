#pragma once

#include <optional>

#include "block_scratch.hpp"
#include "options.hpp"
#include "ray.hpp"

namespace sidestep::tsdf {

/// Lists the voxels that rays cross (Amanatides and Woo 1987), from behind the surface towards
/// the camera. One for each thread; keeps scratch memory.
class RayWalker {
 public:
  explicit RayWalker(const TsdfOptions& options);

  /// Appends the segments of all rays of a trace. With the fast integrator a ray stops where,
  /// between its end and the camera, it meets too many voxels in a row that rays of this trace
  /// have seen before.
  void walk_all(const Eigen::Vector3d& camera_vox, Trace& trace);

 private:
  /// A walk from voxel to voxel, both in the grid.
  struct Course {
    Eigen::Vector3i voxel;
    Eigen::Vector3i last;
    Eigen::Vector3d from_vox;   ///< Where the ray begins, maybe outside the grid.
    Eigen::Vector3d along_vox;  ///< From there to where it ends.
    int steps_to_end = 0;       ///< Until it has passed the surface.
  };
  [[nodiscard]] std::optional<Course> course(const Eigen::Vector3d& camera_vox,
                                             const Ray& ray) const;
  template <bool kStopsEarly>
  void walk(const Course& course, std::uint32_t ray, Trace& trace);

  GridSpec grid_;
  Eigen::Vector3i counts_;
  double truncation_vox_;
  bool carving_;
  bool stops_early_;
  int max_collisions_;
  BlockScratch<std::uint64_t> seen_;  ///< A bit for each voxel.
};

}  // namespace sidestep::tsdf
