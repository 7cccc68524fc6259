#pragma once

#include <cmath>

#include <Eigen/Geometry>

namespace sidestep {

/// A rigid transform. `T_world_camera` maps camera coordinates to world coordinates.
using Transform = Eigen::Isometry3d;

/// Fixed-axis roll, pitch, yaw as URDF writes them: R = Rz(yaw) Ry(pitch) Rx(roll).
[[nodiscard]] inline Transform transform_from_xyz_rpy(const Eigen::Vector3d& xyz_m,
                                                      const Eigen::Vector3d& rpy_rad) {
  Transform transform = Transform::Identity();
  transform.translate(xyz_m);
  transform.rotate(Eigen::AngleAxisd(rpy_rad.z(), Eigen::Vector3d::UnitZ()) *
                   Eigen::AngleAxisd(rpy_rad.y(), Eigen::Vector3d::UnitY()) *
                   Eigen::AngleAxisd(rpy_rad.x(), Eigen::Vector3d::UnitX()));
  return transform;
}

/// As transform_from_xyz_rpy() takes them; where roll and yaw are about one axis, all of it is yaw.
[[nodiscard]] inline Eigen::Vector3d rpy_of(const Eigen::Matrix3d& R) {
  const double pitch = std::atan2(-R(2, 0), std::hypot(R(2, 1), R(2, 2)));
  constexpr double kUpright = 1e-9;
  if (std::hypot(R(2, 1), R(2, 2)) < kUpright) {
    return {0.0, pitch, std::atan2(-R(0, 1), R(1, 1))};
  }
  return {std::atan2(R(2, 1), R(2, 2)), pitch, std::atan2(R(1, 0), R(0, 0))};
}

}  // namespace sidestep
