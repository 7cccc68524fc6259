#ifndef SIDESTEP_KERNELS
#include "panel_kernels.hpp"

#define SIDESTEP_KERNELS "panel_kernels.cpp"
#include <sidestep/core/each_target.hpp>

namespace sidestep {

void load_panel(const ChainPanel& panel, const double* source, const ChainPanel* previous,
                double* scaled) {
  SIDESTEP_BEST(load_panel)(panel, source, previous, scaled);
}

bool factorise_panel(const ChainPanel& panel, double lambda) {
  return SIDESTEP_BEST(factorise_panel)(panel, lambda);
}

void substitute_panel(const ChainPanel& panel, const double* next, double* x) {
  SIDESTEP_BEST(substitute_panel)(panel, next, x);
}

double dot(const double* a, const double* b, std::size_t count) noexcept {
  return SIDESTEP_BEST(dot)(a, b, count);
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

}  // namespace

#endif
