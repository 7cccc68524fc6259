#include <sidestep/geometry/scene.hpp>

#include <algorithm>
#include <cmath>
#include <limits>
#include <random>

#include <sidestep/core/seed.hpp>

namespace sidestep {
namespace {

double draw(const MotionRanges::Range& range, std::mt19937_64& generator) {
  return std::uniform_real_distribution<double>(range.lower, range.upper)(generator);
}

void draw_motion(SceneObject& object, const MotionRanges& ranges, std::uint64_t seed) {
  std::mt19937_64 generator(derive_seed(seed, object.name));
  const double delay_s = draw(ranges.delay_s, generator);
  const double speed = draw(ranges.speed, generator);
  Eigen::Vector3d offset_m;
  for (std::size_t axis = 0; axis < 3; ++axis) {
    offset_m[static_cast<Eigen::Index>(axis)] = draw(ranges.offset_m[axis], generator);
  }
  for (Waypoint& waypoint : object.waypoints) {
    waypoint.time_s = delay_s + waypoint.time_s / speed;
    waypoint.T_world_object.translation() += offset_m;
  }
}

}  // namespace

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

Scene Scene::drawn(std::uint64_t seed) const {
  std::vector<SceneObject> objects = objects_;
  for (SceneObject& object : objects) {
    if (!object.random) continue;
    draw_motion(object, *object.random, seed);
    object.random.reset();
  }
  return Scene(std::move(objects));
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
