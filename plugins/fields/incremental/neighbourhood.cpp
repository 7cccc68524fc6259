#include "neighbourhood.hpp"

namespace sidestep::incremental {

std::vector<Eigen::Vector3i> neighbourhood(int connectivity) {
  const int farthest2 = connectivity == 6 ? 1 : connectivity == 26 ? 3 : 2;
  std::vector<Eigen::Vector3i> steps;
  for (int z = -1; z <= 1; ++z) {
    for (int y = -1; y <= 1; ++y) {
      for (int x = -1; x <= 1; ++x) {
        const Eigen::Vector3i step(x, y, z);
        if (step.squaredNorm() > 0 && step.squaredNorm() <= farthest2) steps.push_back(step);
      }
    }
  }
  if (connectivity == 24) {
    for (int axis = 0; axis < 3; ++axis) {
      for (const int length : {-kLargestStep_vox, kLargestStep_vox}) {
        steps.push_back(length * Eigen::Vector3i::Unit(axis));
      }
    }
  }
  return steps;
}

}  // namespace sidestep::incremental
