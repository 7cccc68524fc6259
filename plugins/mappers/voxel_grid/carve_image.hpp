#pragma once

#include <span>
#include <vector>

#include <sidestep/core/worker_pool.hpp>
#include <sidestep/mapping/mapper.hpp>
#include <sidestep/mapping/point_rules.hpp>
#include <sidestep/mapping/self_filter.hpp>

#include "kernels.hpp"
#include "voxel_marks.hpp"

namespace sidestep::voxel_grid {

/// A depth image as the projective method wants it: how far each pixel's ray is free, and the
/// nearest and farthest of these over square tiles, to judge whole blocks at once.
class CarveImage {
 public:
  CarveImage(const GridSpec& grid, const PointRules& rules, bool clear_no_return, float band_m);

  /// Reads an image; the voxels of its points go to `hits`, each pixel is counted once. `grid` is
  /// as at construction, but may have moved along x and y.
  IntegrationCounts read(const Frame& frame, const DepthImage& image, const GridSpec& grid,
                         const SelfFilter& self, VoxelMarks& hits, WorkerPool& workers);

  [[nodiscard]] const float* carve_m() const noexcept { return carve_m_.data(); }
  [[nodiscard]] float farthest_m() const noexcept { return farthest_m_; }
  /// Least and greatest |carve| over the tiles that hold the pixels [u0, u1] x [v0, v1].
  struct Bounds {
    float least_m;
    float greatest_m;
  };
  [[nodiscard]] Bounds bounds(int u0, int v0, int u1, int v1) const noexcept;

 private:
  /// `balls` are those that the row's tiles may see.
  IntegrationCounts read_row(const DepthImage& image, int v, PixelRow row,
                             std::span<const CameraBall> balls, VoxelMarks& hits);
  void reduce_tiles(const CameraIntrinsics& camera, int tile_v);

  PixelRules rules_;
  std::vector<float> carve_m_;
  std::vector<CameraBall> balls_;
  int tiles_u_ = 0;
  std::vector<Bounds> tiles_;
  float farthest_m_ = 0.0F;
};

}  // namespace sidestep::voxel_grid
