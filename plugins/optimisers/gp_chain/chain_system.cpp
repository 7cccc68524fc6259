#include "chain_system.hpp"

#include <algorithm>
#include <cmath>

namespace sidestep {
namespace {

/// One panel of the factor; see ChainSystem. Column k holds column k of L times its pivot; `rows`
/// holds L itself row by row, without its unit diagonal.
struct Panel {
  double* columns;
  double* rows;
  double* inverse_pivots;
  std::size_t width;
  std::size_t own;   ///< Rows of the state's own block, in whole lanes.
  std::size_t next;  ///< Rows of the coupling and b.
};

// Stores of lanes may alias anything, so that what the loops need of a panel is copied first.

/// panel = source - (what eliminating the previous panel leaves to this one).
/// `scaled`: room for a panel's coupling.
SIDESTEP_SIMD_CLONES
void load_panel(const Panel& panel, const double* source, const Panel* previous, double* scaled) {
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

/// The elimination of one pivot after the other (L D L^T, right-looking), each with lambda added,
/// for panels of `kRows` lanes; of any number if that is 0.
template <std::size_t kRows>
[[gnu::always_inline]] inline bool eliminate(const Panel& panel, double lambda) {
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

/// Replaces a panel by its factor; false where it is not positive definite.
SIDESTEP_SIMD_CLONES
bool factorise_panel(const Panel& panel, double lambda) {
  switch ((panel.own + panel.next) / kLanes) {
    case 2: return eliminate<2>(panel, lambda);
    case 3: return eliminate<3>(panel, lambda);
    case 4: return eliminate<4>(panel, lambda);
    case 5: return eliminate<5>(panel, lambda);
    default: return eliminate<0>(panel, lambda);
  }
}

/// x of L^T x = D^-1 (y - W^T next), where y is the panel's row of b and W its coupling. Both x and
/// next have room for, and are zero in, whole lanes beyond the width.
SIDESTEP_SIMD_CLONES
void substitute_panel(const Panel& panel, const double* next, double* x) {
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

}  // namespace

void ChainSystem::resize(int states, int width) {
  states_ = static_cast<std::size_t>(states);
  width_ = static_cast<std::size_t>(width);
  own_ = padded(width_);
  next_ = padded(width_ + 1);
  // Blocks are written in whole lanes, of which the last may reach beyond the last panel.
  panels_.assign_zeros(states_ * panel_size() + kLanes);
  kept_.assign_zeros(panels_.size());
  factor_.assign_zeros(states_ * panel_size() + kLanes);
  rows_.assign_zeros(states_ * width_ * own_);
  rhs_.assign_zeros(states_ * next_ + kLanes);
  inverse_pivots_.assign_zeros(states_ * own_);
  scaled_.assign_zeros(width_ * next_);
  solved_.assign_zeros(2 * own_);
}

void ChainSystem::clear() noexcept {
  std::copy_n(kept_.data(), kept_.size(), panels_.data());
  std::fill_n(rhs_.data(), rhs_.size(), 0.0);
}

void ChainSystem::keep() noexcept { std::copy_n(panels_.data(), panels_.size(), kept_.data()); }

double* ChainSystem::own_block(int state) noexcept {
  return panels_.data() + static_cast<std::size_t>(state) * panel_size();
}

const double* ChainSystem::own_block(int state) const noexcept {
  return panels_.data() + static_cast<std::size_t>(state) * panel_size();
}

double* ChainSystem::rhs(int state) noexcept {
  return rhs_.data() + static_cast<std::size_t>(state) * next_;
}

const double* ChainSystem::rhs(int state) const noexcept {
  return rhs_.data() + static_cast<std::size_t>(state) * next_;
}

void ChainSystem::hold(int state) noexcept {
  std::fill_n(own_block(state), panel_size(), 0.0);
  std::fill_n(rhs(state), width_, 0.0);
  for (std::size_t j = 0; j < width_; ++j) {
    own_block(state)[j * stride() + j] = 1.0;
    if (state > 0) std::fill_n(coupling(state - 1) + j * stride(), width_, 0.0);
  }
}

void ChainSystem::seal() noexcept {
  for (int i = 0; i < states(); ++i) {
    for (std::size_t j = 0; j < width_; ++j) own_block(i)[j * stride() + own_ + width_] = rhs(i)[j];
  }
}

bool ChainSystem::solve(double lambda, std::span<double> x) noexcept {
  const auto panel_of = [this](std::size_t i) {
    return Panel{factor_.data() + i * panel_size(),
                 rows_.data() + i * width_ * own_,
                 inverse_pivots_.data() + i * own_,
                 width_,
                 own_,
                 next_};
  };
  Panel previous{};
  for (std::size_t i = 0; i < states_; ++i) {
    const Panel panel = panel_of(i);
    load_panel(panel, own_block(static_cast<int>(i)), i == 0 ? nullptr : &previous, scaled_.data());
    if (!factorise_panel(panel, lambda)) return false;
    previous = panel;
  }
  double* next = solved_.data();
  double* here = next + own_;
  std::fill_n(next, 2 * own_, 0.0);
  for (std::size_t i = states_; i-- > 0;) {
    substitute_panel(panel_of(i), next, here);
    std::copy_n(here, width_, x.begin() + static_cast<std::ptrdiff_t>(i * width_));
    std::swap(here, next);
  }
  return true;
}

void ChainSystem::product(std::span<const double> x, std::span<double> out) const noexcept {
  std::ranges::fill(out, 0.0);
  for (std::size_t i = 0; i < states_; ++i) {
    const double* own = own_block(static_cast<int>(i));
    const double* to_next = coupling(static_cast<int>(i));
    const double* x_here = x.data() + i * width_;
    double* out_here = out.data() + i * width_;
    const bool last = i + 1 == states_;
    for (std::size_t j = 0; j < width_; ++j) {
      for (std::size_t r = j; r < width_; ++r) {
        const double value = own[j * stride() + r];
        out_here[r] += value * x_here[j];
        if (r != j) out_here[j] += value * x_here[r];
      }
      for (std::size_t r = 0; r < width_ && !last; ++r) {
        const double value = to_next[j * stride() + r];
        out_here[width_ + r] += value * x_here[j];
        out_here[j] += value * x_here[width_ + r];
      }
    }
  }
}

}  // namespace sidestep
