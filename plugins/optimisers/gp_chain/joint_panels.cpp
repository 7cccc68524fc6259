#ifndef SIDESTEP_KERNELS
#include "joint_panels.hpp"

#include <cmath>
#include <cstdint>
#include <limits>

namespace sidestep {
namespace {

/// All of a double but its sign: zero has two.
constexpr std::int64_t kMagnitude = std::numeric_limits<std::int64_t>::max();

/// The rows of the coupling of a panel to a neighbour: of its q, v by the state's own q, v.
struct CouplingRows {
  const double *qq, *vq, *qv, *vv;

  SIDESTEP_INLINE CouplingRows(Neighbour into, const double* panel, std::size_t stride) noexcept
      : qq(panel + JointPanel::kNextQQ * stride),
        vq(panel + (into == Neighbour::kNext ? JointPanel::kNextVQ : JointPanel::kNextQV) * stride),
        qv(panel + (into == Neighbour::kNext ? JointPanel::kNextQV : JointPanel::kNextVQ) * stride),
        vv(panel + JointPanel::kNextVV * stride) {}
};

}  // namespace
}  // namespace sidestep

#define SIDESTEP_KERNELS "joint_panels.cpp"
#include <sidestep/core/each_target.hpp>

namespace sidestep {

void mark_couplings(std::size_t stride, std::size_t own, std::size_t dof,
                    std::int64_t* masks) noexcept {
  for (std::size_t c = 0; c < 2 * dof; ++c) {
    for (std::size_t r = 0; r < stride; ++r) {
      const std::size_t row = r < own ? r : r - own;
      const bool is_below = r >= own || r > c;
      const bool is_same_joint = row % dof == c % dof;
      masks[c * stride + r] = is_below && row < 2 * dof && !is_same_joint ? kMagnitude : 0;
    }
  }
}

void find_couplings(const double* columns, const std::int64_t* masks, std::size_t stride,
                    std::size_t own, std::size_t dof, bool& in_own, bool& in_next) noexcept {
  SIDESTEP_BEST(find_couplings)(columns, masks, stride, own, dof, in_own, in_next);
}

void read_joint_panel(const double* columns, std::size_t stride, std::size_t own, std::size_t dof,
                      double* panel) noexcept {
  const std::size_t row = padded(dof);
  for (std::size_t j = 0; j < row; ++j) {
    if (j >= dof) {
      for (std::size_t i = 0; i < JointPanel::kRows; ++i) panel[i * row + j] = 0.0;
      panel[JointPanel::kOwnQQ * row + j] = panel[JointPanel::kOwnVV * row + j] = 1.0;
      continue;
    }
    const double* by_q = columns + j * stride + j;
    const double* by_v = columns + (j + dof) * stride + j;
    panel[JointPanel::kOwnQQ * row + j] = by_q[0];
    panel[JointPanel::kOwnVQ * row + j] = by_q[dof];
    panel[JointPanel::kOwnVV * row + j] = by_v[dof];
    panel[JointPanel::kNextQQ * row + j] = by_q[own];
    panel[JointPanel::kNextVQ * row + j] = by_q[own + dof];
    panel[JointPanel::kNextQV * row + j] = by_v[own];
    panel[JointPanel::kNextVV * row + j] = by_v[own + dof];
  }
}

bool eliminate_joints(Neighbour into, const double* own_panel, const double* coupling_panel,
                      const double* b, const double* taken, double lambda, std::size_t dof,
                      double* factor, double* remainder) noexcept {
  return SIDESTEP_BEST(eliminate_joints)(into, own_panel, coupling_panel, b, taken, lambda, dof,
                                         factor, remainder);
}

void substitute_joints(Neighbour into, const double* factor, const double* coupling_panel,
                       const double* x_neighbour, std::size_t dof, double* x) noexcept {
  SIDESTEP_BEST(substitute_joints)(into, factor, coupling_panel, x_neighbour, dof, x);
}

void take_remainder(const double* remainder, std::size_t stride, std::size_t own, std::size_t dof,
                    double* columns) noexcept {
  const std::size_t row = padded(dof);
  for (std::size_t j = 0; j < dof; ++j) {
    double* by_q = columns + j * stride;
    double* by_v = columns + (j + dof) * stride;
    by_q[j] -= remainder[JointRemainder::kQQ * row + j];
    by_q[j + dof] -= remainder[JointRemainder::kVQ * row + j];
    by_v[j + dof] -= remainder[JointRemainder::kVV * row + j];
    by_q[own + 2 * dof] -= remainder[JointRemainder::kBQ * row + j];
    by_v[own + 2 * dof] -= remainder[JointRemainder::kBV * row + j];
  }
}

void put_normals(const double* n, std::size_t dof, double* factor) noexcept {
  const std::size_t row = padded(dof);
  for (std::size_t j = 0; j < dof; ++j) {
    const double iqq = factor[JointFactor::kQQ * row + j], ivq = factor[JointFactor::kVQ * row + j],
                 ivv = factor[JointFactor::kVV * row + j];
    // y = R n, where R R^T is the block whose inverse is kept.
    const double determinant = 1.0 / (iqq * ivv - ivq * ivq);
    const double root = std::sqrt(ivv * determinant);
    factor[JointFactor::kYQ * row + j] = root * n[j];
    factor[JointFactor::kYV * row + j] =
        -ivq * determinant / root * n[j] + n[dof + j] / std::sqrt(ivv);
  }
}

}  // namespace sidestep

#else

namespace {

using Bits = Mask<double, kParts>;

SIDESTEP_INLINE const Bits& bits(const void* at) noexcept { return *static_cast<const Bits*>(at); }

void find_couplings(const double* columns, const std::int64_t* masks, std::size_t stride,
                    std::size_t own, std::size_t dof, bool& in_own, bool& in_next) noexcept {
  in_own = columns[1] != 0.0 && dof > 1;
  in_next = columns[own + 1] != 0.0 && dof > 1;
  if (in_own && in_next) return;  // as a rule, if any joints are coupled, the first two are
  Bits of_own = {}, of_next = {};
  for (std::size_t c = 0; c < 2 * dof; ++c) {
    const double* column = columns + c * stride;
    const std::int64_t* mask = masks + c * stride;
    for (std::size_t r = 0; r < own; r += kLanes) of_own |= bits(column + r) & bits(mask + r);
    for (std::size_t r = own; r < stride; r += kLanes) {
      of_next |= bits(column + r) & bits(mask + r);
    }
  }
  std::int64_t any_own = 0, any_next = 0;
  for (std::size_t i = 0; i < kLanes; ++i) {
    any_own |= of_own[i];
    any_next |= of_next[i];
  }
  in_own = any_own != 0;
  in_next = any_next != 0;
}

bool eliminate_joints(Neighbour into, const double* own_panel, const double* coupling_panel,
                      const double* b, const double* taken, double lambda, std::size_t dof,
                      double* factor, double* remainder) noexcept {
  const std::size_t row = padded(dof);
  const CouplingRows to(into, coupling_panel, row);
  Bits lane;
  count_lanes(lane);
  Lanes wrong = {};
  for (std::size_t j = 0; j < row; j += kLanes) {
    const Bits is_joint = lane < static_cast<std::int64_t>(dof - j);
    Lanes qq = lanes(own_panel + JointPanel::kOwnQQ * row + j) + lambda;
    Lanes vq = lanes(own_panel + JointPanel::kOwnVQ * row + j);
    Lanes vv = lanes(own_panel + JointPanel::kOwnVV * row + j) + lambda;
    Lanes yq = choose(is_joint, lanes(b + j), 0.0);
    Lanes yv = choose(is_joint, lanes(b + dof + j), 0.0);
    if (taken != nullptr) {
      qq -= lanes(taken + JointRemainder::kQQ * row + j);
      vq -= lanes(taken + JointRemainder::kVQ * row + j);
      vv -= lanes(taken + JointRemainder::kVV * row + j);
      yq -= lanes(taken + JointRemainder::kBQ * row + j);
      yv -= lanes(taken + JointRemainder::kBV * row + j);
    }
    const Lanes determinant = qq * vv - vq * vq;
    const Lanes least = lesser(qq, determinant);
    wrong += choose(least > 0.0, Lanes{}, 1.0) + choose(determinant < 1e300, Lanes{}, 1.0);
    const Lanes inverse = 1.0 / determinant;
    const Lanes iqq = vv * inverse, ivq = -vq * inverse, ivv = qq * inverse;
    lanes(factor + JointFactor::kQQ * row + j) = iqq;
    lanes(factor + JointFactor::kVQ * row + j) = ivq;
    lanes(factor + JointFactor::kVV * row + j) = ivv;
    lanes(factor + JointFactor::kYQ * row + j) = yq;
    lanes(factor + JointFactor::kYV * row + j) = yv;
    // (coupling) (own blocks)^-1
    const Lanes kqq = lanes(to.qq + j), kvq = lanes(to.vq + j), kqv = lanes(to.qv + j),
                kvv = lanes(to.vv + j);
    const Lanes tqq = kqq * iqq + kqv * ivq, tqv = kqq * ivq + kqv * ivv;
    const Lanes tvq = kvq * iqq + kvv * ivq, tvv = kvq * ivq + kvv * ivv;
    lanes(remainder + JointRemainder::kQQ * row + j) = tqq * kqq + tqv * kqv;
    lanes(remainder + JointRemainder::kVQ * row + j) = tvq * kqq + tvv * kqv;
    lanes(remainder + JointRemainder::kVV * row + j) = tvq * kvq + tvv * kvv;
    lanes(remainder + JointRemainder::kBQ * row + j) = tqq * yq + tqv * yv;
    lanes(remainder + JointRemainder::kBV * row + j) = tvq * yq + tvv * yv;
  }
  return sum_of(wrong) == 0.0;
}

void substitute_joints(Neighbour into, const double* factor, const double* coupling_panel,
                       const double* x_neighbour, std::size_t dof, double* x) noexcept {
  const std::size_t row = padded(dof);
  const CouplingRows to(into, coupling_panel, row);
  // Positions first: their lanes beyond the last joint fall on velocities.
  for (std::size_t part = 0; part < 2; ++part) {
    const double* by_q = factor + (part == 0 ? JointFactor::kQQ : JointFactor::kVQ) * row;
    const double* by_v = factor + (part == 0 ? JointFactor::kVQ : JointFactor::kVV) * row;
    for (std::size_t j = 0; j < row; j += kLanes) {
      const Lanes q = lanes(x_neighbour + j), v = lanes(x_neighbour + dof + j);
      const Lanes yq =
          lanes(factor + JointFactor::kYQ * row + j) - lanes(to.qq + j) * q - lanes(to.vq + j) * v;
      const Lanes yv =
          lanes(factor + JointFactor::kYV * row + j) - lanes(to.qv + j) * q - lanes(to.vv + j) * v;
      lanes(x + part * dof + j) = lanes(by_q + j) * yq + lanes(by_v + j) * yv;
    }
  }
}

}  // namespace

#endif
