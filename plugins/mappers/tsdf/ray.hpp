#pragma once

#include <cstdint>
#include <vector>

#include <Eigen/Core>

#include <sidestep/geometry/grid.hpp>

namespace sidestep::tsdf {

/// One ray to integrate; positions in voxels from the grid's lower corner.
struct Ray {
  Eigen::Vector3d end_vox;
  Eigen::Vector3d direction;  ///< Unit vector from the camera to the end.
  double length_vox = 0.0;    ///< From the camera to the end.
  float weight = 0.0F;
  bool hit = false;  ///< Whether the end is a surface, else it is free.
};

/// The voxels in which a ray crosses one block.
struct Segment {
  std::int32_t block;
  std::uint32_t ray;    ///< Index into the trace's rays.
  std::uint32_t first;  ///< Index into the trace's voxels.
  std::uint32_t count;
};

/// A share of a frame's rays, and the voxels that they cross.
struct Trace {
  std::vector<Ray> rays;
  std::vector<Segment> segments;
  std::vector<std::uint16_t> voxels;  ///< Within their block: x + 16 (y + 16 z).

  void clear() noexcept {
    rays.clear();
    segments.clear();
    voxels.clear();
  }
};

/// A voxel's index within its block.
[[nodiscard]] inline int index_in_block(const Eigen::Vector3i& voxel) noexcept {
  constexpr int kMask = kBlockSide_vox - 1;
  return (voxel.x() & kMask) +
         kBlockSide_vox * ((voxel.y() & kMask) + kBlockSide_vox * (voxel.z() & kMask));
}

}  // namespace sidestep::tsdf
