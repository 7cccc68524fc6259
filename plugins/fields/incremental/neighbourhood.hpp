#pragma once

#include <vector>

#include <Eigen/Core>

namespace sidestep::incremental {

/// No step of a neighbourhood is longer along an axis.
inline constexpr int kLargestStep_vox = 2;

/// The steps to a voxel's neighbours. 6: faces; 18: and edges; 26: and corners; 24: faces, edges,
/// and two voxels along each axis, as FIESTA is published.
[[nodiscard]] std::vector<Eigen::Vector3i> neighbourhood(int connectivity);

}  // namespace sidestep::incremental
