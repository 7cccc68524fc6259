#include "robot_clearance.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>

namespace sidestep {
namespace {

/// Step of a robot's first joint, the others' multiples of it: moves every link that can move.
constexpr double kMoved = 0.0371;
/// A link whose distance to a plane changes by less keeps its height above it.
constexpr double kLevel_m = 1e-9;

/// By central differences, world frame.
Eigen::Vector3d gradient_at(const SceneObject& object, const Transform& T_object_world,
                            const Eigen::Vector3d& p_world) {
  constexpr double kStep_m = 1e-5;
  Eigen::Vector3d gradient;
  for (int axis = 0; axis < 3; ++axis) {
    const Eigen::Vector3d step = kStep_m * Eigen::Vector3d::Unit(axis);
    gradient[axis] = signed_distance_m(object.shape, T_object_world * (p_world + step)) -
                     signed_distance_m(object.shape, T_object_world * (p_world - step));
  }
  return gradient;
}

}  // namespace

RobotClearance::RobotClearance(std::shared_ptr<const RobotModel> robot,
                               std::shared_ptr<const Scene> scene, std::span<const double> q_start)
    : robot_(std::move(robot)),
      scene_(std::move(scene)),
      centres_m_(robot_->description().spheres.size()) {
  if (scene_ == nullptr) return;
  const auto& spheres = robot_->description().spheres;
  const auto& objects = scene_->objects();
  ignored_.assign(robot_->description().links.size() * objects.size(), 0);
  robot_->sphere_centres(q_start, centres_m_, scratch_);
  const std::vector<Eigen::Vector3d> at_start_m = centres_m_;
  std::vector<double> q(q_start.begin(), q_start.end());
  for (std::size_t joint = 0; joint < q.size(); ++joint) {
    q[joint] += kMoved * static_cast<double>(joint + 1);
  }
  robot_->sphere_centres(q, centres_m_, scratch_);
  for (std::size_t o = 0; o < objects.size(); ++o) {
    const Transform T_object_world = objects[o].T_world_object(0.0).inverse();
    const bool is_plane = std::holds_alternative<HalfSpace>(objects[o].shape);
    const auto distance_m = [&](const Eigen::Vector3d& p_world) {
      return signed_distance_m(objects[o].shape, T_object_world * p_world);
    };
    for (std::size_t s = 0; s < spheres.size(); ++s) {
      const double start_m = distance_m(at_start_m[s]);
      const bool stands = start_m - spheres[s].radius_m < kStanding_m;
      const bool is_level = is_plane && std::abs(distance_m(centres_m_[s]) - start_m) < kLevel_m;
      if (stands || is_level) {
        ignored_[static_cast<std::size_t>(spheres[s].link) * objects.size() + o] = 1;
      }
    }
  }
}

bool RobotClearance::counts(int link, std::size_t object) const noexcept {
  return ignored_[static_cast<std::size_t>(link) * scene_->objects().size() + object] == 0;
}

Clearance RobotClearance::clearance(std::size_t sphere, double distance_m,
                                    const Eigen::Vector3d& gradient, std::string object) const {
  const RobotDescription& robot = robot_->description();
  const CollisionSphere& one = robot.spheres[sphere];
  return {distance_m, robot.links[static_cast<std::size_t>(one.link)].name, std::move(object),
          centres_m_[sphere] - one.radius_m * gradient.normalized()};
}

std::optional<Clearance> RobotClearance::to_scene(double time_s) const {
  const auto& spheres = robot_->description().spheres;
  const auto& objects = scene_->objects();
  double least_m = std::numeric_limits<double>::infinity();
  std::size_t sphere = 0, object = 0;
  for (std::size_t o = 0; o < objects.size(); ++o) {
    const Transform T_object_world = objects[o].T_world_object(time_s).inverse();
    for (std::size_t s = 0; s < spheres.size(); ++s) {
      if (!counts(spheres[s].link, o)) continue;
      const double distance_m =
          signed_distance_m(objects[o].shape, T_object_world * centres_m_[s]) - spheres[s].radius_m;
      if (distance_m >= least_m) continue;
      least_m = distance_m;
      sphere = s;
      object = o;
    }
  }
  if (least_m == std::numeric_limits<double>::infinity()) return std::nullopt;
  const SceneObject& nearest = objects[object];
  return clearance(
      sphere, least_m,
      gradient_at(nearest, nearest.T_world_object(time_s).inverse(), centres_m_[sphere]),
      nearest.name);
}

std::optional<Clearance> RobotClearance::to_field(const DistanceField& field) const {
  const auto& spheres = robot_->description().spheres;
  std::vector<double> distances_m(spheres.size());
  std::vector<Eigen::Vector3d> gradients(spheres.size());
  std::vector<FieldStatus> statuses(spheres.size());
  field.query(centres_m_, distances_m, gradients, statuses);
  std::optional<std::size_t> nearest;
  for (std::size_t s = 0; s < spheres.size(); ++s) {
    const bool is_near = distances_m[s] < field.info().max_distance_m;
    distances_m[s] -= spheres[s].radius_m;
    if (statuses[s] != FieldStatus::kKnown || !is_near) continue;
    if (!nearest || distances_m[s] < distances_m[*nearest]) nearest = s;
  }
  if (!nearest) return std::nullopt;
  return clearance(*nearest, distances_m[*nearest], gradients[*nearest], "map");
}

std::optional<Clearance> RobotClearance::find(std::span<const double> q, double time_s,
                                              const DistanceField* field) {
  robot_->sphere_centres(q, centres_m_, scratch_);
  if (scene_ != nullptr) return to_scene(time_s);
  return field == nullptr ? std::nullopt : to_field(*field);
}

}  // namespace sidestep
