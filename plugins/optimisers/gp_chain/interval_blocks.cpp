#include "interval_blocks.hpp"

#include <algorithm>
#include <array>

namespace sidestep {
namespace {

/// Pairs m >= n of the four parts of z.
constexpr std::size_t kPairs = 10;

/// to += from, `columns` columns of `rows` values padded to whole lanes.
SIDESTEP_SIMD_CLONES
void add_columns(double* to, std::size_t to_stride, const double* from, std::size_t columns,
                 std::size_t rows) {
  const std::size_t from_stride = padded(rows);
  for (std::size_t j = 0; j < columns; ++j) {
    for (std::size_t r = 0; r < rows; r += kLanes) {
      lanes(to + j * to_stride + r) += lanes(from + j * from_stride + r);
    }
  }
}

/// sums[pair] += products[pair] * block, for all ten pairs.
SIDESTEP_SIMD_CLONES
void add_products(double* sums, const double* products, const double* block, std::size_t size) {
  for (std::size_t k = 0; k < size; k += kLanes) {
    const Lanes values = lanes(block + k);
#pragma GCC unroll 10
    for (std::size_t pair = 0; pair < kPairs; ++pair) {
      lanes(sums + pair * size + k) += products[pair] * values;
    }
  }
}

/// to -= factor * from, `count` values padded with zeros to whole lanes.
SIDESTEP_SIMD_CLONES
void subtract_padded(double* to, double factor, const double* from, std::size_t count) {
  for (std::size_t k = 0; k < count; k += kLanes) lanes(to + k) -= factor * lanes(from + k);
}

/// How one interpolated state's position (row 0) or velocity (row 1) follows from z.
std::array<double, 4> chain(const GpPrior::Interpolation& at, Eigen::Index row) noexcept {
  return {at.lambda(row, 0), at.lambda(row, 1), at.psi(row, 0), at.psi(row, 1)};
}

/// The block of H with the rows of z_m and the columns of z_n, m >= n.
double* block_of(ChainSystem& system, int interval, std::size_t m, std::size_t n,
                 std::size_t dof) noexcept {
  double* panel = n >= 2   ? system.own_block(interval + 1)
                  : m >= 2 ? system.coupling(interval)
                           : system.own_block(interval);
  return panel + (n % 2) * dof * system.stride() + (m % 2) * dof;
}

double* rhs_of(ChainSystem& system, int interval, std::size_t m, std::size_t dof) noexcept {
  return system.rhs(interval + static_cast<int>(m / 2)) + (m % 2) * dof;
}

/// A state whose costs depend on its velocity too: all four combinations, entry by entry.
void add_full_state(const StateNormals& normals, std::size_t state,
                    const GpPrior::Interpolation& at, ChainSystem& system, int interval) {
  const auto dof = static_cast<std::size_t>(normals.dof());
  const std::size_t stride = normals.full_stride();
  const StateNormals::Block block = normals.full(state);
  const auto by_q = chain(at, 0), by_qdot = chain(at, 1);
  for (std::size_t m = 0; m < 4; ++m) {
    double* rhs = rhs_of(system, interval, m, dof);
    for (std::size_t j = 0; j < dof; ++j) {
      rhs[j] -= by_q[m] * block.gradient[j] + by_qdot[m] * block.gradient[dof + j];
    }
    for (std::size_t n = 0; n <= m; ++n) {
      double* to = block_of(system, interval, m, n, dof);
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

std::size_t interval_sums_size(std::size_t dof) noexcept { return kPairs * dof * padded(dof); }

void add_support_state(const StateNormals& normals, std::size_t state, ChainSystem& system,
                       int support) {
  const auto dof = static_cast<std::size_t>(normals.dof());
  const auto add = [&](const StateNormals::Block& block, std::size_t width) {
    add_columns(system.own_block(support), system.stride(), block.hessian, width, width);
    subtract_padded(system.rhs(support), 1.0, block.gradient, width);
  };
  if (normals.has_position(state)) add(normals.position(state), dof);
  if (normals.has_full(state)) add(normals.full(state), 2 * dof);
}

void add_interval(const StateNormals& normals, std::size_t first,
                  std::span<const GpPrior::Interpolation> checks, ChainSystem& system, int interval,
                  AlignedArray& sums) {
  const auto dof = static_cast<std::size_t>(normals.dof());
  const std::size_t block_size = dof * normals.position_stride();
  bool any = false;
  for (std::size_t k = 0; k < checks.size(); ++k) {
    const std::size_t state = first + k;
    if (normals.has_full(state)) add_full_state(normals, state, checks[k], system, interval);
    if (!normals.has_position(state)) continue;
    if (!any) std::fill_n(sums.data(), kPairs * block_size, 0.0);
    any = true;
    const StateNormals::Block block = normals.position(state);
    const auto c = chain(checks[k], 0);
    double products[kPairs];
    std::size_t pair = 0;
    for (std::size_t m = 0; m < 4; ++m) {
      for (std::size_t n = 0; n <= m; ++n) products[pair++] = c[m] * c[n];
      subtract_padded(rhs_of(system, interval, m, dof), c[m], block.gradient, dof);
    }
    add_products(sums.data(), products, block.hessian, block_size);
  }
  if (!any) return;
  std::size_t pair = 0;
  for (std::size_t m = 0; m < 4; ++m) {
    for (std::size_t n = 0; n <= m; ++n) {
      add_columns(block_of(system, interval, m, n, dof), system.stride(),
                  sums.data() + block_size * pair++, dof, dof);
    }
  }
}

}  // namespace sidestep
