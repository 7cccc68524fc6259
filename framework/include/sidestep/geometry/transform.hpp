#pragma once

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

}  // namespace sidestep
