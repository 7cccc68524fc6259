#pragma once

#include <cmath>

#include "cuda/host_device.hpp"

/// Vectors and rotations for kernels, which know no Eigen.
namespace sidestep::gp_chain_cuda {

struct Vec3 {
  double x = 0.0;
  double y = 0.0;
  double z = 0.0;
};

SIDESTEP_HOST_DEVICE inline Vec3 operator+(const Vec3& a, const Vec3& b) {
  return {a.x + b.x, a.y + b.y, a.z + b.z};
}
SIDESTEP_HOST_DEVICE inline Vec3 operator-(const Vec3& a, const Vec3& b) {
  return {a.x - b.x, a.y - b.y, a.z - b.z};
}
SIDESTEP_HOST_DEVICE inline Vec3 operator*(double s, const Vec3& a) {
  return {s * a.x, s * a.y, s * a.z};
}
SIDESTEP_HOST_DEVICE inline double dot(const Vec3& a, const Vec3& b) {
  return a.x * b.x + a.y * b.y + a.z * b.z;
}
SIDESTEP_HOST_DEVICE inline Vec3 cross(const Vec3& a, const Vec3& b) {
  return {a.y * b.z - a.z * b.y, a.z * b.x - a.x * b.z, a.x * b.y - a.y * b.x};
}
SIDESTEP_HOST_DEVICE inline double norm(const Vec3& a) { return sqrt(dot(a, a)); }

/// By its columns.
struct Mat3 {
  Vec3 x{1.0, 0.0, 0.0};
  Vec3 y{0.0, 1.0, 0.0};
  Vec3 z{0.0, 0.0, 1.0};
};

SIDESTEP_HOST_DEVICE inline Vec3 operator*(const Mat3& m, const Vec3& v) {
  return v.x * m.x + v.y * m.y + v.z * m.z;
}
SIDESTEP_HOST_DEVICE inline Mat3 operator*(const Mat3& a, const Mat3& b) {
  return {a * b.x, a * b.y, a * b.z};
}
/// a^T b.
SIDESTEP_HOST_DEVICE inline Mat3 transposed_times(const Mat3& a, const Mat3& b) {
  const auto column = [&](const Vec3& v) { return Vec3{dot(a.x, v), dot(a.y, v), dot(a.z, v)}; };
  return {column(b.x), column(b.y), column(b.z)};
}

struct Pose {
  Mat3 R;
  Vec3 p;
};

/// log(R), the axis times the angle, in [0, pi].
SIDESTEP_HOST_DEVICE inline Vec3 rotation_vector(const Mat3& R) {
  // The quaternion, by the largest of its four parts, so that nothing small is divided by.
  const double trace = R.x.x + R.y.y + R.z.z;
  double w;
  Vec3 v;
  if (trace > 0.0) {
    const double twice = sqrt(trace + 1.0);
    w = 0.5 * twice;
    v = (0.5 / twice) * Vec3{R.y.z - R.z.y, R.z.x - R.x.z, R.x.y - R.y.x};
  } else if (R.x.x >= R.y.y && R.x.x >= R.z.z) {
    const double twice = sqrt(1.0 + R.x.x - R.y.y - R.z.z);
    w = 0.5 / twice * (R.y.z - R.z.y);
    v = {0.5 * twice, 0.5 / twice * (R.y.x + R.x.y), 0.5 / twice * (R.z.x + R.x.z)};
  } else if (R.y.y >= R.z.z) {
    const double twice = sqrt(1.0 + R.y.y - R.x.x - R.z.z);
    w = 0.5 / twice * (R.z.x - R.x.z);
    v = {0.5 / twice * (R.y.x + R.x.y), 0.5 * twice, 0.5 / twice * (R.z.y + R.y.z)};
  } else {
    const double twice = sqrt(1.0 + R.z.z - R.x.x - R.y.y);
    w = 0.5 / twice * (R.x.y - R.y.x);
    v = {0.5 / twice * (R.z.x + R.x.z), 0.5 / twice * (R.z.y + R.y.z), 0.5 * twice};
  }
  const double sine = norm(v);
  if (sine == 0.0) return {};
  const double angle = 2.0 * atan2(sine, w < 0.0 ? -w : w);
  return (w < 0.0 ? -angle : angle) / sine * v;
}

}  // namespace sidestep::gp_chain_cuda
