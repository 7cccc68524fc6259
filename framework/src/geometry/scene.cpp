#include <sidestep/geometry/scene.hpp>

#include <algorithm>
#include <cmath>
#include <limits>

namespace sidestep {

Transform SceneObject::T_world_object(double time_s) const {
  const Waypoint& first = waypoints.front();
  const Waypoint& last = waypoints.back();
  if (repeat && moves() && time_s >= last.time_s) {
    time_s = first.time_s + std::fmod(time_s - first.time_s, last.time_s - first.time_s);
  }
  if (time_s >= last.time_s) return last.T_world_object;
  const auto after = std::ranges::upper_bound(waypoints, time_s, {}, &Waypoint::time_s);
  if (after == waypoints.begin() || after == waypoints.end()) return first.T_world_object;
  const auto before = std::prev(after);
  const double s = (time_s - before->time_s) / (after->time_s - before->time_s);
  const Eigen::Quaterniond from(before->T_world_object.linear());
  const Eigen::Quaterniond to(after->T_world_object.linear());
  Transform pose = Transform::Identity();
  pose.linear() = from.slerp(s, to).toRotationMatrix();
  pose.translation() =
      (1.0 - s) * before->T_world_object.translation() + s * after->T_world_object.translation();
  return pose;
}

SceneDistance Scene::signed_distance(const Eigen::Vector3d& p_world, double time_s) const {
  SceneDistance nearest{std::numeric_limits<double>::infinity(), -1};
  for (std::size_t i = 0; i < objects_.size(); ++i) {
    const SceneObject& object = objects_[i];
    const Transform pose =
        object.moves() ? object.T_world_object(time_s) : object.waypoints.front().T_world_object;
    const Eigen::Vector3d p_object = pose.linear().transpose() * (p_world - pose.translation());
    const double distance_m = signed_distance_m(object.shape, p_object);
    if (distance_m < nearest.distance_m) nearest = {distance_m, static_cast<int>(i)};
  }
  return nearest;
}

}  // namespace sidestep
