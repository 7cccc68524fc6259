#include <sidestep/geometry/shape.hpp>

#include <algorithm>
#include <array>
#include <cmath>

#include "mesh_index.hpp"

namespace sidestep {
namespace {

double distance_to(const Box& box, const Eigen::Vector3d& p) {
  const Eigen::Vector3d beyond = p.cwiseAbs() - 0.5 * box.size_m;
  return beyond.cwiseMax(0.0).norm() + std::min(beyond.maxCoeff(), 0.0);
}

double distance_to(const Sphere& sphere, const Eigen::Vector3d& p) {
  return p.norm() - sphere.radius_m;
}

/// A cylinder is a rectangle in the half-plane of (distance to the axis, height).
double distance_to(const Cylinder& cylinder, const Eigen::Vector3d& p) {
  const Eigen::Vector2d beyond(p.head<2>().norm() - cylinder.radius_m,
                               std::abs(p.z()) - 0.5 * cylinder.length_m);
  return beyond.cwiseMax(0.0).norm() + std::min(beyond.maxCoeff(), 0.0);
}

double distance_to(const Capsule& capsule, const Eigen::Vector3d& p) {
  const double half_m = 0.5 * capsule.length_m;
  const Eigen::Vector3d nearest_on_axis(0.0, 0.0, std::clamp(p.z(), -half_m, half_m));
  return (p - nearest_on_axis).norm() - capsule.radius_m;
}

double distance_to(const HalfSpace&, const Eigen::Vector3d& p) { return p.z(); }

double distance_to(const std::shared_ptr<const Mesh>& mesh, const Eigen::Vector3d& p) {
  return mesh->index ? mesh->index->signed_distance_m(p) : brute_force_signed_distance_m(*mesh, p);
}

}  // namespace

std::string_view shape_name(const Shape& shape) noexcept {
  constexpr std::array<std::string_view, std::variant_size_v<Shape>> kNames = {
      "box", "sphere", "cylinder", "capsule", "half_space", "mesh"};
  return kNames[shape.index()];
}

double signed_distance_m(const Shape& shape, const Eigen::Vector3d& p_shape) {
  return std::visit([&](const auto& one) { return distance_to(one, p_shape); }, shape);
}

std::shared_ptr<const Mesh> indexed_mesh(Mesh mesh) {
  mesh.index = std::make_shared<const MeshIndex>(mesh);
  return std::make_shared<const Mesh>(std::move(mesh));
}

}  // namespace sidestep
