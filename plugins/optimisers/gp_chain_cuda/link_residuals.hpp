#pragma once

#include "chain_problem.hpp"

namespace sidestep::gp_chain_cuda {

/// Residuals of where a link is and, of each, its derivative by the link's motion as a force and a
/// moment about the world's origin, as sidestep's LinkCost has them.
struct LinkResiduals {
  int count = 0;
  double residual[6];
  Vec3 force[6];
  Vec3 moment[6];

  SIDESTEP_HOST_DEVICE void add(double value, const Vec3& by_point, const Vec3& by_turn) {
    residual[count] = value;
    force[count] = by_point;
    moment[count++] = by_turn;
  }
};

namespace detail {

SIDESTEP_HOST_DEVICE inline Vec3 vector_at(const double* numbers) {
  return {numbers[0], numbers[1], numbers[2]};
}
SIDESTEP_HOST_DEVICE inline Mat3 rotation_at(const double* numbers) {
  return {vector_at(numbers), vector_at(numbers + 3), vector_at(numbers + 6)};
}

}  // namespace detail

/// `numbers`: of a kLinkPose.
SIDESTEP_HOST_DEVICE inline LinkResiduals link_pose_residuals(const double* numbers,
                                                              const Pose& body) {
  const Mat3 R_world_target = detail::rotation_at(numbers);
  const Vec3 p_world_target = detail::vector_at(numbers + 9);
  const Mat3 R = body.R * detail::rotation_at(numbers + 12);
  const Vec3 p = body.R * detail::vector_at(numbers + 21) + body.p;
  const double position_weight = numbers[24], rotation_weight = numbers[25];
  const Vec3 axes[3] = {{1.0, 0.0, 0.0}, {0.0, 1.0, 0.0}, {0.0, 0.0, 1.0}};
  LinkResiduals out;
  if (position_weight > 0.0) {
    for (const Vec3& axis : axes) {
      const Vec3 force = position_weight * axis;
      out.add(position_weight * dot(axis, p - p_world_target), force, cross(p, force));
    }
  }
  if (rotation_weight > 0.0) {
    const Vec3 v = rotation_vector(transposed_times(R_world_target, R));
    const double angle = norm(v), square = angle * angle;
    // (1 - (angle / 2) cot(angle / 2)) / angle^2, of the inverse of SO(3)'s left Jacobian.
    const double factor = angle < 1e-2 ? 1.0 / 12.0 + square / 720.0
                                       : (1.0 - 0.5 * angle / tan(0.5 * angle)) / square;
    for (const Vec3& axis : axes) {
      const Vec3 turned = cross(v, axis);
      const Vec3 column = axis + 0.5 * turned + factor * cross(v, turned);
      out.add(rotation_weight * dot(axis, v), {}, rotation_weight * (R_world_target * column));
    }
  }
  return out;
}

/// `numbers`: of a kLinkAxis.
SIDESTEP_HOST_DEVICE inline LinkResiduals link_axis_residuals(const double* numbers, double weight,
                                                              const Pose& body) {
  constexpr double kOpposite = 1e-9;  // a sine: less, and the way back has no direction
  constexpr double kPi = 3.14159265358979323846;
  const Vec3 axis = body.R * detail::vector_at(numbers);
  const Vec3 axis_world = detail::vector_at(numbers + 3);
  const Vec3 across[2] = {detail::vector_at(numbers + 6), detail::vector_at(numbers + 9)};
  const double c = dot(axis, axis_world);
  const double s = norm(cross(axis, axis_world));
  LinkResiduals out;
  if (c < 0.0 && s < kOpposite) {
    out.add(weight * kPi, {}, -weight * cross(axis, across[0]));
    out.add(0.0, {}, {});
    return out;
  }
  const double angle = atan2(s, c), square = angle * angle;
  const bool is_small = angle < 1e-2;
  // angle / sin(angle), and its derivative by cos(angle).
  const double ratio = is_small ? 1.0 + square / 6.0 + 7.0 * square * square / 360.0 : angle / s;
  const double slope = is_small ? -1.0 / 3.0 - 2.0 * square / 15.0 : (angle * c - s) / (s * s * s);
  for (const Vec3& direction : across) {
    const double along = dot(axis, direction);
    out.add(weight * ratio * along, {},
            weight * (ratio * cross(axis, direction) + slope * along * cross(axis, axis_world)));
  }
  return out;
}

}  // namespace sidestep::gp_chain_cuda
