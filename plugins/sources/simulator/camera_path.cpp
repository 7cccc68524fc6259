#include "camera_path.hpp"

#include <algorithm>
#include <cmath>
#include <string>

namespace sidestep::simulator {
namespace {

constexpr double kNowhere_m = 1e-6;

/// From the body of a camera, x forward and z up, to its optical frame (REP-103).
Eigen::Matrix3d R_body_optical() {
  Eigen::Matrix3d rotation;
  rotation << 0, 0, 1, -1, 0, 0, 0, -1, 0;
  return rotation;
}

Eigen::Quaterniond body_orientation(const Eigen::Vector3d& rpy_rad) {
  return Eigen::Quaterniond(transform_from_xyz_rpy(Eigen::Vector3d::Zero(), rpy_rad).linear());
}

/// A spline through one vector of each waypoint.
template <class Value>
Eigen::Vector3d hermite(const std::vector<CameraWaypoint>& waypoints, std::size_t from,
                        double time_s, Value&& value) {
  const auto time = [&](std::size_t i) { return waypoints[i].time_s; };
  const auto velocity = [&](std::size_t i) -> Eigen::Vector3d {
    if (i == 0 || i + 1 == waypoints.size()) return Eigen::Vector3d::Zero();
    return (value(i + 1) - value(i - 1)) / (time(i + 1) - time(i - 1));
  };
  const double h = time(from + 1) - time(from);
  const double s = (time_s - time(from)) / h;
  const double s2 = s * s;
  const double s3 = s2 * s;
  return (2 * s3 - 3 * s2 + 1) * value(from) + (s3 - 2 * s2 + s) * h * velocity(from) +
         (3 * s2 - 2 * s3) * value(from + 1) + (s3 - s2) * h * velocity(from + 1);
}

}  // namespace

Transform look_at(const Eigen::Vector3d& position_m, const Eigen::Vector3d& look_at_m) {
  const Eigen::Vector3d forward = (look_at_m - position_m).normalized();
  Eigen::Vector3d right = forward.cross(Eigen::Vector3d::UnitZ());
  if (right.norm() < kNowhere_m) {
    right = forward.cross(Eigen::Vector3d(-std::copysign(1.0, forward.z()), 0.0, 0.0));
  }
  right.normalize();
  Transform pose = Transform::Identity();
  pose.translation() = position_m;
  pose.linear() << right, forward.cross(right), forward;
  return pose;
}

std::vector<OptionMistake> check_camera_path(const std::vector<CameraWaypoint>& waypoints) {
  std::vector<OptionMistake> mistakes;
  if (waypoints.empty()) mistakes.push_back({{"camera_path"}, "needs a waypoint", {}});
  for (std::size_t i = 0; i < waypoints.size(); ++i) {
    const CameraWaypoint& waypoint = waypoints[i];
    const std::string name = "camera_path[" + std::to_string(i) + "]";
    if (i > 0 && waypoint.time_s <= waypoints[i - 1].time_s) {
      mistakes.push_back({{name + ".time_s"}, "must be greater than the one before", {}});
    }
    if (waypoint.look_at_m.has_value() == waypoint.rpy_rad.has_value()) {
      mistakes.push_back({{name}, "needs either look_at_m or rpy_rad", {}});
    } else if (waypoint.look_at_m.has_value() != waypoints[0].look_at_m.has_value()) {
      mistakes.push_back(
          {{name}, "and camera_path[0] must both have look_at_m or both rpy_rad", {}});
    }
    if (waypoint.look_at_m && (*waypoint.look_at_m - waypoint.position_m).norm() < kNowhere_m) {
      mistakes.push_back({{name + ".look_at_m"}, "is where the camera itself is", {}});
    }
  }
  return mistakes;
}

Transform CameraPath::T_world_camera(double time_s) const {
  const double first_s = waypoints_.front().time_s;
  const double last_s = waypoints_.back().time_s;
  if (repeats_ && time_s > last_s && last_s > first_s) {
    time_s = first_s + std::fmod(time_s - first_s, last_s - first_s);
  }
  time_s = std::clamp(time_s, first_s, last_s);
  const auto after = std::ranges::upper_bound(waypoints_, time_s, {}, &CameraWaypoint::time_s);
  const auto from = static_cast<std::size_t>(after - waypoints_.begin()) - 1;
  const bool at_end = from + 1 == waypoints_.size();
  const CameraWaypoint& begin = waypoints_[from];

  const Eigen::Vector3d position_m =
      at_end ? begin.position_m : hermite(waypoints_, from, time_s, [&](std::size_t i) {
        return waypoints_[i].position_m;
      });
  if (begin.look_at_m) {
    return look_at(position_m, at_end ? *begin.look_at_m
                                      : hermite(waypoints_, from, time_s,
                                                [&](auto i) { return *waypoints_[i].look_at_m; }));
  }
  Eigen::Quaterniond orientation = body_orientation(*begin.rpy_rad);
  if (!at_end) {
    const CameraWaypoint& end = waypoints_[from + 1];
    orientation = orientation.slerp((time_s - begin.time_s) / (end.time_s - begin.time_s),
                                    body_orientation(*end.rpy_rad));
  }
  Transform pose = Transform::Identity();
  pose.translation() = position_m;
  pose.linear() = orientation.toRotationMatrix() * R_body_optical();
  return pose;
}

}  // namespace sidestep::simulator
