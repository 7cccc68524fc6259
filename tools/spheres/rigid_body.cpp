#include "rigid_body.hpp"

#include <algorithm>
#include <cmath>
#include <limits>

#include <sidestep/core/index.hpp>

namespace sidestep {
namespace {

bool has_volume(const Shape& shape) { return (bounds_of(shape).half_m.array() > 0.0).all(); }

struct Bounds {
  ShapeBounds operator()(const Box& box) const {
    return {Eigen::Vector3d::Zero(), 0.5 * box.size_m};
  }
  ShapeBounds operator()(const Sphere& sphere) const {
    return {Eigen::Vector3d::Zero(), Eigen::Vector3d::Constant(sphere.radius_m)};
  }
  ShapeBounds operator()(const Cylinder& cylinder) const {
    const double r = cylinder.radius_m;
    return {Eigen::Vector3d::Zero(), {r, r, 0.5 * cylinder.length_m}};
  }
  ShapeBounds operator()(const Capsule& capsule) const {
    const double r = capsule.radius_m;
    return {Eigen::Vector3d::Zero(), {r, r, 0.5 * capsule.length_m + r}};
  }
  ShapeBounds operator()(const HalfSpace&) const { return {}; }
  ShapeBounds operator()(const std::shared_ptr<const Mesh>& mesh) const {
    if (mesh == nullptr || mesh->triangles.empty()) return {};
    Eigen::Vector3d lower = mesh->vertices_m.front();
    Eigen::Vector3d upper = lower;
    for (const Eigen::Vector3d& vertex : mesh->vertices_m) {
      lower = lower.cwiseMin(vertex);
      upper = upper.cwiseMax(vertex);
    }
    return {0.5 * (lower + upper), 0.5 * (upper - lower)};
  }
};

}  // namespace

ShapeBounds bounds_of(const Shape& shape) { return std::visit(Bounds{}, shape); }

const BodyLink* RigidBody::find(int link) const noexcept {
  const auto found = std::ranges::find(links, link, &BodyLink::link);
  return found == links.end() ? nullptr : &*found;
}

std::vector<RigidBody> rigid_bodies(const KinematicTree& robot) {
  const RobotDescription& description = robot.description();
  std::vector<RigidBody> bodies;
  std::vector<std::size_t> body_of_link(description.links.size());
  std::vector<Transform> T_body_link(description.links.size(), Transform::Identity());
  for (std::size_t link = 0; link < description.links.size(); ++link) {
    const TreeJoint& joint = robot.tree_joints()[link];
    const int parent = description.links[link].parent;
    if (parent == -1 || joint.motion != TreeJoint::Motion::kFixed) {
      body_of_link[link] = bodies.size();
      bodies.emplace_back();
    } else {
      body_of_link[link] = body_of_link[idx(parent)];
      T_body_link[link] = T_body_link[idx(parent)] * joint.T_parent_joint;
    }
    bodies[body_of_link[link]].links.push_back({static_cast<int>(link), T_body_link[link]});
  }
  for (const CollisionShape& one : description.shapes) {
    if (!has_volume(one.shape)) continue;
    const Transform T_body_shape = T_body_link[idx(one.link)] * one.T_link_shape;
    bodies[body_of_link[idx(one.link)]].parts.push_back(
        {one.link, one.shape, T_body_shape, T_body_shape.inverse()});
  }
  return bodies;
}

Eigen::Vector3d to_grain(const Eigen::Vector3d& p) {
  return (p * kGrainsPerMetre).array().round().matrix() / kGrainsPerMetre;
}

double up_to_grain(double radius_m) {
  return std::ceil(radius_m * kGrainsPerMetre - 1e-6) / kGrainsPerMetre;
}

double signed_distance_m(const RigidBody& body, const Eigen::Vector3d& p_body) {
  double nearest = std::numeric_limits<double>::infinity();
  for (const BodyPart& part : body.parts) {
    nearest = std::min(nearest, signed_distance_m(part.shape, part.T_shape_body * p_body));
  }
  return nearest;
}

std::vector<BodySphere> spheres_of(const RigidBody& body,
                                   const std::vector<CollisionSphere>& spheres) {
  std::vector<BodySphere> own;
  for (const CollisionSphere& sphere : spheres) {
    const BodyLink* const link = body.find(sphere.link);
    if (link == nullptr) continue;
    own.push_back({sphere.link, link->T_body_link * sphere.centre_link_m, sphere.radius_m});
  }
  return own;
}

}  // namespace sidestep
