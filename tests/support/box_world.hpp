#pragma once

#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>
#include <vector>

#include <sidestep/sensing/frame.hpp>

namespace sidestep::testing_support {

/// A world of axis-aligned boxes, seen by an ideal depth camera: rays against slabs.
struct BoxWorld {
  struct Box {
    Eigen::Vector3d lower_m;
    Eigen::Vector3d upper_m;
  };
  std::vector<Box> boxes;

  /// Parameter of the first surface along from + t * direction, t > 0; infinity without one.
  [[nodiscard]] double cast(const Eigen::Vector3d& from, const Eigen::Vector3d& direction) const {
    double nearest = std::numeric_limits<double>::infinity();
    for (const Box& box : boxes) {
      double enter = -std::numeric_limits<double>::infinity();
      double leave = std::numeric_limits<double>::infinity();
      for (int axis = 0; axis < 3; ++axis) {
        const double a = (box.lower_m[axis] - from[axis]) / direction[axis];
        const double b = (box.upper_m[axis] - from[axis]) / direction[axis];
        enter = std::max(enter, std::min(a, b));
        leave = std::min(leave, std::max(a, b));
      }
      if (enter <= leave && enter > 0.0) nearest = std::min(nearest, enter);
    }
    return nearest;
  }

  /// Depth 0 where a ray meets nothing.
  [[nodiscard]] DepthImage render(const CameraIntrinsics& camera,
                                  const Transform& T_world_camera) const {
    DepthImage image{camera, {}};
    for (int v = 0; v < camera.height_px; ++v) {
      for (int u = 0; u < camera.width_px; ++u) {
        const Eigen::Vector3d ray = T_world_camera.linear() * camera.unproject(u, v, 1.0);
        const double depth_m = cast(T_world_camera.translation(), ray);
        image.depth_m.push_back(std::isfinite(depth_m) ? static_cast<float>(depth_m) : 0.0F);
      }
    }
    return image;
  }

  [[nodiscard]] Frame frame(std::int64_t sequence, const CameraIntrinsics& camera,
                            const Transform& T_world_camera) const {
    Frame frame;
    frame.sequence = sequence;
    frame.stamp = Stamp::from_seconds(static_cast<double>(sequence) / 30.0);
    frame.T_world_camera = T_world_camera;
    frame.measurement = render(camera, T_world_camera);
    return frame;
  }
};

/// A camera at `eye` that looks at `target`, image upright in a world with z up.
[[nodiscard]] inline Transform look_at(const Eigen::Vector3d& eye, const Eigen::Vector3d& target) {
  const Eigen::Vector3d forward = (target - eye).normalized();
  const Eigen::Vector3d up =
      std::abs(forward.z()) < 0.99 ? Eigen::Vector3d::UnitZ() : Eigen::Vector3d::UnitX();
  const Eigen::Vector3d right = forward.cross(up).normalized();
  Transform pose = Transform::Identity();
  pose.linear().col(0) = right;
  pose.linear().col(1) = forward.cross(right);
  pose.linear().col(2) = forward;
  pose.translation() = eye;
  return pose;
}

/// The Kinect's field of view at any size.
[[nodiscard]] inline CameraIntrinsics kinect(int width_px, int height_px) {
  const double focal_px = 585.0 * width_px / 640.0;
  return {width_px, height_px, focal_px, focal_px, width_px / 2.0, height_px / 2.0};
}

}  // namespace sidestep::testing_support
