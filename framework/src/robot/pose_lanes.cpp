#include "pose_lanes.hpp"

#include <algorithm>
#include <cmath>

#include "sine_lanes.hpp"

namespace sidestep::detail {
namespace {

using Motion = TreeJoint::Motion;

/// out = R * v + offset, of column-major R.
SIDESTEP_INLINE void multiply(const double (&R)[9][kLanes], const double* v, double (*out)[kLanes],
                              const double (*offset)[kLanes]) noexcept {
  for (std::size_t row = 0; row < 3; ++row) {
    Lanes sum = lanes(R[row]) * v[0] + lanes(R[3 + row]) * v[1] + lanes(R[6 + row]) * v[2];
    if (offset != nullptr) sum += lanes(offset[row]);
    lanes(out[row]) = sum;
  }
}

/// out = column `axis` of R, counted from 1, reversed where that is negative.
SIDESTEP_INLINE void copy_axis(const double (&R)[9][kLanes], int axis,
                               double (*out)[kLanes]) noexcept {
  const std::size_t from = 3 * (static_cast<std::size_t>(axis < 0 ? -axis : axis) - 1);
  for (std::size_t row = 0; row < 3; ++row) {
    const Lanes value = lanes(R[from + row]);
    lanes(out[row]) = axis < 0 ? -value : value;
  }
}

/// The pose of a frame that is fixed to a body, or to the world where that is null.
SIDESTEP_INLINE void attach(const PoseLanes* body, const TreeBody& frame, PoseLanes& out) noexcept {
  const double* R = frame.R_parent_joint.data();
  const double* p = frame.p_parent_joint.data();
  if (body == nullptr) {
    for (std::size_t i = 0; i < 9; ++i) lanes(out.R[i]) = Lanes{} + R[i];
    for (std::size_t i = 0; i < 3; ++i) lanes(out.p[i]) = Lanes{} + p[i];
    return;
  }
  for (std::size_t column = 0; column < 3; ++column) {
    const int axis = frame.axes[column];
    if (axis == 0) {
      multiply(body->R, R + 3 * column, out.R + 3 * column, nullptr);
    } else {
      copy_axis(body->R, axis, out.R + 3 * column);
    }
  }
  multiply(body->R, p, out.p, body->p);
}

/// Turns about the frame's own z.
SIDESTEP_INLINE void turn(PoseLanes& pose, const Lanes& s, const Lanes& c) noexcept {
  for (std::size_t row = 0; row < 3; ++row) {
    const Lanes x = lanes(pose.R[row]), y = lanes(pose.R[3 + row]);
    lanes(pose.R[row]) = c * x + s * y;
    lanes(pose.R[3 + row]) = c * y - s * x;
  }
}

/// Shifts along the frame's own z.
SIDESTEP_INLINE void shift(PoseLanes& pose, const Lanes& way) noexcept {
  for (std::size_t row = 0; row < 3; ++row) lanes(pose.p[row]) += way * lanes(pose.R[6 + row]);
}

/// Returns the largest angle; the poses are right where that is no larger than kLargestAngle.
SIDESTEP_SIMD_CLONES
double place_fast(std::span<const TreeBody> bodies, const double* const (&rows)[kLanes],
                  PoseLanes* poses) noexcept {
  Lanes largest = {};
  // First what no pose depends on, for many sines are computed at once where nothing waits for
  // them; kept where the pose will be.
  for (std::size_t b = 0; b < bodies.size(); ++b) {
    const TreeBody& body = bodies[b];
    const int j = body.joint;
    if (j == -1) continue;
    const Lanes of_joint = {rows[0][j], rows[1][j], rows[2][j], rows[3][j],
                            rows[4][j], rows[5][j], rows[6][j], rows[7][j]};
    const Lanes value = body.multiplier * of_joint + body.offset;
    if (body.motion == Motion::kTranslation) {
      lanes(poses[b].R[0]) = value;
      continue;
    }
    const Lanes size = value < 0.0 ? -value : value;
    largest = size > largest ? size : largest;
    Lanes s, c;
    sine_lanes(value, s, c);
    lanes(poses[b].R[0]) = s;
    lanes(poses[b].R[1]) = c;
  }
  for (std::size_t b = 0; b < bodies.size(); ++b) {
    const TreeBody& body = bodies[b];
    const Lanes first = lanes(poses[b].R[0]), second = lanes(poses[b].R[1]);
    attach(body.parent == -1 ? nullptr : poses + body.parent, body, poses[b]);
    if (body.joint == -1) continue;
    if (body.motion == Motion::kTranslation) {
      shift(poses[b], first);
    } else {
      turn(poses[b], first, second);
    }
  }
  double most = 0.0;
  for (std::size_t lane = 0; lane < kLanes; ++lane) most = std::max(most, largest[lane]);
  return most;
}

/// The same for angles of any size.
void place_any(std::span<const TreeBody> bodies, const double* const (&rows)[kLanes],
               PoseLanes* poses) noexcept {
  for (std::size_t b = 0; b < bodies.size(); ++b) {
    const TreeBody& body = bodies[b];
    attach(body.parent == -1 ? nullptr : poses + body.parent, body, poses[b]);
    if (body.joint == -1) continue;
    alignas(64) double values[kLanes], sines[kLanes], cosines[kLanes];
    for (std::size_t lane = 0; lane < kLanes; ++lane) {
      values[lane] = body.multiplier * rows[lane][body.joint] + body.offset;
      sines[lane] = std::sin(values[lane]);
      cosines[lane] = std::cos(values[lane]);
    }
    if (body.motion == Motion::kTranslation) {
      shift(poses[b], lanes(values));
    } else {
      turn(poses[b], lanes(sines), lanes(cosines));
    }
  }
}

}  // namespace

void place_bodies(std::span<const TreeBody> bodies, std::span<const double> q, std::size_t dof,
                  PoseLanes* poses) noexcept {
  const double* rows[kLanes];
  for (std::size_t lane = 0; lane < kLanes; ++lane) {
    rows[lane] = q.data() + std::min(lane * dof, q.size() - dof);
  }
  if (place_fast(bodies, rows, poses) > kLargestAngle) place_any(bodies, rows, poses);
}

SIDESTEP_SIMD_CLONES
void carry_spheres(std::span<const TreeSphere> spheres, const PoseLanes* poses,
                   PointLanes* centres) noexcept {
  for (std::size_t i = 0; i < spheres.size(); ++i) {
    const PoseLanes& body = poses[spheres[i].body];
    const double* v = spheres[i].p_body.data();
    double* out[] = {centres[i].x, centres[i].y, centres[i].z};
    for (std::size_t row = 0; row < 3; ++row) {
      lanes(out[row]) = lanes(body.R[row]) * v[0] + lanes(body.R[3 + row]) * v[1] +
                        lanes(body.R[6 + row]) * v[2] + lanes(body.p[row]);
    }
  }
}

SIDESTEP_SIMD_CLONES
void find_axes(const PoseLanes* poses, std::size_t count, AxisLanes* axes) noexcept {
  for (std::size_t b = 0; b < count; ++b) {
    for (std::size_t row = 0; row < 3; ++row) {
      lanes(axes[b].z[row]) = lanes(poses[b].R[6 + row]);
      lanes(axes[b].p[row]) = lanes(poses[b].p[row]);
    }
  }
}

SIDESTEP_SIMD_CLONES
void find_screws(std::span<const TreeBody> bodies, const AxisLanes* axes,
                 ScrewLanes* screws) noexcept {
  for (std::size_t b = 0; b < bodies.size(); ++b) {
    const AxisLanes& at = axes[b];
    const bool turns = bodies[b].motion == Motion::kRotation;
    for (std::size_t row = 0; row < 3; ++row) {
      const std::size_t next = (row + 1) % 3, last = (row + 2) % 3;
      const Lanes axis = lanes(at.z[row]);
      const Lanes offset =
          lanes(at.p[next]) * lanes(at.z[last]) - lanes(at.p[last]) * lanes(at.z[next]);
      lanes(screws[b].values[row]) = turns ? axis : Lanes{};
      lanes(screws[b].values[3 + row]) = turns ? offset : axis;
    }
  }
}

SIDESTEP_SIMD_CLONES
void find_works(std::span<const LinkForce> forces, const int* body_of_link, const double* table,
                std::size_t stride, const double* weights, double* works,
                std::size_t step) noexcept {
  for (std::size_t c = 0; c < stride; c += kLanes) {
    Lanes column[6];
#pragma GCC unroll 6
    for (std::size_t i = 0; i < 6; ++i) column[i] = lanes(table + i * stride + c);
    for (std::size_t k = 0; k < forces.size(); ++k) {
      const double* force = forces[k].force.data();
      const double* moment = forces[k].moment.data();
      const std::size_t body = static_cast<std::size_t>(body_of_link[forces[k].link]);
      const Lanes turning = moment[0] * column[0] + moment[1] * column[1] + moment[2] * column[2];
      const Lanes moving = force[0] * column[3] + force[1] * column[4] + force[2] * column[5];
      lanes(works + k * step + c) = lanes(weights + body * stride + c) * (turning + moving);
    }
  }
}

}  // namespace sidestep::detail
