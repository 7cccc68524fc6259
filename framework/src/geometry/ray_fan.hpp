#pragma once

#include <limits>
#include <span>

#include <sidestep/core/index.hpp>
#include <sidestep/geometry/shape.hpp>

namespace sidestep {

/// Some rays of one origin, and how far each goes before it meets something. The same geometry as
/// ray_caster.cpp, for all of them at once and without normals.
class RayFan {
 public:
  static constexpr int kRays = 64;

  /// 1 to kRays unit directions.
  void set(const Eigen::Vector3d& origin, std::span<const Eigen::Vector3d> directions);

  /// Whether a ball may be met; true at least where it is.
  [[nodiscard]] bool may_meet(const Eigen::Vector3d& centre, double radius_m) const;

  /// Shortens those rays that meet a shape before what they met so far.
  void meet(const Box& box, const Transform& T_world_shape);
  void meet(const Sphere& sphere, const Transform& T_world_shape);
  void meet(const Cylinder& cylinder, const Transform& T_world_shape);
  void meet(const Capsule& capsule, const Transform& T_world_shape);
  void meet(const HalfSpace& half_space, const Transform& T_world_shape);

  /// Infinity where nothing is met; as many as directions.
  [[nodiscard]] std::span<const double> distances_m() const { return {nearest_m_, idx(count_)}; }

 private:
  struct Local;

  Eigen::Vector3d origin_;
  int count_ = 0;
  Eigen::Vector3d axis_;  ///< Of a cone around the rays.
  double cos_angle_ = 1.0;
  double sin_angle_ = 0.0;
  alignas(64) double direction_[3][kRays];
  alignas(64) double nearest_m_[kRays];
};

}  // namespace sidestep
