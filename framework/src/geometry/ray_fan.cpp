#include "ray_fan.hpp"

#include <algorithm>
#include <cmath>

#include <sidestep/core/index.hpp>
#include <sidestep/core/lanes.hpp>

namespace sidestep {

namespace {

constexpr int kRays = RayFan::kRays;
/// Stands for a direction that is exactly along a face: its crossings are then far, on both sides.
constexpr double kAlong = 1e-150;

SIDESTEP_INLINE double root(double a) { return __builtin_sqrt(greater(a, 0.0)); }

/// Where rays enter and leave something convex; not at all where they leave before.
struct Span {
  double enter, leave;
};

SIDESTEP_INLINE void take(const Span& inside, double& nearest_m) {
  const double ahead = inside.enter > 0.0 ? inside.enter : inside.leave;
  const double met = inside.enter <= inside.leave ? ahead : kInfinity;
  const double met_ahead = met > 0.0 ? met : kInfinity;
  nearest_m = lesser(nearest_m, met_ahead);
}

SIDESTEP_INLINE Span both(const Span& a, const Span& b) {
  return {greater(a.enter, b.enter), lesser(a.leave, b.leave)};
}

SIDESTEP_INLINE Span slab(double origin, double direction, double half) {
  const double inverse = 1.0 / (direction == 0.0 ? kAlong : direction);
  const double a = (-half - origin) * inverse;
  const double b = (half - origin) * inverse;
  return {lesser(a, b), greater(a, b)};
}

SIDESTEP_INLINE Span ball(double x, double y, double z, double dx, double dy, double dz,
                          double radius_m) {
  // Around the ray's point nearest to the centre, so that distant spheres keep their digits.
  const double nearest_m = -(x * dx + y * dy + z * dz);
  const double px = x + nearest_m * dx;
  const double py = y + nearest_m * dy;
  const double pz = z + nearest_m * dz;
  const double left = radius_m * radius_m - (px * px + py * py + pz * pz);
  const double half_chord_m = root(left);
  return {left >= 0.0 ? nearest_m - half_chord_m : kInfinity,
          left >= 0.0 ? nearest_m + half_chord_m : -kInfinity};
}

/// An endless cylinder around z. The form of the roots avoids cancellation.
SIDESTEP_INLINE Span tube(double x, double y, double dx, double dy, double radius_m) {
  const double a = greater(dx * dx + dy * dy, kAlong);
  const double b = x * dx + y * dy;
  const double c = x * x + y * y - radius_m * radius_m;
  const double discriminant = b * b - a * c;
  const double shift = root(discriminant);
  const double q = b < 0.0 ? shift - b : -shift - b;
  const double first = q / a;
  const double second = q == 0.0 ? first : c / (q == 0.0 ? 1.0 : q);
  return {discriminant >= 0.0 ? lesser(first, second) : kInfinity,
          discriminant >= 0.0 ? greater(first, second) : -kInfinity};
}

/// A fan in the frame of a shape.
struct LocalFan {
  double origin[3];
  double rotation[3][3];  ///< From the world to the shape.
  const double* world[3];
  double* nearest_m;
};

/// Calls meet(dx, dy, dz, nearest_m) for all rays, with their directions in the shape's frame: a
/// plain loop, which each of the functions below compiles for several instruction sets.
template <class Meet>
SIDESTEP_INLINE void each_ray(const LocalFan& fan, const Meet& meet) {
  const double(&r)[3][3] = fan.rotation;
  const double *x = fan.world[0], *y = fan.world[1], *z = fan.world[2];
  double* __restrict nearest_m = fan.nearest_m;
  for (int i = 0; i < kRays; ++i) {
    meet(r[0][0] * x[i] + r[0][1] * y[i] + r[0][2] * z[i],
         r[1][0] * x[i] + r[1][1] * y[i] + r[1][2] * z[i],
         r[2][0] * x[i] + r[2][1] * y[i] + r[2][2] * z[i], nearest_m[i]);
  }
}

#define SIDESTEP_RAY \
  (double dx, double dy, double dz, double& nearest_m) __attribute__((always_inline))

SIDESTEP_SIMD_CLONES
void meet_box(const LocalFan& local, const Eigen::Vector3d& half_m) {
  const LocalFan fan = local;  // copies, which no store below can alias
  const double hx = half_m[0], hy = half_m[1], hz = half_m[2];
  each_ray(fan, [&] SIDESTEP_RAY {
    const Span x = slab(fan.origin[0], dx, hx);
    const Span y = slab(fan.origin[1], dy, hy);
    const Span z = slab(fan.origin[2], dz, hz);
    take(both(both(x, y), z), nearest_m);
  });
}

SIDESTEP_SIMD_CLONES
void meet_sphere(const LocalFan& local, double radius_m) {
  const LocalFan fan = local;
  each_ray(fan, [&] SIDESTEP_RAY {
    take(ball(fan.origin[0], fan.origin[1], fan.origin[2], dx, dy, dz, radius_m), nearest_m);
  });
}

SIDESTEP_SIMD_CLONES
void meet_cylinder(const LocalFan& local, double radius_m, double half_m) {
  const LocalFan fan = local;
  each_ray(fan, [&] SIDESTEP_RAY {
    const Span sides = tube(fan.origin[0], fan.origin[1], dx, dy, radius_m);
    take(both(slab(fan.origin[2], dz, half_m), sides), nearest_m);
  });
}

SIDESTEP_SIMD_CLONES
void meet_capsule(const LocalFan& local, double radius_m, double half_m) {
  const LocalFan fan = local;
  const double ox = fan.origin[0], oy = fan.origin[1], oz = fan.origin[2];
  each_ray(fan, [&] SIDESTEP_RAY {
    const Span middle = both(slab(oz, dz, half_m), tube(ox, oy, dx, dy, radius_m));
    const Span top = ball(ox, oy, oz - half_m, dx, dy, dz, radius_m);
    const Span bottom = ball(ox, oy, oz + half_m, dx, dy, dz, radius_m);
    // Convex, so the parts that are not empty join without a gap.
    const bool in_middle = middle.enter <= middle.leave;
    const double enter = in_middle ? middle.enter : kInfinity;
    const double leave = in_middle ? middle.leave : -kInfinity;
    take({lesser(enter, lesser(top.enter, bottom.enter)),
          greater(leave, greater(top.leave, bottom.leave))},
         nearest_m);
  });
}

SIDESTEP_SIMD_CLONES
void meet_half_space(const LocalFan& local) {
  const LocalFan fan = local;
  each_ray(fan, [&] SIDESTEP_RAY {
    (void)dx, (void)dy;
    const double met = -fan.origin[2] / (dz == 0.0 ? kAlong : dz);
    const double met_ahead = (met > 0.0) & (dz != 0.0) ? met : kInfinity;
    nearest_m = lesser(nearest_m, met_ahead);
  });
}

}  // namespace

void RayFan::set(const Eigen::Vector3d& origin, std::span<const Eigen::Vector3d> directions) {
  origin_ = origin;
  count_ = static_cast<int>(directions.size());
  axis_.setZero();
  for (int i = 0; i < kRays; ++i) {
    // Rays beyond the last one are that one again.
    const auto at = idx(std::min(i, count_ - 1));
    for (int c = 0; c < 3; ++c) direction_[c][i] = directions[at][c];
    axis_ += directions[at];
  }
  std::fill(nearest_m_, nearest_m_ + kRays, kInfinity);
  if (axis_.norm() < 1e-3) axis_ = directions.front();  // they go all ways
  axis_.normalize();
  cos_angle_ = 1.0;
  for (const Eigen::Vector3d& direction : directions) {
    cos_angle_ = std::min(cos_angle_, axis_.dot(direction));
  }
  constexpr double kRounding = 1e-9;
  cos_angle_ = std::max(cos_angle_ - kRounding, -1.0);
  sin_angle_ = std::sqrt(1.0 - cos_angle_ * cos_angle_);
}

bool RayFan::may_meet(const Eigen::Vector3d& centre, double radius_m) const {
  if (cos_angle_ <= 0.0) return true;
  const Eigen::Vector3d to_centre = centre - origin_;
  const double along_m = to_centre.dot(axis_);
  const double across_m = std::sqrt(std::max(0.0, to_centre.squaredNorm() - along_m * along_m));
  // Off the cone, or behind its apex, by at least this.
  const double off_m = across_m * cos_angle_ - along_m * sin_angle_;
  return off_m <= radius_m && along_m >= -radius_m;
}

struct RayFan::Local : LocalFan {
  Local(RayFan& rays, const Transform& T_world_shape) {
    const Eigen::Matrix3d R_shape_world = T_world_shape.linear().transpose();
    const Eigen::Vector3d from = R_shape_world * (rays.origin_ - T_world_shape.translation());
    for (int row = 0; row < 3; ++row) {
      origin[row] = from[row];
      world[row] = rays.direction_[row];
      for (int c = 0; c < 3; ++c) rotation[row][c] = R_shape_world(row, c);
    }
    nearest_m = rays.nearest_m_;
  }
};

void RayFan::meet(const Box& box, const Transform& T_world_shape) {
  meet_box(Local(*this, T_world_shape), 0.5 * box.size_m);
}
void RayFan::meet(const Sphere& sphere, const Transform& T_world_shape) {
  meet_sphere(Local(*this, T_world_shape), sphere.radius_m);
}
void RayFan::meet(const Cylinder& cylinder, const Transform& T_world_shape) {
  meet_cylinder(Local(*this, T_world_shape), cylinder.radius_m, 0.5 * cylinder.length_m);
}
void RayFan::meet(const Capsule& capsule, const Transform& T_world_shape) {
  meet_capsule(Local(*this, T_world_shape), capsule.radius_m, 0.5 * capsule.length_m);
}
void RayFan::meet(const HalfSpace&, const Transform& T_world_shape) {
  meet_half_space(Local(*this, T_world_shape));
}

}  // namespace sidestep
