#include "panel_kernels.hpp"

#include <algorithm>

#include <sidestep/core/lanes.hpp>

namespace sidestep {

// Stores of lanes may alias anything, so that what the loops need of a panel is copied first.

namespace {

/// The elimination of one pivot after the other (L D L^T, right-looking), each with lambda added,
/// for panels of `kRows` lanes; of any number if that is 0.
template <std::size_t kRows>
SIDESTEP_INLINE bool eliminate(const ChainPanel& panel, double lambda) {
  const std::size_t width = panel.width, own = panel.own;
  const std::size_t row_lanes = kRows != 0 ? kRows : (own + panel.next) / kLanes;
  const std::size_t stride = row_lanes * kLanes;
  double* const columns = panel.columns;
  double* const rows = panel.rows;
  double* const inverse_pivots = panel.inverse_pivots;
  for (std::size_t k = 0; k < width; ++k) {
    const double* pivot_column = columns + k * stride;
    const double pivot = pivot_column[k] + lambda;
    if (!(pivot > 0.0) || !(pivot < 1e300)) return false;
    const double inverse = 1.0 / pivot;
    inverse_pivots[k] = inverse;
    for (std::size_t j = k + 1; j < width; ++j) {
      double* column = columns + j * stride;
      const double factor = pivot_column[j] * inverse;
      rows[j * own + k] = factor;
#pragma GCC unroll 8
      for (std::size_t r = 0; r < row_lanes; ++r) {
        lanes(column + r * kLanes) -= factor * lanes(pivot_column + r * kLanes);
      }
    }
  }
  return true;
}

}  // namespace

SIDESTEP_SIMD_CLONES
void load_panel(const ChainPanel& panel, const double* source, const ChainPanel* previous,
                double* scaled) {
  const std::size_t width = panel.width, own = panel.own, next = panel.next, stride = own + next;
  double* const columns = panel.columns;
  std::copy_n(source, width * stride, columns);
  if (previous == nullptr) return;
  const double* const eliminated = previous->columns + own;
  const double* const inverse_pivots = previous->inverse_pivots;
  for (std::size_t k = 0; k < width; ++k) {
    for (std::size_t r = 0; r <= width; r += kLanes) {
      lanes(scaled + k * next + r) = inverse_pivots[k] * lanes(eliminated + k * stride + r);
    }
  }
  // Eight columns at a time, b as the last: each row of the coupling is read once for all of them.
  for (std::size_t first = 0; first <= width; first += kLanes) {
    const bool has_b = first + kLanes > width;
    // Rows above the diagonal are never read.
    for (std::size_t r = has_b ? 0 : first; r < own; r += kLanes) {
      Lanes left[kLanes];
#pragma GCC unroll 8
      for (std::size_t j = 0; j < kLanes; ++j) left[j] = Lanes{};
      for (std::size_t k = 0; k < width; ++k) {
        const Lanes values = lanes(eliminated + k * stride + r);
        const double* factors = scaled + k * next + first;
#pragma GCC unroll 8
        for (std::size_t j = 0; j < kLanes; ++j) left[j] += factors[j] * values;
      }
      for (std::size_t j = first; j < std::min(width, first + kLanes) && r >= first; ++j) {
        lanes(columns + j * stride + r) -= left[j - first];
      }
      for (std::size_t i = r; has_b && i < std::min(width, r + kLanes); ++i) {
        columns[i * stride + own + width] -= left[width - first][i - r];
      }
    }
  }
}

SIDESTEP_SIMD_CLONES
bool factorise_panel(const ChainPanel& panel, double lambda) {
  switch ((panel.own + panel.next) / kLanes) {
    case 2: return eliminate<2>(panel, lambda);
    case 3: return eliminate<3>(panel, lambda);
    case 4: return eliminate<4>(panel, lambda);
    case 5: return eliminate<5>(panel, lambda);
    default: return eliminate<0>(panel, lambda);
  }
}

SIDESTEP_SIMD_CLONES
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

}  // namespace sidestep
