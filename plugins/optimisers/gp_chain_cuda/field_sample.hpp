#pragma once

#include "chain_problem.hpp"

namespace sidestep::gp_chain_cuda {

/// Signed clearance of a point and its gradient.
struct Clearance {
  double distance_m;
  Vec3 gradient;
};

namespace detail {

/// Where a point lies along one axis: between two voxel centres.
struct AxisPlace {
  int low, high, nearest;
  double fraction;
  double beyond;  ///< Voxels beyond the outermost centre.
};

SIDESTEP_HOST_DEVICE inline AxisPlace place_of(double at_m, double origin_m, double per_m,
                                               int size) {
  const double position = (at_m - origin_m) * per_m - 0.5;
  const double clamped = cuda::least_of(cuda::most_of(position, 0.0), size - 1.0);
  const int low = cuda::least_of(static_cast<int>(clamped), cuda::most_of(0, size - 2));
  const double beyond = position - clamped;
  return {low, cuda::least_of(low + 1, size - 1), static_cast<int>(clamped + 0.5), clamped - low,
          beyond < 0.0 ? -beyond : beyond};
}

SIDESTEP_HOST_DEVICE inline std::size_t voxel_at(const FieldOnDevice& field, int x, int y, int z) {
  constexpr int kSide = 16;
  const int block = x / kSide + field.blocks.x * (y / kSide + field.blocks.y * (z / kSide));
  const int place = x % kSide + kSide * (y % kSide + kSide * (z % kSide));
  return static_cast<std::size_t>(block) * (kSide * kSide * kSide) +
         static_cast<std::size_t>(place);
}

SIDESTEP_HOST_DEVICE inline bool is_known(const FieldOnDevice& field, int x, int y, int z) {
  const std::size_t voxel = voxel_at(field, x, y, z);
  return ((field.known[voxel / 16] >> (voxel % 16)) & 1u) != 0;
}

SIDESTEP_HOST_DEVICE inline double from_to(double a, double b, double fraction) {
  return a + fraction * (b - a);
}

/// Trilinear interpolation, as DenseField::query().
SIDESTEP_HOST_DEVICE inline Clearance interpolate(const FieldOnDevice& field, const AxisPlace& x,
                                                  const AxisPlace& y, const AxisPlace& z) {
  const auto at = [&](int i, int j, int k) {
    return static_cast<double>(field.distances_m[voxel_at(field, i, j, k)]);
  };
  // Along x first: values and slopes at the four edges.
  const double a00 = at(x.low, y.low, z.low), a10 = at(x.high, y.low, z.low);
  const double a01 = at(x.low, y.high, z.low), a11 = at(x.high, y.high, z.low);
  const double b00 = at(x.low, y.low, z.high), b10 = at(x.high, y.low, z.high);
  const double b01 = at(x.low, y.high, z.high), b11 = at(x.high, y.high, z.high);
  const double a0 = from_to(a00, a10, x.fraction), a1 = from_to(a01, a11, x.fraction);
  const double b0 = from_to(b00, b10, x.fraction), b1 = from_to(b01, b11, x.fraction);
  const double a = from_to(a0, a1, y.fraction), b = from_to(b0, b1, y.fraction);
  const double per_m = 1.0 / field.resolution_m;
  const Vec3 slope{from_to(from_to(a10 - a00, a11 - a01, y.fraction),
                           from_to(b10 - b00, b11 - b01, y.fraction), z.fraction),
                   from_to(a1 - a0, b1 - b0, z.fraction), b - a};
  return {from_to(a, b, z.fraction),
          {x.beyond > 0.0 ? 0.0 : per_m * slope.x, y.beyond > 0.0 ? 0.0 : per_m * slope.y,
           z.beyond > 0.0 ? 0.0 : per_m * slope.z}};
}

/// How far a coordinate must go to be in [low, high].
SIDESTEP_HOST_DEVICE inline double inwards(double at, double low, double high) {
  return at < low ? low - at : at > high ? high - at : 0.0;
}

}  // namespace detail

/// What query_with_policy() says of a point.
SIDESTEP_HOST_DEVICE inline Clearance clearance_at(const FieldOnDevice& field, const Vec3& p_m) {
  if (!(p_m.x - p_m.x == 0.0 && p_m.y - p_m.y == 0.0 && p_m.z - p_m.z == 0.0)) {
    return {cuda::kNaN, {}};
  }
  const double per_m = 1.0 / field.resolution_m;
  const auto x = detail::place_of(p_m.x, field.origin_m.x, per_m, field.size_vox.x);
  const auto y = detail::place_of(p_m.y, field.origin_m.y, per_m, field.size_vox.y);
  const auto z = detail::place_of(p_m.z, field.origin_m.z, per_m, field.size_vox.z);
  if (cuda::most_of(x.beyond, cuda::most_of(y.beyond, z.beyond)) > 0.5) {
    if (!field.outside_is_occupied) return {cuda::kInfinity, {}};
    const Vec3 upper_m =
        field.origin_m + field.resolution_m * Vec3{static_cast<double>(field.size_vox.x),
                                                   static_cast<double>(field.size_vox.y),
                                                   static_cast<double>(field.size_vox.z)};
    const Vec3 in{detail::inwards(p_m.x, field.origin_m.x, upper_m.x),
                  detail::inwards(p_m.y, field.origin_m.y, upper_m.y),
                  detail::inwards(p_m.z, field.origin_m.z, upper_m.z)};
    const double outside_m = norm(in);
    return {-outside_m, outside_m > 0.0 ? (1.0 / outside_m) * in : Vec3{}};
  }
  Clearance found = detail::interpolate(field, x, y, z);
  if (field.unknown_is_occupied && found.distance_m > 0.0 &&
      !detail::is_known(field, x.nearest, y.nearest, z.nearest)) {
    found.distance_m = 0.0;
  }
  return found;
}

}  // namespace sidestep::gp_chain_cuda
