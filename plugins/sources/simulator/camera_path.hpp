#pragma once

#include <vector>

#include <sidestep/core/error.hpp>
#include <sidestep/geometry/transform.hpp>

#include "options.hpp"

namespace sidestep::simulator {

/// The pose of the optical frame (z forward, x right, y down) of a camera at `position_m` that
/// looks at `look_at_m`, upright; looking straight up or down, the image's top is as if it had
/// turned there from looking along x.
[[nodiscard]] Transform look_at(const Eigen::Vector3d& position_m,
                                const Eigen::Vector3d& look_at_m);

/// A camera's motion: position and look-at point on cubic Hermite splines whose velocity at a
/// waypoint is that from its predecessor to its successor and zero at both ends; orientations
/// given as angles by slerp. At rest before the first waypoint and after the last.
class CameraPath {
 public:
  /// Fails with kConfig, naming the waypoint, where there is none, times do not increase, or
  /// a waypoint does not say in one way where the camera looks.
  [[nodiscard]] static Result<CameraPath> create(std::vector<CameraWaypoint> waypoints);

  [[nodiscard]] Transform T_world_camera(double time_s) const;

 private:
  explicit CameraPath(std::vector<CameraWaypoint> waypoints) : waypoints_(std::move(waypoints)) {}

  std::vector<CameraWaypoint> waypoints_;
};

}  // namespace sidestep::simulator
