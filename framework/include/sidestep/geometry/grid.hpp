#pragma once

#include <algorithm>
#include <cstddef>
#include <cstdint>

#include <Eigen/Core>

namespace sidestep {

/// A regular grid of cubic voxels, aligned with the world axes. Voxel (i,j,k) has its centre
/// at origin + (i + 0.5, j + 0.5, k + 0.5) * resolution. Linear order: i runs fastest, then j.
struct GridSpec {
  Eigen::Vector3d origin_m = Eigen::Vector3d::Zero();  ///< Lower corner, world frame.
  double resolution_m = 0.0;                           ///< Edge of a voxel.
  Eigen::Vector3i size_vox = Eigen::Vector3i::Zero();

  [[nodiscard]] std::size_t voxel_count() const noexcept {
    return static_cast<std::size_t>(size_vox.x()) * static_cast<std::size_t>(size_vox.y()) *
           static_cast<std::size_t>(size_vox.z());
  }
  [[nodiscard]] std::size_t linear(const Eigen::Vector3i& voxel) const noexcept {
    return static_cast<std::size_t>(voxel.x()) +
           static_cast<std::size_t>(size_vox.x()) *
               (static_cast<std::size_t>(voxel.y()) +
                static_cast<std::size_t>(size_vox.y()) * static_cast<std::size_t>(voxel.z()));
  }
  [[nodiscard]] bool contains(const Eigen::Vector3i& voxel) const noexcept {
    return (voxel.array() >= 0).all() && (voxel.array() < size_vox.array()).all();
  }
  [[nodiscard]] Eigen::Vector3d centre_m(const Eigen::Vector3i& voxel) const noexcept {
    return origin_m + (voxel.cast<double>().array() + 0.5).matrix() * resolution_m;
  }
  /// The voxel that holds a point; may lie outside the grid.
  [[nodiscard]] Eigen::Vector3i voxel_at(const Eigen::Vector3d& p_world) const noexcept {
    return ((p_world - origin_m) / resolution_m).array().floor().cast<int>().matrix();
  }
  [[nodiscard]] Eigen::Vector3d upper_m() const noexcept {
    return origin_m + size_vox.cast<double>() * resolution_m;
  }
  /// Distance to the nearest face, negative outside. 1-Lipschitz.
  [[nodiscard]] double inside_m(const Eigen::Vector3d& p_world) const noexcept {
    return std::min((p_world - origin_m).minCoeff(), (upper_m() - p_world).minCoeff());
  }
  friend bool operator==(const GridSpec& a, const GridSpec& b) noexcept {
    return a.origin_m == b.origin_m && a.resolution_m == b.resolution_m && a.size_vox == b.size_vox;
  }
};

/// Edge of the cubic blocks in which maps report change and fields share memory.
inline constexpr int kBlockSide_vox = 16;

/// Blocks of a grid along each axis; the last one of an axis may be partly outside.
[[nodiscard]] inline Eigen::Vector3i block_counts(const GridSpec& grid) noexcept {
  return ((grid.size_vox.array() + (kBlockSide_vox - 1)) / kBlockSide_vox).matrix();
}

/// The linear index of a block, in the same order as voxels.
[[nodiscard]] inline std::int32_t block_linear(const Eigen::Vector3i& block,
                                               const Eigen::Vector3i& counts) noexcept {
  return block.x() + counts.x() * (block.y() + counts.y() * block.z());
}

}  // namespace sidestep
