#pragma once

#include <vector>

#include <Eigen/Geometry>

namespace sidestep {

/// Boxes without overlap whose union is exactly that of the cubes around `centres_m`, which lie
/// on a grid of `resolution_m`: runs along x, joined along y where they match, then along z.
[[nodiscard]] std::vector<Eigen::AlignedBox3d> merge_voxels(
    const std::vector<Eigen::Vector3d>& centres_m, double resolution_m);

}  // namespace sidestep
