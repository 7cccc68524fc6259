#pragma once

#include <limits>

#include <sidestep/geometry/shape.hpp>

namespace sidestep {

/// Where a ray meets a surface: `distance_m` along it, and the surface's outward normal.
struct ShapeHit {
  double distance_m = std::numeric_limits<double>::infinity();
  Eigen::Vector3d normal = Eigen::Vector3d::Zero();
};

/// The first point of an analytic shape's surface that a ray in the shape's frame meets ahead
/// of its origin; infinity without one. `direction` has unit length.
[[nodiscard]] ShapeHit first_hit(const Box& box, const Eigen::Vector3d& origin,
                                 const Eigen::Vector3d& direction);
[[nodiscard]] ShapeHit first_hit(const Sphere& sphere, const Eigen::Vector3d& origin,
                                 const Eigen::Vector3d& direction);
[[nodiscard]] ShapeHit first_hit(const Cylinder& cylinder, const Eigen::Vector3d& origin,
                                 const Eigen::Vector3d& direction);
[[nodiscard]] ShapeHit first_hit(const Capsule& capsule, const Eigen::Vector3d& origin,
                                 const Eigen::Vector3d& direction);
[[nodiscard]] ShapeHit first_hit(const HalfSpace& half_space, const Eigen::Vector3d& origin,
                                 const Eigen::Vector3d& direction);

/// Half the edges of the smallest box around the origin, aligned with the shape's frame.
[[nodiscard]] Eigen::Vector3d half_extent_m(const Box& box);
[[nodiscard]] Eigen::Vector3d half_extent_m(const Sphere& sphere);
[[nodiscard]] Eigen::Vector3d half_extent_m(const Cylinder& cylinder);
[[nodiscard]] Eigen::Vector3d half_extent_m(const Capsule& capsule);

}  // namespace sidestep
