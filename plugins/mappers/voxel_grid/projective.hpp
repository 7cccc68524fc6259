#pragma once

#include "carve_image.hpp"
#include "kernels.hpp"
#include "log_odds_grid.hpp"
#include "options.hpp"
#include "voxel_marks.hpp"

namespace sidestep::voxel_grid {

/// Integrates depth images by looking up, for each voxel in view, how far the ray of its pixel
/// is free. Whole blocks behind the surface are skipped, whole free ones are cleared at once.
class ProjectiveIntegrator {
 public:
  ProjectiveIntegrator(const VoxelGridOptions& options, LogOddsGrid& map, VoxelMarks& hits,
                       WorkerPool& workers);

  IntegrationCounts integrate(const Frame& frame, const DepthImage& image, const SelfFilter& self);

 private:
  struct View;
  struct BlockRange {
    Eigen::Vector3i first;
    Eigen::Vector3i last;
  };
  [[nodiscard]] View view_of(const Frame& frame, const CameraIntrinsics& camera) const;
  [[nodiscard]] BlockRange blocks_in_view(const Frame& frame, const CameraIntrinsics& camera) const;
  void visit(const View& view, const Eigen::Vector3i& block);

  LogOddsGrid& map_;
  VoxelMarks& hits_;
  WorkerPool& workers_;
  CarveImage image_;
  float band_m_;
  int first_surface_layer_;
};

}  // namespace sidestep::voxel_grid
