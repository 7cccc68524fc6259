#pragma once

#include <cmath>
#include <cstddef>
#include <cstdint>

#include "cuda/kernel.hpp"

/// A problem as kernels, which know no Eigen, see it: plain numbers, and pointers into the memory
/// of a backend.
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

/// The most of each that kernels have room for.
inline constexpr int kLargestDof = 16;
inline constexpr int kLargestBodies = 32;
inline constexpr int kLargestSpheres = 160;
inline constexpr int kLargestTerms = 16;

enum class Motion { kFixed, kRotation, kTranslation };

/// A body of a KinematicTree, whose documentation has what it means.
struct Body {
  int parent = -1;
  Motion motion = Motion::kFixed;
  int joint = -1;
  double multiplier = 1.0;
  double offset = 0.0;
  Pose T_parent_joint;
};

struct Sphere {
  int body = 0;
  Vec3 p_body;
};

/// Two spheres and how far apart their centres are where a cost begins.
struct SpherePair {
  int a = 0;
  int b = 0;
  double reach_m = 0.0;
};

/// At which states of a chain a cost applies; as sidestep::Placement.
enum class At { kStart, kGoal, kSupport, kEverywhere };

/// A cost term. What its numbers are depends on its kind (docstrings); they begin at `numbers` of
/// the problem's, or, of targets, of the chain's own.
struct Term {
  enum class Kind {
    kObstacle,       ///< Of each sphere, how far its centre is from obstacles where cost begins.
    kFloor,          ///< Of each sphere, the height at which it begins; -infinity for none.
    kSelfCollision,  ///< None; `count` pairs of links, the first of which is `numbers`.
    kPositionLimit,  ///< d lower, d upper.
    kVelocityLimit,  ///< The same.
    kTarget,         ///< d positions and their weights, d velocities and their weights.
    kLinkPose,       ///< Target R (by columns) and p; R and p of the link in `body`; 2 weights.
    kLinkAxis,       ///< Axis in `body`; in the world; the two directions across that.
  };
  Kind kind = Kind::kTarget;
  At at = At::kSupport;
  double weight = 1.0;
  int numbers = 0;
  int count = 0;
  int body = 0;
};

/// How many numbers a term of these kinds has.
inline constexpr int kLinkPoseNumbers = 26;
inline constexpr int kLinkAxisNumbers = 12;

/// A distance field where it lies, and what space without measurements counts as.
struct FieldOnDevice {
  const float* distances_m = nullptr;    ///< Of blocks of 16^3, one after the other, x fastest.
  const std::uint16_t* known = nullptr;  ///< Of the same, bit x of row y + 16 z.
  cuda::Extent size_vox;
  cuda::Extent blocks;
  Vec3 origin_m;
  double resolution_m = 1.0;
  bool unknown_is_occupied = true;
  bool outside_is_occupied = true;
};

/// How the position (0) and the velocity (1) of a joint, between two support states, follow from
/// its position and velocity before and after.
struct Interpolation {
  double by[2][4];
};

/// The blocks of the GP prior that every joint has, up to its weight.
struct PriorBlocks {
  double information[3] = {};  ///< Q(dt)^-1 for Qc = 1: position, mixed, velocity.
  double own[3] = {};          ///< Phi^T Q^-1 Phi, likewise.
  double across[2][2] = {};    ///< -Q^-1 Phi: row of the next state, column of this one.
};

/// What all chains of a batch have in common.
struct ChainProblem {
  int dof = 0;
  int states = 0;  ///< Support states.
  int checks = 0;  ///< Interpolated ones between each two.
  double dt_s = 0.0;
  bool is_start_held = false;
  bool is_goal_held = false;
  PriorBlocks prior;
  int bodies = 0, spheres = 0, terms = 0;
  Term term[kLargestTerms];
  int own_numbers = 0;  ///< Of each chain.

  const double* inverse_qc = nullptr;
  const Interpolation* interpolations = nullptr;
  const Body* body = nullptr;
  const Sphere* sphere = nullptr;
  const SpherePair* pairs = nullptr;
  const std::int32_t* pair_ends = nullptr;  ///< Of the pairs of each pair of links.
  const double* numbers = nullptr;
  FieldOnDevice field;

  [[nodiscard]] SIDESTEP_HOST_DEVICE int width() const { return 2 * dof; }
  [[nodiscard]] SIDESTEP_HOST_DEVICE int all_states() const {
    return (states - 1) * (checks + 1) + 1;
  }
  [[nodiscard]] SIDESTEP_HOST_DEVICE int values() const { return states * width(); }
  /// Numbers of StateShare::store().
  [[nodiscard]] SIDESTEP_HOST_DEVICE int share_size() const {
    return dof * (dof + 1) / 2 + 3 * dof;
  }
};

}  // namespace sidestep::gp_chain_cuda
