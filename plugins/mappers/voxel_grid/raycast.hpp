#pragma once

#include <cstdint>
#include <vector>

#include <sidestep/core/worker_pool.hpp>
#include <sidestep/mapping/ray_ends.hpp>

#include "log_odds_grid.hpp"
#include "options.hpp"
#include "voxel_marks.hpp"

namespace sidestep::voxel_grid {

/// Integrates points by walking the voxels along their rays (Amanatides and Woo 1987). Points
/// that end in the same voxel share one ray, to that voxel's centre; each voxel changes at most
/// once a frame, and a hit wins over any miss.
class RaycastIntegrator {
 public:
  RaycastIntegrator(const VoxelGridOptions& options, LogOddsGrid& map, VoxelMarks& hits,
                    WorkerPool& workers);

  IntegrationCounts integrate(const Frame& frame, const SelfFilter& self);

 private:
  struct Ray {
    Eigen::Vector3i end;
    bool end_is_free;
  };
  IntegrationCounts mark_ends(const RayEnds& ends, std::size_t begin, std::size_t end);
  void gather_rays();
  void gather_block(const Eigen::Vector3i& block);
  void walk(const Eigen::Vector3d& camera_vox, const Ray& ray);
  void update_map(double stamp_s);

  LogOddsGrid& map_;
  VoxelMarks& hits_;
  WorkerPool& workers_;
  PointRules rules_;
  bool clear_no_return_;
  VoxelMarks misses_;
  VoxelMarks free_ends_;
  std::vector<Ray> rays_;
};

}  // namespace sidestep::voxel_grid
