#pragma once

#include <cstdint>
#include <vector>

#include <sidestep/core/worker_pool.hpp>
#include <sidestep/mapping/mapper.hpp>
#include <sidestep/mapping/self_filter.hpp>

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
  void add_point(const Frame& frame, const SelfFilter& self, const Eigen::Vector3d& p_camera,
                 IntegrationCounts& counts);
  void add_free(const Eigen::Vector3d& from_world, const Eigen::Vector3d& to_world);
  IntegrationCounts add_image(const Frame& frame, const DepthImage& image, const SelfFilter& self);
  IntegrationCounts add_cloud(const Frame& frame, const PointCloud& cloud, const SelfFilter& self);
  void gather_rays();
  void gather_block(const Eigen::Vector3i& block);
  void walk(const Eigen::Vector3d& camera_vox, const Ray& ray);
  void update_map();

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
