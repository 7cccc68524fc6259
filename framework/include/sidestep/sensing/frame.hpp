#pragma once

#include <cmath>
#include <cstdint>
#include <optional>
#include <variant>
#include <vector>

#include <Eigen/Core>

#include <sidestep/core/time.hpp>
#include <sidestep/geometry/transform.hpp>

namespace sidestep {

/// A pinhole camera without distortion. Optical frame: z forward, x right, y down. Pixel
/// (u, v) has its centre at integer coordinates.
struct CameraIntrinsics {
  int width_px = 0;
  int height_px = 0;
  double fx_px = 0.0;
  double fy_px = 0.0;
  double cx_px = 0.0;
  double cy_px = 0.0;

  /// The point seen by pixel (u, v) at `depth_m` along z, in the optical frame.
  [[nodiscard]] Eigen::Vector3d unproject(double u, double v, double depth_m) const noexcept {
    return {(u - cx_px) / fx_px * depth_m, (v - cy_px) / fy_px * depth_m, depth_m};
  }
};

/// From a sensor's frame with x forward and z up to its optical one.
[[nodiscard]] inline Transform T_forward_optical() {
  Transform transform = Transform::Identity();
  transform.linear() << 0, 0, 1, -1, 0, 0, 0, -1, 0;
  return transform;
}

/// Where a camera was when it took a frame, and what it is.
struct CameraView {
  double stamp_s = 0.0;
  Transform T_world_camera = Transform::Identity();
  CameraIntrinsics camera;
};

/// Depth along the optical axis in metres, row by row. 0 where nothing came back (out of
/// range, dropout); NaN where the measurement is known to be wrong. Both are no measurement.
struct DepthImage {
  CameraIntrinsics camera;
  std::vector<float> depth_m;  ///< width * height values.

  [[nodiscard]] float at(int u, int v) const noexcept {
    return depth_m[static_cast<std::size_t>(v) * static_cast<std::size_t>(camera.width_px) +
                   static_cast<std::size_t>(u)];
  }
};

/// Points in the frame of the sensor: unorganised, or the beams of a laser one after the other. NaN
/// points are ignored: a beam that returned nothing.
struct PointCloud {
  std::vector<Eigen::Vector3f> points_m;
};

/// Whether all that a cloud has lies in the plane z = 0 of its frame, as the scan of a planar laser
/// does. [any]
[[nodiscard]] inline bool is_planar_scan(const PointCloud& cloud) noexcept {
  bool has_any = false;
  for (const Eigen::Vector3f& p : cloud.points_m) {
    if (!p.allFinite() || p.isZero()) continue;
    if (std::abs(p.z()) > 1e-3F) return false;
    has_any = true;
  }
  return has_any;
}

/// One measurement with its stamp, the camera's pose and the robot's joint positions.
struct Frame {
  std::int64_t sequence = 0;  ///< Number of the frame within its source.
  int sensor = 0;             ///< Of the run's sensors, the one that took it.
  Stamp stamp;
  Transform T_world_camera = Transform::Identity();
  std::variant<DepthImage, PointCloud> measurement;
  /// Joint positions at `stamp`, in the robot model's order; the mapper removes the robot's
  /// own points with them. Absent where the robot is not in view or not known.
  std::optional<Eigen::VectorXd> joint_positions;
};

}  // namespace sidestep
