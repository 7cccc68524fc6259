#include <sidestep/trajectory/motion_limits.hpp>

#include <algorithm>
#include <cmath>
#include <limits>

namespace sidestep {
namespace {

bool is_known(double max_acceleration) {
  return max_acceleration > 0.0 && std::isfinite(max_acceleration);
}

double least_time_of_joint_s(double distance, double velocity, double acceleration) {
  const bool sound = velocity > 0.0 && acceleration > 0.0 && std::isfinite(distance);
  if (distance == 0.0) return 0.0;
  if (!sound) return std::numeric_limits<double>::infinity();
  if (std::isinf(acceleration)) return distance / velocity;
  // D / V + V / A grows with V beyond the peak of the triangle, which the joint does not reach.
  const double peak = std::min(velocity, std::sqrt(distance * acceleration));
  return distance / peak + peak / acceleration;
}

}  // namespace

MotionLimits motion_limits(const RobotDescription& robot, const LimitShares& shares) {
  MotionLimits limits;
  for (const Joint& joint : robot.joints) {
    const double acceleration = is_known(joint.max_acceleration)
                                    ? joint.max_acceleration
                                    : joint.max_velocity / shares.assumed_ramp_s;
    limits.velocity.push_back(shares.speed_fraction * joint.max_velocity);
    limits.acceleration.push_back(shares.acceleration_fraction * acceleration);
    limits.names.push_back(joint.name);
  }
  return limits;
}

std::vector<std::string> joints_of_unknown_acceleration(const RobotDescription& robot) {
  std::vector<std::string> names;
  for (const Joint& joint : robot.joints) {
    if (!is_known(joint.max_acceleration)) names.push_back(joint.name);
  }
  return names;
}

double least_time_s(const MotionLimits& limits, std::span<const double> q_from,
                    std::span<const double> q_to) noexcept {
  double least_s = 0.0;
  for (std::size_t j = 0; j < q_from.size(); ++j) {
    least_s = std::max(least_s, least_time_of_joint_s(std::abs(q_to[j] - q_from[j]),
                                                      limits.velocity[j], limits.acceleration[j]));
  }
  return least_s;
}

}  // namespace sidestep
