#pragma once

#include <cstdint>

#include <sidestep/core/worker_pool.hpp>
#include <sidestep/mapping/occupancy_view.hpp>

#include "tiled_grid.hpp"

namespace sidestep::edt {

/// The exact squared Euclidean distance, in voxels, of every voxel of a grid to the nearest
/// obstacle, however far, all at once.
///
/// Along x a scan of the occupancy bits; along y and z, in place, out[i] = min over j of in[j] + (i
/// - j)^2 by divide and conquer: the minimising j grows with i, so that of the middle row bounds
/// those of either half (monotone matrix search; Aggarwal et al. 1987).
class FullTransform {
 public:
  /// Whether a grid, with squared distances cut off at `cap`, is not too large: a sum of two
  /// squared distances and a row's number share 32 bits.
  [[nodiscard]] static bool fits(const Eigen::Vector3i& size_vox, std::uint32_t cap);

  /// `cap` is the value where there is no obstacle, or none nearer. `workers` outlives this.
  FullTransform(const Eigen::Vector3i& size_vox, std::uint32_t cap, WorkerPool& workers);

  void update(const VoxelBits& obstacles);

  /// Values of a row.
  [[nodiscard]] const std::uint32_t* row(int y, int z) const noexcept { return values_.row(y, z); }

 private:
  Eigen::Vector3i size_;
  std::uint32_t cap_;
  WorkerPool& workers_;
  TiledGrid<std::uint32_t> values_;
};

}  // namespace sidestep::edt
