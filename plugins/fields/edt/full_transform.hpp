#pragma once

#include <cstdint>
#include <memory>
#include <vector>

#include <sidestep/core/worker_pool.hpp>
#include <sidestep/mapping/occupancy_view.hpp>

#include "tiled_grid.hpp"

namespace sidestep::edt {

/// The exact Euclidean distance of every voxel of a grid to the nearest obstacle, however far, all
/// at once.
///
/// Goes through the grid in tiles along x, kTile voxels of every row, so that what passes from axis
/// to axis stays in the cache. Within a tile: the squared distance along x from the occupancy bits;
/// along y, then z, out[i] = min over j of in[j] + (i - j)^2 by divide and conquer: the minimising
/// j grows with i, so that of the middle row bounds those of either half (monotone matrix search;
/// Aggarwal et al. 1987).
class FullTransform {
 public:
  /// Whether a grid, with squared distances cut off at `cap`, is not too large: a sum of two
  /// squared distances and a row's number share 32 bits.
  [[nodiscard]] static bool fits(const Eigen::Vector3i& size_vox, std::uint32_t cap);

  /// `metres` holds the distance for each squared distance in voxels; its last, the cap, is that
  /// where there is no obstacle, or none nearer. `workers` outlives this.
  FullTransform(const Eigen::Vector3i& size_vox, std::vector<float> metres, WorkerPool& workers);
  ~FullTransform();

  void update(const VoxelBits& obstacles);

  /// Distances of a row, in metres.
  [[nodiscard]] const float* row(int y, int z) const noexcept { return distances_m_.row(y, z); }

 private:
  struct Workspace;

  void transform_tile(const VoxelBits& obstacles, int x, Workspace& space);

  Eigen::Vector3i size_;
  std::vector<float> metres_;
  WorkerPool& workers_;
  std::vector<std::uint8_t> row_filled_;  ///< Whether a row has any obstacle.
  std::vector<std::unique_ptr<Workspace>> spaces_;
  TiledGrid<float> distances_m_;
};

}  // namespace sidestep::edt
