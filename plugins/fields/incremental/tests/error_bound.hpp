#pragma once

#include <algorithm>
#include <cmath>

#include "closest_obstacles.hpp"

namespace sidestep::incremental {

/// How far the distance of a voxel can be too large, in voxels, when none of its neighbours' is: by
/// the triangle inequality no more than the detour over the best neighbour. For obstacles up to
/// `reach_vox` away.
[[nodiscard]] inline double detour_vox(int connectivity, double reach_vox) {
  const auto steps = neighbourhood(connectivity);
  const int reach = static_cast<int>(std::floor(reach_vox));
  double largest = 0.0;
  // By symmetry, directions with x >= y >= z >= 0 tell all.
  for (int x = 1; x <= reach; ++x) {
    for (int y = 0; y <= x; ++y) {
      for (int z = 0; z <= y; ++z) {
        const Eigen::Vector3d obstacle(x, y, z);
        if (obstacle.norm() > reach_vox) continue;
        double best = reach_vox;
        for (const Eigen::Vector3i& s : steps) {
          const Eigen::Vector3d step = s.cast<double>();
          best = std::min(best, step.norm() + (obstacle - step).norm() - obstacle.norm());
        }
        largest = std::max(largest, best);
      }
    }
  }
  return largest;
}

}  // namespace sidestep::incremental
