#pragma once

#include <vector>

#include <sidestep/geometry/grid.hpp>
#include <sidestep/mapping/point_rules.hpp>
#include <sidestep/mapping/self_filter.hpp>
#include <sidestep/sensing/frame.hpp>

#include "kernels.hpp"

/// A frame's camera as the kernels of the projective method want it, here and on a GPU.
namespace sidestep::voxel_grid {

inline constexpr double kNear_m = 0.01;
/// Guards the tests of whole blocks against the rounding of single precision.
inline constexpr float kDepthSlack_m = 1e-4F;
inline constexpr int kPixelSlack = 1;

/// The camera over the voxels of a grid.
struct GridView {
  Projection projection;    ///< All but its image.
  Eigen::Vector3d base;     ///< As Projection's base, for voxel (0, 0, 0) of the grid.
  Eigen::Matrix3d columns;  ///< Per voxel.

  /// As Projection's base, for the first voxel of a block. The order of the sum is part of what it
  /// promises: elsewhere the same order gives the same bits.
  [[nodiscard]] Eigen::Vector3d first(const Eigen::Vector3i& block) const {
    const Eigen::Vector3d at = (block * kBlockSide_vox).cast<double>();
    Eigen::Vector3d sum;
    for (int c = 0; c < 3; ++c) {
      sum[c] =
          base[c] + ((columns(c, 0) * at.x() + columns(c, 1) * at.y()) + columns(c, 2) * at.z());
    }
    return sum;
  }
};
[[nodiscard]] GridView view_of_grid(const Frame& frame, const CameraIntrinsics& camera,
                                    const GridSpec& grid, float band_m);

/// Half-width of the band around the measured depth that is hit.
[[nodiscard]] float band_m(const VoxelGridOptions& options);
/// The lowest layer of voxels whose centres lie above the floor's clearance.
[[nodiscard]] int first_surface_layer(const VoxelGridOptions& options);

[[nodiscard]] PixelRules pixel_rules(const GridSpec& grid, const PointRules& rules,
                                     bool clear_no_return, float band_m);

/// The rays of an image's pixels.
class PixelRays {
 public:
  PixelRays(const Frame& frame, const CameraIntrinsics& camera, const GridSpec& grid);

  /// What the pixels of row v have in common, from its first one on: no depth, no image.
  [[nodiscard]] PixelRow row(int v) const;

 private:
  const CameraIntrinsics& camera_;
  Eigen::Matrix3d rotation_vox_;
  Eigen::Vector3d start_vox_;
};

/// The robot's balls that a camera may see.
[[nodiscard]] std::vector<CameraBall> balls_in_view(const Frame& frame,
                                                    const CameraIntrinsics& camera,
                                                    const SelfFilter& self);

}  // namespace sidestep::voxel_grid
