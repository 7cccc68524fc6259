#pragma once

#include <cmath>
#include <vector>

#include <sidestep/robot/robot_model.hpp>

namespace sidestep {

/// Each joint at the same share of its range; of [-1, 1] where it has none.
[[nodiscard]] inline std::vector<double> configuration_at(const RobotDescription& robot,
                                                          double share) {
  std::vector<double> q;
  for (const Joint& joint : robot.joints) {
    const double lower = std::isfinite(joint.lower) ? joint.lower : -1.0;
    const double upper = std::isfinite(joint.upper) ? joint.upper : 1.0;
    q.push_back(lower + share * (upper - lower));
  }
  return q;
}

}  // namespace sidestep
