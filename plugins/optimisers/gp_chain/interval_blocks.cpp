#ifndef SIDESTEP_KERNELS
#include "interval_blocks.hpp"

#include <algorithm>
#include <array>

namespace sidestep {
namespace {

/// Pairs m >= n of the four parts of z, those of neighbouring rows of H far from each other: in
/// whole lanes they overlap, and what is read must have been written for a while.
constexpr std::size_t kPairs = 10;
constexpr std::size_t kRowOf[kPairs] = {0, 2, 2, 2, 1, 3, 1, 3, 3, 3};
constexpr std::size_t kColumnOf[kPairs] = {0, 0, 1, 2, 1, 3, 0, 0, 1, 2};

/// States that are summed at once; more are rare.
constexpr std::size_t kStatesAtOnce = 8;

/// Some of an interval's states, and what their costs go to.
struct IntervalSums {
  const double* hessians[kStatesAtOnce];   ///< J^T J,
  const double* gradients[kStatesAtOnce];  ///< and J^T r, of each state.
  double chains[kStatesAtOnce][4];         ///< The four c,
  double products[kStatesAtOnce][kPairs];  ///< and of each pair their product.
  std::size_t count = 0;
  double* blocks[kPairs];  ///< Of H, columns `stride` apart.
  double* rhs[4];
  std::size_t stride;
};

}  // namespace
}  // namespace sidestep

#define SIDESTEP_KERNELS "interval_blocks.cpp"
#include <sidestep/core/each_target.hpp>

namespace sidestep {
namespace {

/// How one interpolated state's position (row 0) or velocity (row 1) follows from z.
std::array<double, 4> chain(const GpPrior::Interpolation& at, Eigen::Index row) noexcept {
  return {at.lambda(row, 0), at.lambda(row, 1), at.psi(row, 0), at.psi(row, 1)};
}

/// A state whose costs depend on its velocity too: all four combinations, entry by entry.
void add_full_state(const StateNormals& normals, std::size_t state,
                    const GpPrior::Interpolation& at, ChainSystem& system, int interval) {
  const auto dof = static_cast<std::size_t>(normals.dof());
  const std::size_t stride = normals.full_stride();
  const StateNormals::Block block = normals.full(state);
  const auto by_q = chain(at, 0), by_qdot = chain(at, 1);
  for (std::size_t m = 0; m < 4; ++m) {
    double* rhs = interval_rhs(system, interval, m, dof);
    for (std::size_t j = 0; j < dof; ++j) {
      rhs[j] -= by_q[m] * block.gradient[j] + by_qdot[m] * block.gradient[dof + j];
    }
    for (std::size_t n = 0; n <= m; ++n) {
      double* to = interval_block(system, interval, m, n, dof);
      for (std::size_t c = 0; c < dof; ++c) {
        const double* q_column = block.hessian + c * stride;
        const double* qdot_column = block.hessian + (dof + c) * stride;
        for (std::size_t r = 0; r < dof; ++r) {
          to[c * system.stride() + r] +=
              by_q[m] * (by_q[n] * q_column[r] + by_qdot[n] * qdot_column[r]) +
              by_qdot[m] * (by_q[n] * q_column[dof + r] + by_qdot[n] * qdot_column[dof + r]);
        }
      }
    }
  }
}

}  // namespace

double* interval_block(ChainSystem& system, int interval, std::size_t m, std::size_t n,
                       std::size_t dof) noexcept {
  double* panel = n >= 2   ? system.own_block(interval + 1)
                  : m >= 2 ? system.coupling(interval)
                           : system.own_block(interval);
  return panel + (n % 2) * dof * system.stride() + (m % 2) * dof;
}

double* interval_rhs(ChainSystem& system, int interval, std::size_t m, std::size_t dof) noexcept {
  return system.rhs(interval + static_cast<int>(m / 2)) + (m % 2) * dof;
}

void add_support_state(const StateNormals& normals, std::size_t state, ChainSystem& system,
                       int support) {
  const auto dof = static_cast<std::size_t>(normals.dof());
  const auto add = [&](const StateNormals::Block& block, std::size_t width) {
    SIDESTEP_DISPATCH(add_columns)
    (system.own_block(support), system.stride(), block.hessian, width, width);
    SIDESTEP_DISPATCH(subtract_padded)(system.rhs(support), 1.0, block.gradient, width);
  };
  if (normals.has_position(state)) add(normals.position(state), dof);
  if (normals.has_full(state)) add(normals.full(state), 2 * dof);
}

void add_interval(const StateNormals& normals, std::size_t first,
                  std::span<const GpPrior::Interpolation> checks, ChainSystem& system,
                  int interval) {
  const auto dof = static_cast<std::size_t>(normals.dof());
  IntervalSums sums;
  const auto add = [&] {
    if (sums.count == 0) return;
    for (std::size_t pair = 0; pair < kPairs; ++pair) {
      sums.blocks[pair] = interval_block(system, interval, kRowOf[pair], kColumnOf[pair], dof);
    }
    for (std::size_t m = 0; m < 4; ++m) sums.rhs[m] = interval_rhs(system, interval, m, dof);
    sums.stride = system.stride();
    SIDESTEP_DISPATCH(add_sums)(sums, dof);
    sums.count = 0;
  };
  for (std::size_t k = 0; k < checks.size(); ++k) {
    const std::size_t state = first + k;
    if (normals.has_full(state)) add_full_state(normals, state, checks[k], system, interval);
    if (!normals.has_position(state)) continue;
    const StateNormals::Block block = normals.position(state);
    const auto c = chain(checks[k], 0);
    sums.hessians[sums.count] = block.hessian;
    sums.gradients[sums.count] = block.gradient;
    std::ranges::copy(c, sums.chains[sums.count]);
    for (std::size_t pair = 0; pair < kPairs; ++pair) {
      sums.products[sums.count][pair] = c[kRowOf[pair]] * c[kColumnOf[pair]];
    }
    if (++sums.count == kStatesAtOnce) add();
  }
  add();
}

void interpolate_between(const double* ends, std::size_t stride,
                         const GpPrior::Interpolation& interpolation, double* q,
                         double* qdot) noexcept {
  SIDESTEP_DISPATCH(interpolate_between)(ends, stride, interpolation, q, qdot);
}

}  // namespace sidestep

#else

namespace {

/// to += from, `columns` columns of `rows` values padded to whole lanes.
void add_columns(double* to, std::size_t to_stride, const double* from, std::size_t columns,
                 std::size_t rows) {
  const std::size_t from_stride = padded(rows);
  for (std::size_t j = 0; j < columns; ++j) {
    for (std::size_t r = 0; r < rows; r += kLanes) {
      lanes(to + j * to_stride + r) += lanes(from + j * from_stride + r);
    }
  }
}

/// The ten sums of c_m c_n J^T J and the four of c_m J^T r, column by column, so that each is kept
/// in a register over all states.
void add_sums(const IntervalSums& interval, std::size_t dof) {
  const std::size_t from_stride = padded(dof), to_stride = interval.stride, count = interval.count;
  for (std::size_t r = 0; r < dof; r += kLanes) {
    for (std::size_t c = 0; c < dof; ++c) {
      Lanes sums[kPairs];
#pragma GCC unroll 10
      for (std::size_t pair = 0; pair < kPairs; ++pair) sums[pair] = Lanes{};
      for (std::size_t k = 0; k < count; ++k) {
        const Lanes values = lanes(interval.hessians[k] + c * from_stride + r);
#pragma GCC unroll 10
        for (std::size_t pair = 0; pair < kPairs; ++pair) {
          sums[pair] += interval.products[k][pair] * values;
        }
      }
#pragma GCC unroll 10
      for (std::size_t pair = 0; pair < kPairs; ++pair) {
        lanes(interval.blocks[pair] + c * to_stride + r) += sums[pair];
      }
    }
    Lanes pulls[4];
#pragma GCC unroll 4
    for (std::size_t m = 0; m < 4; ++m) pulls[m] = Lanes{};
    for (std::size_t k = 0; k < count; ++k) {
      const Lanes gradient = lanes(interval.gradients[k] + r);
#pragma GCC unroll 4
      for (std::size_t m = 0; m < 4; ++m) pulls[m] += interval.chains[k][m] * gradient;
    }
#pragma GCC unroll 4
    for (std::size_t m = 0; m < 4; ++m) lanes(interval.rhs[m] + r) -= pulls[m];
  }
}

/// to -= factor * from, `count` values padded with zeros to whole lanes.
void subtract_padded(double* to, double factor, const double* from, std::size_t count) {
  for (std::size_t k = 0; k < count; k += kLanes) lanes(to + k) -= factor * lanes(from + k);
}

void interpolate_between(const double* ends, std::size_t stride,
                         const GpPrior::Interpolation& interpolation, double* q,
                         double* qdot) noexcept {
  const double* lambda = interpolation.lambda.data();  // column by column
  const double* psi = interpolation.psi.data();
  for (std::size_t j = 0; j < stride; j += kLanes) {
    const Lanes a = lanes(ends + j), adot = lanes(ends + stride + j),
                b = lanes(ends + 2 * stride + j), bdot = lanes(ends + 3 * stride + j);
    lanes(q + j) = lambda[0] * a + lambda[2] * adot + psi[0] * b + psi[2] * bdot;
    lanes(qdot + j) = lambda[1] * a + lambda[3] * adot + psi[1] * b + psi[3] * bdot;
  }
}

}  // namespace

#endif
