#pragma once

#include <optional>

#include <Eigen/Geometry>

#include <sidestep/geometry/transform.hpp>

namespace sidestep::ros_messages {

/// A rigid transform as messages carry it, and as it is interpolated. The rotation has length 1.
struct RigidPose {
  Eigen::Vector3d translation_m = Eigen::Vector3d::Zero();
  Eigen::Quaterniond rotation = Eigen::Quaterniond::Identity();

  [[nodiscard]] Transform transform() const;
};

/// A message's figures as a pose; nothing where one is not finite, or the quaternion's length is
/// off 1 by more than 0.01. [any]
[[nodiscard]] std::optional<RigidPose> rigid_pose(const Eigen::Vector3d& translation_m,
                                                  const Eigen::Quaterniond& rotation);

/// The pose of a transform.
[[nodiscard]] RigidPose rigid_pose(const Transform& transform);

/// Between `before` (share 0) and `after` (share 1): linear in position, slerp in orientation; at
/// either end that pose itself, bit for bit. [any]
[[nodiscard]] RigidPose interpolate(const RigidPose& before, const RigidPose& after, double share);

}  // namespace sidestep::ros_messages
