#pragma once

#include <sidestep/geometry/shape.hpp>
#include <sidestep/geometry/transform.hpp>

namespace sidestep {

/// A convex shape in the world; a mesh stands for its hull, a half-space is none.
struct PlacedShape {
  const Shape* shape = nullptr;
  Transform T_world_shape = Transform::Identity();

  /// A point of it that is farthest along a direction.
  [[nodiscard]] Eigen::Vector3d farthest(const Eigen::Vector3d& direction) const;
};

/// The radius of the ball about its origin that holds a shape.
[[nodiscard]] double reach_m(const Shape& shape);

/// How far apart two shapes are along a direction from `a` to `b`, at least: no more than their
/// distance, whatever the direction. A half-space may be `b`.
[[nodiscard]] double gap_m(const PlacedShape& a, const PlacedShape& b,
                           const Eigen::Vector3d& direction);

/// Two points, one of each shape.
struct NearestPoints {
  Eigen::Vector3d p_a = Eigen::Vector3d::Zero();
  Eigen::Vector3d p_b = Eigen::Vector3d::Zero();
  bool overlap = false;  ///< The two points are the same, to 1e-9 m.
};
/// As near as can be found, by the algorithm of Gilbert, Johnson and Keerthi (1988). Of shapes that
/// are more than `near_m` apart it may end sooner, once it is known whether they are more than
/// `wanted_m` apart.
[[nodiscard]] NearestPoints nearest_points(const PlacedShape& a, const PlacedShape& b,
                                           double near_m, double wanted_m);

}  // namespace sidestep
