#include "rigid_pose.hpp"

#include <cmath>

namespace sidestep::ros_messages {

Transform RigidPose::transform() const {
  Transform transform = Transform::Identity();
  transform.linear() = rotation.toRotationMatrix();
  transform.translation() = translation_m;
  return transform;
}

std::optional<RigidPose> rigid_pose(const Eigen::Vector3d& translation_m,
                                    const Eigen::Quaterniond& rotation) {
  constexpr double kLengthTolerance = 1e-2;
  const bool is_rotation = std::abs(rotation.norm() - 1.0) <= kLengthTolerance;
  if (!translation_m.allFinite() || !is_rotation) return std::nullopt;
  // What has length 1 up to rounding stays as it was written.
  const bool is_unit = std::abs(rotation.squaredNorm() - 1.0) <= 1e-14;
  return RigidPose{translation_m, is_unit ? rotation : rotation.normalized()};
}

RigidPose rigid_pose(const Transform& transform) {
  return {transform.translation(), Eigen::Quaterniond(transform.linear()).normalized()};
}

RigidPose interpolate(const RigidPose& before, const RigidPose& after, double share) {
  if (share <= 0.0) return before;
  if (share >= 1.0) return after;
  return {(1.0 - share) * before.translation_m + share * after.translation_m,
          before.rotation.slerp(share, after.rotation).normalized()};
}

}  // namespace sidestep::ros_messages
