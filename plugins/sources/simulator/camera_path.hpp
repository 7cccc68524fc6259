#pragma once

#include <utility>
#include <vector>

#include <sidestep/geometry/transform.hpp>

#include "options.hpp"

namespace sidestep::simulator {

/// The pose of the optical frame (z forward, x right, y down) of a camera at `position_m` that
/// looks at `look_at_m`, upright; looking straight up or down, the image's top is as if it had
/// turned there from looking along x.
[[nodiscard]] Transform look_at(const Eigen::Vector3d& position_m,
                                const Eigen::Vector3d& look_at_m);

/// What is wrong with the parameter `camera_path`: no waypoint, times that do not increase, a
/// waypoint that does not say in one way where the camera looks.
[[nodiscard]] std::vector<OptionMistake> check_camera_path(
    const std::vector<CameraWaypoint>& waypoints);

/// A camera's motion: position and look-at point on cubic Hermite splines whose velocity at a
/// waypoint is that from its predecessor to its successor and zero at both ends; orientations
/// given as angles by slerp. At rest before the first waypoint; after the last one at rest, or,
/// where the path repeats, at the first again.
class CameraPath {
 public:
  /// check_camera_path() must find nothing wrong with the waypoints.
  explicit CameraPath(std::vector<CameraWaypoint> waypoints, bool repeats = false)
      : waypoints_(std::move(waypoints)), repeats_(repeats) {}

  [[nodiscard]] Transform T_world_camera(double time_s) const;

 private:
  std::vector<CameraWaypoint> waypoints_;
  bool repeats_;
};

}  // namespace sidestep::simulator
