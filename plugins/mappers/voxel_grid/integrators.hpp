#pragma once

#include <algorithm>
#include <cstdint>
#include <span>
#include <vector>

#include <sidestep/core/worker_pool.hpp>
#include <sidestep/mapping/mapper.hpp>
#include <sidestep/mapping/point_rules.hpp>
#include <sidestep/mapping/ray_ends.hpp>
#include <sidestep/mapping/self_filter.hpp>

#include "kernels.hpp"

namespace sidestep::voxel_grid {

/// A block of the map as the kernels see it.
[[nodiscard]] inline BlockRows block_rows(LogOddsGrid& map, const Eigen::Vector3i& block) {
  const Eigen::Vector3i first = block * kBlockSide_vox;
  const Eigen::Vector3i inside =
      (map.spec().size_vox - first).cwiseMin(Eigen::Vector3i::Constant(kBlockSide_vox));
  const std::size_t words = static_cast<std::size_t>(map.words_per_row());
  const std::size_t word =
      map.row(first.y(), first.z()) * words + static_cast<std::size_t>(block.x()) / 4;
  BlockRows rows;
  rows.log_odds = map.block(block_linear(block, map.counts()));
  rows.occupied = map.occupied_words() + word;
  rows.known = map.known_words() + word;
  rows.y_stride = words;
  rows.z_stride = words * static_cast<std::size_t>(map.spec().size_vox.y());
  rows.shift = static_cast<unsigned>(block.x()) % 4U * 16U;
  rows.nx = inside.x();
  rows.ny = inside.y();
  rows.nz = inside.z();
  return rows;
}

/// The marked voxels of a block, row by row; they leave the set. Returns whether there are any.
inline bool take_marks(VoxelMarks& marks, const LogOddsGrid& map, const Eigen::Vector3i& block,
                       const BlockRows& rows, std::uint16_t (&bits)[kBlockRows]) {
  std::fill(bits, bits + kBlockRows, std::uint16_t{0});
  const std::int32_t linear = block_linear(block, map.counts());
  if (!marks.in_block(linear)) return false;
  for (int z = 0; z < rows.nz; ++z) {
    for (int y = 0; y < rows.ny; ++y) {
      const std::size_t row =
          map.row(block.y() * kBlockSide_vox + y, block.z() * kBlockSide_vox + z);
      bits[y + kLanes * z] = marks.take_row(row, block.x());
    }
  }
  marks.leave_block(linear);
  return true;
}

/// Calls task(row, block) for every block, rows of them along x at once: no two share a word of the
/// occupied or known bits.
template <class Task>
void for_each_block(const LogOddsGrid& map, WorkerPool& workers, const Task& task) {
  const Eigen::Vector3i& counts = map.counts();
  workers.run(counts.y() * counts.z(), [&](int row) {
    Eigen::Vector3i block(0, row % counts.y(), row / counts.y());
    for (; block.x() < counts.x(); ++block.x()) task(row, block);
  });
}

/// Records what a kernel did to a block that a frame of this stamp saw.
inline void note(LogOddsGrid& map, const Eigen::Vector3i& block, double stamp_s,
                 BlockOutcome outcome) {
  const std::int32_t linear = block_linear(block, map.counts());
  map.last_update_s(linear) = stamp_s;
  if (outcome.changed) map.changed(linear) = 1;
  map.saturated_free(linear) = outcome.saturated_free ? 1 : 0;
}

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
