#ifndef SIDESTEP_KERNELS
#include "solid.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <variant>

#include <sidestep/core/index.hpp>

namespace sidestep::detail {
namespace {

void take(Solid& solid, const Box& box) {
  solid.kind = Solid::Kind::kBox;
  solid.half_m = 0.5 * box.size_m;
  solid.reach_m = solid.half_m.norm();
}

void take(Solid& solid, const Sphere& sphere) {
  solid.kind = Solid::Kind::kSphere;
  solid.radius_m = solid.reach_m = sphere.radius_m;
}

void take(Solid& solid, const Cylinder& cylinder) {
  solid.kind = Solid::Kind::kCylinder;
  solid.radius_m = cylinder.radius_m;
  solid.half_length_m = 0.5 * cylinder.length_m;
  solid.reach_m = std::hypot(solid.radius_m, solid.half_length_m);
}

void take(Solid& solid, const Capsule& capsule) {
  solid.kind = Solid::Kind::kCapsule;
  solid.radius_m = capsule.radius_m;
  solid.half_length_m = 0.5 * capsule.length_m;
  solid.reach_m = solid.radius_m + solid.half_length_m;
}

void take(Solid& solid, const HalfSpace&) {
  solid.kind = Solid::Kind::kHalfSpace;
  solid.reach_m = kInfinity;
}

void take(Solid& solid, const std::shared_ptr<const Mesh>& mesh) {
  solid.kind = Solid::Kind::kMesh;
  solid.mesh = mesh;
  for (const Eigen::Vector3d& vertex : mesh->vertices_m) {
    solid.reach_m = std::max(solid.reach_m, vertex.norm());
  }
}

constexpr double kRounding = 1e-15;

/// A box that is turned by right angles is one that is not, with its edges exchanged.
void align_box(Solid& solid) {
  const Eigen::Matrix3d whole = solid.R_world_shape.array().round();
  if ((solid.R_world_shape - whole).cwiseAbs().maxCoeff() > kRounding) return;
  solid.half_m = whole.cwiseAbs() * solid.half_m;
  solid.R_world_shape.setIdentity();
  solid.is_aligned = true;
}

/// How an upright cylinder is turned about its axis, or upside down, makes no difference.
void align_cylinder(Solid& solid) {
  if (solid.R_world_shape.col(2).head<2>().cwiseAbs().maxCoeff() > kRounding) return;
  solid.R_world_shape.setIdentity();
  solid.is_aligned = true;
}

/// Half the edges of the box around a solid that is no mesh.
Eigen::Vector3d half_bounds_m(const Solid& solid) {
  const Eigen::Vector3d axis = solid.R_world_shape.col(2).cwiseAbs();
  switch (solid.kind) {
    case Solid::Kind::kBox: return solid.R_world_shape.cwiseAbs() * solid.half_m;
    case Solid::Kind::kSphere: return Eigen::Vector3d::Constant(solid.radius_m);
    case Solid::Kind::kCylinder: {
      const Eigen::Array3d across = (1.0 - axis.array().square()).max(0.0).sqrt();
      return solid.half_length_m * axis + (solid.radius_m * across).matrix();
    }
    case Solid::Kind::kCapsule:
      return (solid.half_length_m * axis.array() + solid.radius_m).matrix();
    case Solid::Kind::kHalfSpace:
    case Solid::Kind::kMesh: break;
  }
  return Eigen::Vector3d::Constant(kInfinity);
}

Eigen::Vector3d in_shape(const Solid& solid, const Eigen::Vector3d& p_world) {
  return solid.R_world_shape.transpose() * (p_world - solid.p_world_shape);
}

/// Of what is `beyond` faces along axes, all of it inside where nothing is: the way out of a box or
/// of a cylinder's section.
template <class Vector>
Vector out_of_faces(const Vector& beyond) {
  const Vector outside = beyond.cwiseMax(0.0);
  if (const double norm = outside.norm(); norm > 0.0) return outside / norm;
  Eigen::Index nearest = 0;
  beyond.maxCoeff(&nearest);
  return Vector::Unit(nearest);
}

Eigen::Vector3d gradient_in_shape(const Solid& solid, const Eigen::Vector3d& p) {
  const auto sign = [](double value) { return value < 0.0 ? -1.0 : 1.0; };
  switch (solid.kind) {
    case Solid::Kind::kBox:
      return out_of_faces<Eigen::Vector3d>(p.cwiseAbs() - solid.half_m)
          .cwiseProduct(p.unaryExpr(sign));
    case Solid::Kind::kCylinder: {
      const double to_axis_m = p.head<2>().norm();
      const Eigen::Vector2d way = out_of_faces<Eigen::Vector2d>(
          {to_axis_m - solid.radius_m, std::abs(p.z()) - solid.half_length_m});
      const Eigen::Vector2d radial =
          to_axis_m > 0.0 ? Eigen::Vector2d(p.head<2>() / to_axis_m) : Eigen::Vector2d::UnitX();
      return {way.x() * radial.x(), way.x() * radial.y(), way.y() * sign(p.z())};
    }
    case Solid::Kind::kSphere:
    case Solid::Kind::kCapsule: {
      const double on_axis_m = std::clamp(p.z(), -solid.half_length_m, solid.half_length_m);
      const Eigen::Vector3d off = p - Eigen::Vector3d(0.0, 0.0, on_axis_m);
      const double norm = off.norm();
      return norm > 0.0 ? Eigen::Vector3d(off / norm) : Eigen::Vector3d::UnitX();
    }
    case Solid::Kind::kHalfSpace: break;
    case Solid::Kind::kMesh: {
      constexpr double kStep_m = 1e-6;
      Eigen::Vector3d slope;
      for (int axis = 0; axis < 3; ++axis) {
        const Eigen::Vector3d step = kStep_m * Eigen::Vector3d::Unit(axis);
        slope[axis] =
            signed_distance_m(solid.mesh, p + step) - signed_distance_m(solid.mesh, p - step);
      }
      const double norm = slope.norm();
      if (norm > 0.0) return slope / norm;
      break;
    }
  }
  return Eigen::Vector3d::UnitZ();
}

constexpr double kLeast_m = 1e-9;

/// A box around points and some space around them.
struct PointBounds {
  double low_m[3], high_m[3];
};
}  // namespace

}  // namespace sidestep::detail

#define SIDESTEP_KERNELS "solid.cpp"
#include <sidestep/core/each_target.hpp>

namespace sidestep::detail {

Solid make_solid(const SceneObject& object, double time_s) {
  Solid solid;
  const Transform pose = object.T_world_object(time_s);
  solid.R_world_shape = pose.linear();
  solid.p_world_shape = pose.translation();
  std::visit([&](const auto& shape) { take(solid, shape); }, object.shape);
  if (solid.kind == Solid::Kind::kBox) align_box(solid);
  if (solid.kind == Solid::Kind::kCylinder) align_cylinder(solid);
  return solid;
}

Eigen::Vector3d gradient_of(const Solid& solid, const Eigen::Vector3d& p_world) {
  return solid.R_world_shape * gradient_in_shape(solid, in_shape(solid, p_world));
}

double mesh_distance_m(const Solid& solid, const Eigen::Vector3d& p_world) {
  return signed_distance_m(solid.mesh, in_shape(solid, p_world));
}

std::vector<SolidBounds> bounds_of(std::span<const Solid> solids) {
  std::vector<SolidBounds> bounds(padded(solids.size()) / kLanes);
  for (std::size_t i = 0; i < kLanes * bounds.size(); ++i) {
    PointLanes& low_m = bounds[i / kLanes].low_m;
    PointLanes& high_m = bounds[i / kLanes].high_m;
    Eigen::Vector3d place = Eigen::Vector3d::Zero(), half_m = Eigen::Vector3d::Constant(-kInfinity);
    if (i < solids.size()) {
      place = solids[i].p_world_shape;
      half_m = half_bounds_m(solids[i]);
    }
    const std::size_t lane = i % kLanes;
    low_m.x[lane] = place.x() - half_m.x();
    low_m.y[lane] = place.y() - half_m.y();
    low_m.z[lane] = place.z() - half_m.z();
    high_m.x[lane] = place.x() + half_m.x();
    high_m.y[lane] = place.y() + half_m.y();
    high_m.z[lane] = place.z() + half_m.z();
  }
  return bounds;
}

std::size_t find_solids_beside(std::span<const SolidBounds> bounds, const PointLanes& points_m,
                               double limit_m, std::uint32_t* beside) noexcept {
  return SIDESTEP_DISPATCH(find_solids_beside)(bounds, points_m, limit_m, beside);
}

void find_nearest_solids(const Solid* solids, std::span<const SolidBounds> bounds,
                         const PointLanes& points_m, double limit_m, double* distances_m,
                         double* numbers) noexcept {
  SIDESTEP_DISPATCH(find_nearest_solids)(solids, bounds, points_m, limit_m, distances_m, numbers);
}

std::size_t find_solids_within(const Solid* solids, const std::uint32_t* numbers, std::size_t count,
                               const PointLanes& points_m, const double* limits_m,
                               std::uint32_t* near, double* is_near) noexcept {
  return SIDESTEP_DISPATCH(find_solids_within)(solids, numbers, count, points_m, limits_m, near,
                                               is_near);
}

}  // namespace sidestep::detail

#else

namespace {

using namespace detail;

SIDESTEP_INLINE Lanes roots_of(const Lanes& squares) noexcept {
  double from[kLanes], to[kLanes];
  lanes(from) = squares;
  for (std::size_t i = 0; i < kLanes; ++i) to[i] = __builtin_sqrt(from[i] > 0.0 ? from[i] : 0.0);
  return lanes(to);
}

SIDESTEP_INLINE void add_outside(const Lanes& beyond, Lanes& squares, Lanes& deepest) noexcept {
  const Lanes outside = greater(beyond, Lanes{});
  squares += outside * outside;
  deepest = greater(beyond, deepest);
}

/// Distances of points in the shape's frame.
SIDESTEP_INLINE void find_distances(const Solid& solid, const Lanes& x, const Lanes& y,
                                    const Lanes& z, Lanes& distances) noexcept {
  Lanes squares{}, deepest = Lanes{} - kInfinity;
  switch (solid.kind) {
    case Solid::Kind::kBox:
      add_outside(abs(x) - solid.half_m.data()[0], squares, deepest);
      add_outside(abs(y) - solid.half_m.data()[1], squares, deepest);
      add_outside(abs(z) - solid.half_m.data()[2], squares, deepest);
      break;
    case Solid::Kind::kCylinder:
      add_outside(roots_of(x * x + y * y) - solid.radius_m, squares, deepest);
      add_outside(abs(z) - solid.half_length_m, squares, deepest);
      break;
    case Solid::Kind::kSphere:
    case Solid::Kind::kCapsule: {
      const Lanes off = greater(abs(z) - solid.half_length_m, Lanes{});
      distances = roots_of(x * x + y * y + off * off) - solid.radius_m;
      return;
    }
    case Solid::Kind::kHalfSpace:
    case Solid::Kind::kMesh: distances = z; return;
  }
  distances = choose(deepest > 0.0, roots_of(squares), deepest);
}

SIDESTEP_INLINE void add_outside(const Lanes& beyond, Lanes& squares) noexcept {
  const Lanes outside = greater(beyond, Lanes{});
  squares += outside * outside;
}

SIDESTEP_INLINE void find_near_box(const Solid& box, const Lanes& x, const Lanes& y, const Lanes& z,
                                   const Lanes& limits, Lanes& is_near) noexcept {
  Lanes squares{};
  add_outside(abs(x) - box.half_m.data()[0], squares);
  add_outside(abs(y) - box.half_m.data()[1], squares);
  add_outside(abs(z) - box.half_m.data()[2], squares);
  is_near = ones_where(squares < limits * limits);
}

/// 1 where points in the shape's frame are nearer to it than their limits, else 0.
SIDESTEP_INLINE void find_near_in_shape(const Solid& solid, const Lanes& x, const Lanes& y,
                                        const Lanes& z, const Lanes& limits,
                                        Lanes& is_near) noexcept {
  Lanes squares{}, wanted = limits;
  switch (solid.kind) {
    case Solid::Kind::kBox: find_near_box(solid, x, y, z, limits, is_near); return;
    case Solid::Kind::kCylinder: {
      const Lanes beyond = abs(z) - solid.half_length_m, around = x * x + y * y;
      wanted += solid.radius_m;
      // Hardly ever within its limit of both the barrel and the lids: no roots until it is.
      const Lanes off_lids = beyond - limits, off_barrel = around - wanted * wanted;
      is_near = ones_where(greater(off_lids, off_barrel) < 0.0);
      if (!any_of(is_near)) return;
      add_outside(roots_of(around) - solid.radius_m, squares);
      add_outside(beyond, squares);
      is_near = ones_where(squares < limits * limits);
      return;
    }
    case Solid::Kind::kSphere:
    case Solid::Kind::kCapsule:
      add_outside(abs(z) - solid.half_length_m, squares);
      squares += x * x + y * y;
      wanted += solid.radius_m;
      break;
    case Solid::Kind::kHalfSpace:
    case Solid::Kind::kMesh: is_near = ones_where(z < limits); return;
  }
  is_near = ones_where(squares < wanted * wanted);
}

SIDESTEP_INLINE void widen_gap(const Lanes& gap, Lanes& widest) noexcept {
  widest = greater(gap, widest);
}

SIDESTEP_INLINE void find_bounds(const PointLanes& points_m, double limit_m,
                                 PointBounds& bounds) noexcept {
  const double* coordinates[] = {points_m.x, points_m.y, points_m.z};
  for (int axis = 0; axis < 3; ++axis) {
    bounds.low_m[axis] = least_of(lanes(coordinates[axis])) - limit_m;
    bounds.high_m[axis] = limit_m - least_of(-lanes(coordinates[axis]));
  }
}

/// 1 where a solid's bounds meet a box, else 0; false where none does.
SIDESTEP_INLINE bool find_beside(const SolidBounds& solids, const PointBounds& box,
                                 double* is_beside) noexcept {
  Lanes apart = lanes(solids.low_m.x) - box.high_m[0];
  widen_gap(box.low_m[0] - lanes(solids.high_m.x), apart);
  widen_gap(lanes(solids.low_m.y) - box.high_m[1], apart);
  widen_gap(box.low_m[1] - lanes(solids.high_m.y), apart);
  widen_gap(lanes(solids.low_m.z) - box.high_m[2], apart);
  widen_gap(box.low_m[2] - lanes(solids.high_m.z), apart);
  const Lanes are_beside = ones_where(apart <= kLeast_m);  // not where it is NaN
  lanes(is_beside) = are_beside;
  return any_of(are_beside);
}

/// 1 where points of the world are nearer to it than their limits, which are positive, else 0.
SIDESTEP_INLINE void find_near(const Solid& solid, const PointLanes& points_m, const Lanes& limits,
                               Lanes& is_near) noexcept {
  const double* p = solid.p_world_shape.data();
  const double* R = solid.R_world_shape.data();
  const Lanes x = lanes(points_m.x) - p[0], y = lanes(points_m.y) - p[1],
              z = lanes(points_m.z) - p[2];
  if (solid.is_aligned) {
    find_near_in_shape(solid, x, y, z, limits, is_near);
  } else {
    find_near_in_shape(solid, R[0] * x + R[1] * y + R[2] * z, R[3] * x + R[4] * y + R[5] * z,
                       R[6] * x + R[7] * y + R[8] * z, limits, is_near);
  }
}

std::size_t find_solids_beside(std::span<const SolidBounds> bounds, const PointLanes& points_m,
                               double limit_m, std::uint32_t* beside) noexcept {
  PointBounds around;
  find_bounds(points_m, limit_m, around);
  std::size_t found = 0;
  double is_beside[kLanes];
  for (std::size_t group = 0; group < bounds.size(); ++group) {
    if (!find_beside(bounds[group], around, is_beside)) continue;
    for (std::size_t lane = 0; lane < kLanes; ++lane) {
      if (is_beside[lane] != 0.0)
        beside[found++] = static_cast<std::uint32_t>(group * kLanes + lane);
    }
  }
  return found;
}

void find_nearest_solids(const Solid* solids, std::span<const SolidBounds> bounds,
                         const PointLanes& points_m, double limit_m, double* distances_m,
                         double* numbers) noexcept {
  Lanes nearest = lanes(distances_m), number = lanes(numbers), is_nearer;
  PointBounds around;
  find_bounds(points_m, limit_m, around);
  double is_beside[kLanes];
  for (std::size_t group = 0; group < bounds.size(); ++group) {
    if (!find_beside(bounds[group], around, is_beside)) continue;
    for (std::size_t lane = 0; lane < kLanes; ++lane) {
      if (is_beside[lane] == 0.0) continue;
      const Solid& solid = solids[group * kLanes + lane];
      // Mostly it is not nearer, which is known without roots.
      find_near(solid, points_m, greater(nearest, Lanes{} + kLeast_m), is_nearer);
      if (!any_of(is_nearer)) continue;
      const double* p = solid.p_world_shape.data();
      const double* R = solid.R_world_shape.data();
      const Lanes x = lanes(points_m.x) - p[0], y = lanes(points_m.y) - p[1],
                  z = lanes(points_m.z) - p[2];
      Lanes distances;
      find_distances(solid, R[0] * x + R[1] * y + R[2] * z, R[3] * x + R[4] * y + R[5] * z,
                     R[6] * x + R[7] * y + R[8] * z, distances);
      const auto nearer = distances < nearest;
      number = choose(nearer, Lanes{} + static_cast<double>(group * kLanes + lane), number);
      nearest = choose(nearer, distances, nearest);
    }
  }
  lanes(distances_m) = nearest;
  lanes(numbers) = number;
}

std::size_t find_solids_within(const Solid* solids, const std::uint32_t* numbers, std::size_t count,
                               const PointLanes& points_m, const double* limits_m,
                               std::uint32_t* near, double* is_near) noexcept {
  const Lanes limits = lanes(limits_m);
  // Mostly nothing is near, which is known without looking at the lanes of each solid.
  Lanes is_near_any{}, is_near_this;
  for (std::size_t i = 0; i < count; ++i) {
    find_near(solids[numbers[i]], points_m, limits, is_near_this);
    is_near_any += is_near_this;
  }
  if (!any_of(is_near_any)) return 0;
  std::size_t found = 0;
  for (std::size_t i = 0; i < count; ++i) {
    find_near(solids[numbers[i]], points_m, limits, is_near_this);
    if (any_of(is_near_this)) near[found++] = numbers[i];
  }
  lanes(is_near) = choose(is_near_any > 0.0, Lanes{} + 1.0, lanes(is_near));
  return found;
}

}  // namespace

#endif
