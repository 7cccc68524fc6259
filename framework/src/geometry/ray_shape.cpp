#include "ray_shape.hpp"

#include <algorithm>
#include <array>
#include <cmath>

#include <sidestep/core/index.hpp>

namespace sidestep {
namespace {

/// Both crossings of a convex surface, the nearer first; empty if enter_m > leave_m.
struct Crossings {
  double enter_m = std::numeric_limits<double>::infinity();
  double leave_m = -std::numeric_limits<double>::infinity();

  /// The crossing ahead of the ray's origin; infinity if there is none.
  [[nodiscard]] double first_ahead_m() const {
    if (enter_m > leave_m || leave_m <= 0.0) return std::numeric_limits<double>::infinity();
    return enter_m > 0.0 ? enter_m : leave_m;
  }
};

/// Where origin + t direction lies within [-half, half].
Crossings cross_slab(double origin, double direction, double half) {
  if (direction == 0.0) {
    return std::abs(origin) <= half ? Crossings{-kInfinity, kInfinity} : Crossings{};
  }
  const double a = (-half - origin) / direction;
  const double b = (half - origin) / direction;
  return {std::min(a, b), std::max(a, b)};
}

/// Where a t^2 + 2 b t + c <= 0. The form of the roots avoids cancellation.
Crossings cross_quadric(double a, double b, double c) {
  if (a <= 0.0) return c <= 0.0 ? Crossings{-kInfinity, kInfinity} : Crossings{};
  const double discriminant = b * b - a * c;
  if (discriminant < 0.0) return {};
  const double q = -(b + std::copysign(std::sqrt(discriminant), b));
  const double first = q / a;
  const double second = q != 0.0 ? c / q : first;
  return {std::min(first, second), std::max(first, second)};
}

Crossings cross_ball(const Eigen::Vector3d& centre, double radius_m, const Eigen::Vector3d& origin,
                     const Eigen::Vector3d& direction) {
  // Around the ray's point nearest to the centre, so that distant spheres keep their digits.
  const double nearest_m = (centre - origin).dot(direction);
  const double gap2 = (origin + nearest_m * direction - centre).squaredNorm();
  if (gap2 > radius_m * radius_m) return {};
  const double half_chord_m = std::sqrt(radius_m * radius_m - gap2);
  return {nearest_m - half_chord_m, nearest_m + half_chord_m};
}

Crossings cross_tube(double radius_m, const Eigen::Vector3d& origin,
                     const Eigen::Vector3d& direction) {
  return cross_quadric(direction.head<2>().squaredNorm(), origin.head<2>().dot(direction.head<2>()),
                       origin.head<2>().squaredNorm() - radius_m * radius_m);
}

Crossings intersection(const Crossings& a, const Crossings& b) {
  return {std::max(a.enter_m, b.enter_m), std::min(a.leave_m, b.leave_m)};
}

}  // namespace

ShapeHit first_hit(const Box& box, const Eigen::Vector3d& origin,
                   const Eigen::Vector3d& direction) {
  std::array<Crossings, 3> slabs;
  Crossings inside{-kInfinity, kInfinity};
  for (int axis = 0; axis < 3; ++axis) {
    auto& slab = slabs[idx(axis)];
    slab = cross_slab(origin[axis], direction[axis], 0.5 * box.size_m[axis]);
    inside = intersection(inside, slab);
  }
  ShapeHit hit{inside.first_ahead_m()};
  for (int axis = 0; axis < 3; ++axis) {
    const auto& slab = slabs[idx(axis)];
    if (hit.distance_m == slab.enter_m || hit.distance_m == slab.leave_m) {
      const bool enters = hit.distance_m == slab.enter_m;
      hit.normal = Eigen::Vector3d::Unit(axis) *
                   std::copysign(1.0, enters ? -direction[axis] : direction[axis]);
      break;
    }
  }
  return hit;
}

ShapeHit first_hit(const Sphere& sphere, const Eigen::Vector3d& origin,
                   const Eigen::Vector3d& direction) {
  ShapeHit hit{
      cross_ball(Eigen::Vector3d::Zero(), sphere.radius_m, origin, direction).first_ahead_m()};
  if (hit.distance_m < kInfinity) hit.normal = (origin + hit.distance_m * direction).normalized();
  return hit;
}

ShapeHit first_hit(const Cylinder& cylinder, const Eigen::Vector3d& origin,
                   const Eigen::Vector3d& direction) {
  const Crossings slab = cross_slab(origin.z(), direction.z(), 0.5 * cylinder.length_m);
  const Crossings tube = cross_tube(cylinder.radius_m, origin, direction);
  ShapeHit hit{intersection(slab, tube).first_ahead_m()};
  if (hit.distance_m == kInfinity) return hit;
  const Eigen::Vector3d p = origin + hit.distance_m * direction;
  if (hit.distance_m == slab.enter_m || hit.distance_m == slab.leave_m) {
    hit.normal = Eigen::Vector3d::UnitZ() * std::copysign(1.0, p.z());
  } else {
    hit.normal = Eigen::Vector3d(p.x(), p.y(), 0.0).normalized();
  }
  return hit;
}

ShapeHit first_hit(const Capsule& capsule, const Eigen::Vector3d& origin,
                   const Eigen::Vector3d& direction) {
  const Eigen::Vector3d top(0.0, 0.0, 0.5 * capsule.length_m);
  const Crossings tube = intersection(cross_slab(origin.z(), direction.z(), top.z()),
                                      cross_tube(capsule.radius_m, origin, direction));
  // Convex, so the parts' crossings that are not empty join without a gap.
  Crossings whole;
  for (const Crossings& part : {tube, cross_ball(top, capsule.radius_m, origin, direction),
                                cross_ball(-top, capsule.radius_m, origin, direction)}) {
    if (part.enter_m > part.leave_m) continue;
    whole.enter_m = std::min(whole.enter_m, part.enter_m);
    whole.leave_m = std::max(whole.leave_m, part.leave_m);
  }
  ShapeHit hit{whole.first_ahead_m()};
  if (hit.distance_m == kInfinity) return hit;
  const Eigen::Vector3d p = origin + hit.distance_m * direction;
  const Eigen::Vector3d on_axis(0.0, 0.0, std::clamp(p.z(), -top.z(), top.z()));
  hit.normal = (p - on_axis).normalized();
  return hit;
}

ShapeHit first_hit(const HalfSpace&, const Eigen::Vector3d& origin,
                   const Eigen::Vector3d& direction) {
  const double distance_m = direction.z() != 0.0 ? -origin.z() / direction.z() : kInfinity;
  if (!(distance_m > 0.0) || distance_m == kInfinity) return {};
  return {distance_m, Eigen::Vector3d::UnitZ()};
}

Eigen::Vector3d half_extent_m(const Box& box) { return 0.5 * box.size_m; }

Eigen::Vector3d half_extent_m(const Sphere& sphere) {
  return Eigen::Vector3d::Constant(sphere.radius_m);
}

Eigen::Vector3d half_extent_m(const Cylinder& cylinder) {
  return {cylinder.radius_m, cylinder.radius_m, 0.5 * cylinder.length_m};
}

Eigen::Vector3d half_extent_m(const Capsule& capsule) {
  return {capsule.radius_m, capsule.radius_m, 0.5 * capsule.length_m + capsule.radius_m};
}

}  // namespace sidestep
