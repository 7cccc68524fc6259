#ifndef SIDESTEP_KERNELS
#include "panel_kernels.hpp"

#include <cmath>
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

#define SIDESTEP_KERNELS "panel_kernels.cpp"
#include <sidestep/core/each_target.hpp>

namespace sidestep {

void load_panel(const ChainPanel& panel, const double* source, const ChainPanel* previous,
                double* scaled) {
  SIDESTEP_DISPATCH(load_panel)(panel, source, previous, scaled);
}

bool factorise_panel(const ChainPanel& panel, double lambda) {
  return SIDESTEP_DISPATCH(factorise_panel)(panel, lambda);
}

void substitute_panel(const ChainPanel& panel, const double* next, double* x) {
  SIDESTEP_DISPATCH(substitute_panel)(panel, next, x);
}

double dot(const double* a, const double* b, std::size_t count) noexcept {
  return SIDESTEP_DISPATCH(dot)(a, b, count);
}

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
  SIDESTEP_DISPATCH(find_couplings)(columns, masks, stride, own, dof, in_own, in_next);
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
  return SIDESTEP_DISPATCH(eliminate_joints)(into, own_panel, coupling_panel, b, taken, lambda, dof,
                                             factor, remainder);
}

void substitute_joints(Neighbour into, const double* factor, const double* coupling_panel,
                       const double* x_neighbour, std::size_t dof, double* x) noexcept {
  SIDESTEP_DISPATCH(substitute_joints)(into, factor, coupling_panel, x_neighbour, dof, x);
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

// Stores of lanes may alias anything, so that what the loops need of a panel is copied first.

namespace {

/// Two pivots: column k, and column k + 1 after the elimination of k.
struct PivotPair {
  const double *first, *second;
  double first_inverse, second_inverse;
};

/// What two pivots take from the columns `begin` and on, of those whose diagonal lies in lanes
/// `block`: what is read of them later lies in these lanes and beyond. Of `kRows` lanes a column,
/// or if that is 0 of `row_lanes`.
template <std::size_t kRows>
SIDESTEP_INLINE void update_columns(const ChainPanel& panel, const PivotPair& pivots, std::size_t k,
                                    std::size_t begin, std::size_t block, std::size_t row_lanes) {
  const std::size_t own = panel.own, stride = row_lanes * kLanes;
  const std::size_t end = lesser(panel.width, (block + 1) * kLanes);
  double* const columns = panel.columns;
  double* const rows = panel.rows;
  Lanes first[kRows + 1], second[kRows + 1];
#pragma GCC unroll 8
  for (std::size_t r = block; r < kRows; ++r) {
    first[r] = lanes(pivots.first + r * kLanes);
    second[r] = lanes(pivots.second + r * kLanes);
  }
  for (std::size_t j = begin; j < end; ++j) {
    const double by_first = pivots.first[j] * pivots.first_inverse;
    const double by_second = pivots.second[j] * pivots.second_inverse;
    rows[j * own + k] = by_first;
    rows[j * own + k + 1] = by_second;
    double* column = columns + j * stride;
#pragma GCC unroll 8
    for (std::size_t r = block; r < kRows; ++r) {
      lanes(column + r * kLanes) -= by_first * first[r] + by_second * second[r];
    }
    for (std::size_t r = block * kLanes; kRows == 0 && r < stride; r += kLanes) {
      lanes(column + r) -=
          by_first * lanes(pivots.first + r) + by_second * lanes(pivots.second + r);
    }
  }
}

/// The elimination of two pivots after the other two (L D L^T, right-looking), each with lambda
/// added, for panels of `kRows` lanes; of any number if that is 0. With two at once every column is
/// read and written half as often, and their divisions do not wait for each other.
template <std::size_t kRows>
SIDESTEP_INLINE bool eliminate(const ChainPanel& panel, double lambda) {
  const std::size_t width = panel.width, own = panel.own;
  const std::size_t row_lanes = kRows != 0 ? kRows : (own + panel.next) / kLanes;
  const std::size_t stride = row_lanes * kLanes;
  double* const columns = panel.columns;
  double* const rows = panel.rows;
  double* const inverse_pivots = panel.inverse_pivots;
  for (std::size_t k = 0; k < width; k += 2) {
    const double* first = columns + k * stride;
    double* second = columns + (k + 1) * stride;
    const double pivot = first[k] + lambda;
    const double across = first[k + 1];
    const double determinant = pivot * (second[k + 1] + lambda) - across * across;
    if (!(pivot > 0.0) || !(determinant > 0.0) || !(determinant < 1e300)) return false;
    const PivotPair pivots{first, second, 1.0 / pivot, pivot / determinant};
    inverse_pivots[k] = pivots.first_inverse;
    inverse_pivots[k + 1] = pivots.second_inverse;
    const double factor = across * pivots.first_inverse;
    rows[(k + 1) * own + k] = factor;
#pragma GCC unroll 8
    for (std::size_t r = 0; r < row_lanes; ++r) {
      lanes(second + r * kLanes) -= factor * lanes(first + r * kLanes);
    }
#pragma GCC unroll 4
    for (std::size_t block = 0; block < row_lanes / 2; ++block) {
      update_columns<kRows>(panel, pivots, k, greater(k + 2, block * kLanes), block, row_lanes);
    }
  }
  return true;
}

/// A panel without what eliminating the previous one leaves to it.
SIDESTEP_INLINE void copy_panel(const ChainPanel& panel, const double* source) {
  const std::size_t count = panel.width * (panel.own + panel.next);
  for (std::size_t i = 0; i < count; i += kLanes) lanes(panel.columns + i) = lanes(source + i);
}

void load_panel(const ChainPanel& panel, const double* source, const ChainPanel* previous,
                double* scaled) {
  const std::size_t width = panel.width, own = panel.own, next = panel.next, stride = own + next;
  double* const columns = panel.columns;
  if (previous == nullptr) return copy_panel(panel, source);
  const double* const eliminated = previous->columns + own;
  const double* const inverse_pivots = previous->inverse_pivots;
  double* const b = scaled + width * next;
  for (std::size_t k = 0; k < width; ++k) {
    for (std::size_t r = 0; r <= width; r += kLanes) {
      lanes(scaled + k * next + r) = inverse_pivots[k] * lanes(eliminated + k * stride + r);
    }
  }
  // Eight columns at a time, and b with the first: each row of the coupling is read once for all.
  for (std::size_t first = 0; first < width; first += kLanes) {
    const std::size_t count = lesser(width - first, kLanes);
    for (std::size_t r = first; r < own; r += kLanes) {  // rows above the diagonal are never read
      Lanes left[kLanes], left_of_b = {};
#pragma GCC unroll 8
      for (std::size_t j = 0; j < kLanes; ++j) left[j] = Lanes{};
      for (std::size_t k = 0; k < width; ++k) {
        const Lanes values = lanes(eliminated + k * stride + r);
        const double* factors = scaled + k * next + first;
#pragma GCC unroll 8
        for (std::size_t j = 0; j < kLanes; ++j) left[j] += factors[j] * values;
        if (first == 0) left_of_b += scaled[k * next + width] * values;
      }
      for (std::size_t j = 0; j < count; ++j) {
        const std::size_t at = (first + j) * stride + r;
        lanes(columns + at) = lanes(source + at) - left[j];
      }
      if (first == 0) lanes(b + r) = left_of_b;
    }
  }
  for (std::size_t j = 0; j < width; ++j) {
    const double* from = source + j * stride + own;
    double* to = columns + j * stride + own;
    for (std::size_t r = 0; r < next; r += kLanes) lanes(to + r) = lanes(from + r);
    to[width] -= b[j];
  }
}

bool factorise_panel(const ChainPanel& panel, double lambda) {
  switch ((panel.own + panel.next) / kLanes) {
    case 2: return eliminate<2>(panel, lambda);
    case 3: return eliminate<3>(panel, lambda);
    case 4: return eliminate<4>(panel, lambda);
    case 5: return eliminate<5>(panel, lambda);
    case 6: return eliminate<6>(panel, lambda);
    default: return eliminate<0>(panel, lambda);
  }
}

void substitute_panel(const ChainPanel& panel, const double* next, double* x) {
  const std::size_t width = panel.width, own = panel.own, stride = own + panel.next;
  const double* const couplings = panel.columns + own;
  const double* const rows = panel.rows;
  const double* const inverse_pivots = panel.inverse_pivots;
  for (std::size_t k = 0; k < width; ++k) {
    const double* coupling = couplings + k * stride;
    Lanes sum = {};
    for (std::size_t r = 0; r < own; r += kLanes) sum += lanes(coupling + r) * lanes(next + r);
    // In a tree: one after the other, the additions would wait for each other.
    const double dot =
        ((sum[0] + sum[1]) + (sum[2] + sum[3])) + ((sum[4] + sum[5]) + (sum[6] + sum[7]));
    x[k] = (coupling[width] - dot) * inverse_pivots[k];
  }
  for (std::size_t j = width; j-- > 1;) {
    const double* row = rows + j * own;
    const double solved = x[j];
    for (std::size_t r = 0; r < j; r += kLanes) lanes(x + r) -= solved * lanes(row + r);
  }
}

double dot(const double* a, const double* b, std::size_t count) noexcept {
  Lanes sums = {};
  std::size_t i = 0;
  for (; i + kLanes <= count; i += kLanes) sums += lanes(a + i) * lanes(b + i);
  double rest = 0.0;
  for (; i < count; ++i) rest += a[i] * b[i];
  return rest + sum_of(sums);
}

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
