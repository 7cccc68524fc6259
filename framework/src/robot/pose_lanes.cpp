#ifndef SIDESTEP_KERNELS
#include "pose_lanes.hpp"

#include <algorithm>
#include <cmath>

#include "sine_lanes.hpp"

#define SIDESTEP_KERNELS "pose_lanes.cpp"
#include <sidestep/core/each_target.hpp>

namespace sidestep::detail {

template <class Number>
void place_bodies(std::span<const TreeBody> bodies, std::span<const double> q, std::size_t dof,
                  Poses<Number>* poses) noexcept {
  SIDESTEP_DISPATCH(place_all<Number>)(bodies, q, dof, poses);
}

template <class Number>
void carry_spheres(std::span<const TreeSphere> spheres, const Poses<Number>* poses,
                   Points<Number>* centres) noexcept {
  SIDESTEP_DISPATCH(carry<Number>)(spheres, poses, centres);
}

template <class Number>
void find_axes(const Poses<Number>* poses, std::size_t count, Axes<Number>* axes) noexcept {
  SIDESTEP_DISPATCH(copy_axes<Number>)(poses, count, axes);
}

template <class Number>
void find_screws(std::span<const TreeBody> bodies, const Axes<Number>* axes,
                 Screws<Number>* screws) noexcept {
  SIDESTEP_DISPATCH(make_screws<Number>)(bodies, axes, screws);
}

template <class Number>
void find_works(std::span<const LinkForce> forces, const int* body_of_link, const Number* table,
                std::size_t stride, const double* weights, double* works,
                std::size_t step) noexcept {
  SIDESTEP_DISPATCH(add_up_works<Number>)
  (forces, body_of_link, table, stride, weights, works, step);
}

#define SIDESTEP_INSTANTIATE(Number)                                                           \
  template void place_bodies(std::span<const TreeBody>, std::span<const double>, std::size_t,  \
                             Poses<Number>*) noexcept;                                         \
  template void carry_spheres(std::span<const TreeSphere>, const Poses<Number>*,               \
                              Points<Number>*) noexcept;                                       \
  template void find_axes(const Poses<Number>*, std::size_t, Axes<Number>*) noexcept;          \
  template void find_screws(std::span<const TreeBody>, const Axes<Number>*,                    \
                            Screws<Number>*) noexcept;                                         \
  template void find_works(std::span<const LinkForce>, const int*, const Number*, std::size_t, \
                           const double*, double*, std::size_t) noexcept;
SIDESTEP_INSTANTIATE(double)
SIDESTEP_INSTANTIATE(float)
#undef SIDESTEP_INSTANTIATE

}  // namespace sidestep::detail

#else

namespace {

using namespace detail;

using Motion = TreeJoint::Motion;

/// Numbers of one kind in lanes.
template <class Number>
using LanesOf = Line<Number, kParts>;

/// The configurations of as many lanes.
template <class Number>
using Rows = const double * [kLanesOf<Number>];

/// A vector as numbers of one kind.
template <class Number>
struct Vector {
  Number x, y, z;
  SIDESTEP_INLINE explicit Vector(const double* v) noexcept
      : x(static_cast<Number>(v[0])), y(static_cast<Number>(v[1])), z(static_cast<Number>(v[2])) {}
};

/// out = R * v, of column-major R; plus `offset` unless that is null.
template <class Number>
SIDESTEP_INLINE void multiply(const Number (&R)[9][kLanesOf<Number>], const Vector<Number>& v,
                              Number (*out)[kLanesOf<Number>],
                              const Number (*offset)[kLanesOf<Number>]) noexcept {
  for (std::size_t row = 0; row < 3; ++row) {
    LanesOf<Number> sum = lanes(R[row]) * v.x + lanes(R[3 + row]) * v.y + lanes(R[6 + row]) * v.z;
    if (offset != nullptr) sum += lanes(offset[row]);
    lanes(out[row]) = sum;
  }
}

/// out = column `axis` of R, counted from 1, reversed where that is negative.
template <class Number>
SIDESTEP_INLINE void copy_axis(const Number (&R)[9][kLanesOf<Number>], int axis,
                               Number (*out)[kLanesOf<Number>]) noexcept {
  const std::size_t from = 3 * (static_cast<std::size_t>(axis < 0 ? -axis : axis) - 1);
  for (std::size_t row = 0; row < 3; ++row) {
    const LanesOf<Number> value = lanes(R[from + row]);
    lanes(out[row]) = axis < 0 ? -value : value;
  }
}

/// The pose of a frame that is fixed to a body, or to the world where that is null.
template <class Number>
SIDESTEP_INLINE void attach(const Poses<Number>* body, const TreeBody& frame,
                            Poses<Number>& out) noexcept {
  const double* R = frame.R_parent_joint.data();
  const double* p = frame.p_parent_joint.data();
  if (body == nullptr) {
    for (std::size_t i = 0; i < 9; ++i) {
      lanes(out.R[i]) = LanesOf<Number>{} + static_cast<Number>(R[i]);
    }
    for (std::size_t i = 0; i < 3; ++i) {
      lanes(out.p[i]) = LanesOf<Number>{} + static_cast<Number>(p[i]);
    }
    return;
  }
  for (std::size_t column = 0; column < 3; ++column) {
    const int axis = frame.axes[column];
    if (axis == 0) {
      multiply<Number>(body->R, Vector<Number>(R + 3 * column), out.R + 3 * column, nullptr);
    } else {
      copy_axis<Number>(body->R, axis, out.R + 3 * column);
    }
  }
  multiply<Number>(body->R, Vector<Number>(p), out.p, body->p);
}

/// Turns about the frame's own z, or shifts along it. Of an angle or a way, what place_fast() and
/// place_any() have left where the pose will be: a sine and a cosine, or the way.
template <class Number>
SIDESTEP_INLINE void move(const TreeBody& body, const LanesOf<Number>& first,
                          const LanesOf<Number>& second, Poses<Number>& pose) noexcept {
  if (body.motion == Motion::kTranslation) {
    for (std::size_t row = 0; row < 3; ++row) lanes(pose.p[row]) += first * lanes(pose.R[6 + row]);
    return;
  }
  for (std::size_t row = 0; row < 3; ++row) {
    const LanesOf<Number> x = lanes(pose.R[row]), y = lanes(pose.R[3 + row]);
    lanes(pose.R[row]) = second * x + first * y;
    lanes(pose.R[3 + row]) = second * y - first * x;
  }
}

/// What joints do, in `poses` as move() wants it, makes poses of.
template <class Number>
SIDESTEP_INLINE void move_all(std::span<const TreeBody> bodies, Poses<Number>* poses) noexcept {
  for (std::size_t b = 0; b < bodies.size(); ++b) {
    const TreeBody& body = bodies[b];
    const LanesOf<Number> first = lanes(poses[b].R[0]), second = lanes(poses[b].R[1]);
    attach<Number>(body.parent == -1 ? nullptr : poses + body.parent, body, poses[b]);
    if (body.joint != -1) move<Number>(body, first, second, poses[b]);
  }
}

SIDESTEP_INLINE void read_joint(const TreeBody& body, const double* const* rows,
                                Lanes& values) noexcept {
  const int j = body.joint;
  alignas(64) const double of_joint[] = {rows[0][j], rows[1][j], rows[2][j], rows[3][j],
                                         rows[4][j], rows[5][j], rows[6][j], rows[7][j]};
  values = body.multiplier * lanes(of_joint) + body.offset;
}

SIDESTEP_INLINE void keep_largest(const Lanes& values, Lanes& largest) noexcept {
  largest = greater(abs(values), largest);
}

SIDESTEP_INLINE void read_motion(const TreeBody& body, const Rows<double>& rows, Lanes& largest,
                                 Poses<double>& pose) noexcept {
  Lanes value, s, c;
  read_joint(body, rows, value);
  if (body.motion == Motion::kTranslation) {
    lanes(pose.R[0]) = value;
    return;
  }
  keep_largest(value, largest);
  sine_lanes(value, s, c);
  lanes(pose.R[0]) = s;
  lanes(pose.R[1]) = c;
}

SIDESTEP_INLINE void read_motion(const TreeBody& body, const Rows<float>& rows, Lanes& largest,
                                 Poses<float>& pose) noexcept {
  Lanes low, high;
  read_joint(body, rows, low);
  read_joint(body, rows + kLanes, high);
  if (body.motion == Motion::kTranslation) {
    lanes(pose.R[0]) = join(low, high);
    return;
  }
  FloatLanes first, second;
  keep_largest(low, largest);
  keep_largest(high, largest);
  sine_lanes(low, high, first, second);
  lanes(pose.R[0]) = first;
  lanes(pose.R[1]) = second;
}

/// Returns the largest angle; the poses are right where that is no larger than kLargestAngle.
template <class Number>
SIDESTEP_INLINE double place(std::span<const TreeBody> bodies, const Rows<Number>& rows,
                             Poses<Number>* poses) noexcept {
  // First what no pose depends on: sines are found side by side where nothing waits for them.
  Lanes largest = {};
  for (std::size_t b = 0; b < bodies.size(); ++b) {
    if (bodies[b].joint != -1) read_motion(bodies[b], rows, largest, poses[b]);
  }
  move_all<Number>(bodies, poses);
  double most = 0.0;
  for (std::size_t lane = 0; lane < kLanes; ++lane) most = greater(most, largest[lane]);
  return most;
}

/// The same for angles of any size.
template <class Number>
void place_any(std::span<const TreeBody> bodies, const Rows<Number>& rows,
               Poses<Number>* poses) noexcept {
  for (std::size_t b = 0; b < bodies.size(); ++b) {
    const TreeBody& body = bodies[b];
    if (body.joint == -1) continue;
    const bool turns = body.motion == Motion::kRotation;
    for (std::size_t lane = 0; lane < kLanesOf<Number>; ++lane) {
      const double value = body.multiplier * rows[lane][body.joint] + body.offset;
      poses[b].R[0][lane] = static_cast<Number>(turns ? std::sin(value) : value);
      poses[b].R[1][lane] = static_cast<Number>(std::cos(value));
    }
  }
  move_all<Number>(bodies, poses);
}

template <class Number>
void find_rows(std::span<const double> q, std::size_t dof, Rows<Number>& rows) noexcept {
  for (std::size_t lane = 0; lane < kLanesOf<Number>; ++lane) {
    rows[lane] = q.data() + std::min(lane * dof, q.size() - dof);
  }
}

template <class Number>
void place_all(std::span<const TreeBody> bodies, std::span<const double> q, std::size_t dof,
               Poses<Number>* poses) noexcept {
  Rows<Number> rows;
  find_rows<Number>(q, dof, rows);
  if (place<Number>(bodies, rows, poses) > kLargestAngle) place_any<Number>(bodies, rows, poses);
}

template <class Number>
void carry(std::span<const TreeSphere> spheres, const Poses<Number>* poses,
           Points<Number>* centres) noexcept {
  for (std::size_t i = 0; i < spheres.size(); ++i) {
    const Poses<Number>& body = poses[spheres[i].body];
    const Vector<Number> v(spheres[i].p_body.data());
    Number* out[] = {centres[i].x, centres[i].y, centres[i].z};
    for (std::size_t row = 0; row < 3; ++row) {
      lanes(out[row]) = lanes(body.R[row]) * v.x + lanes(body.R[3 + row]) * v.y +
                        lanes(body.R[6 + row]) * v.z + lanes(body.p[row]);
    }
  }
}

template <class Number>
void copy_axes(const Poses<Number>* poses, std::size_t count, Axes<Number>* axes) noexcept {
  for (std::size_t b = 0; b < count; ++b) {
    for (std::size_t row = 0; row < 3; ++row) {
      lanes(axes[b].z[row]) = lanes(poses[b].R[6 + row]);
      lanes(axes[b].p[row]) = lanes(poses[b].p[row]);
    }
  }
}

template <class Number>
void make_screws(std::span<const TreeBody> bodies, const Axes<Number>* axes,
                 Screws<Number>* screws) noexcept {
  for (std::size_t b = 0; b < bodies.size(); ++b) {
    const Axes<Number>& at = axes[b];
    const bool turns = bodies[b].motion == Motion::kRotation;
    for (std::size_t row = 0; row < 3; ++row) {
      const std::size_t next = (row + 1) % 3, last = (row + 2) % 3;
      const LanesOf<Number> axis = lanes(at.z[row]);
      const LanesOf<Number> offset =
          lanes(at.p[next]) * lanes(at.z[last]) - lanes(at.p[last]) * lanes(at.z[next]);
      lanes(screws[b].values[row]) = turns ? axis : LanesOf<Number>{};
      lanes(screws[b].values[3 + row]) = turns ? offset : axis;
    }
  }
}

SIDESTEP_INLINE void read_lanes(const double* from, Lanes& out) noexcept { out = lanes(from); }
SIDESTEP_INLINE void read_lanes(const float* from, Lanes& out) noexcept { read_halves(from, out); }

template <class Number>
void add_up_works(std::span<const LinkForce> forces, const int* body_of_link, const Number* table,
                  std::size_t stride, const double* weights, double* works,
                  std::size_t step) noexcept {
  for (std::size_t c = 0; c < stride; c += kLanes) {
    Lanes column[6];
#pragma GCC unroll 6
    for (std::size_t i = 0; i < 6; ++i) read_lanes(table + i * stride + c, column[i]);
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

}  // namespace

#endif
