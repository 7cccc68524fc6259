#include "chain_system.hpp"

#include <algorithm>
#include <cmath>

namespace sidestep {
namespace {

/// What surrounds the factor of one panel; see ChainSystem.
struct Panel {
  double* values;
  std::size_t width;
  std::size_t half;
  [[nodiscard]] double* column(std::size_t k) const noexcept { return values + k * 2 * half; }
};

inline Lanes& lanes(double* at) noexcept { return *reinterpret_cast<Lanes*>(at); }
inline const Lanes& lanes(const double* at) noexcept { return *reinterpret_cast<const Lanes*>(at); }

/// panel = source + lambda I - (what eliminating the previous panel leaves to this one).
SIDESTEP_SIMD_CLONES
void load_panel(const Panel& panel, const double* source, double lambda, const Panel* previous) {
  const std::size_t stride = 2 * panel.half;
  for (std::size_t j = 0; j < panel.width; ++j) {
    double* column = panel.column(j);
    const double* from = source + j * stride;
    for (std::size_t r = 0; r < stride; r += kLanes) {
      Lanes value = lanes(from + r);
      // Rows above the diagonal are never read; b's second copy is row width of the second half.
      if (previous != nullptr && r < panel.half && r + kLanes > j) {
        for (std::size_t k = 0; k < panel.width; ++k) {
          const double* eliminated = previous->column(k) + panel.half;
          value -= lanes(eliminated + r) * eliminated[j];
        }
      }
      lanes(column + r) = value;
    }
    column[j] += lambda;
    column[panel.half + panel.width] = column[panel.width];
  }
}

/// Replaces a panel by its Cholesky factor, right-looking, one column after the other.
SIDESTEP_SIMD_CLONES
bool factorise_panel(const Panel& panel, double* inverse_pivots) {
  const std::size_t stride = 2 * panel.half;
  for (std::size_t k = 0; k < panel.width; ++k) {
    double* pivot_column = panel.column(k);
    const double pivot = pivot_column[k];
    if (!(pivot > 0.0) || !(pivot < 1e300)) return false;
    const double inverse = 1.0 / std::sqrt(pivot);
    inverse_pivots[k] = inverse;
    for (std::size_t r = k / kLanes * kLanes; r < stride; r += kLanes) {
      lanes(pivot_column + r) *= inverse;
    }
    for (std::size_t j = k + 1; j < panel.width; ++j) {
      double* column = panel.column(j);
      const double factor = pivot_column[j];
      for (std::size_t r = j / kLanes * kLanes; r < stride; r += kLanes) {
        lanes(column + r) -= factor * lanes(pivot_column + r);
      }
    }
  }
  return true;
}

/// x of L^T x = y - W^T next, where y is the panel's row of b and W its coupling. Both x and next
/// are zero beyond the width; x is zero on entry.
SIDESTEP_SIMD_CLONES
void substitute_panel(const Panel& panel, const double* inverse_pivots, const double* next,
                      double* x) {
  for (std::size_t k = panel.width; k-- > 0;) {
    const double* column = panel.column(k);
    Lanes sum = {};
    for (std::size_t r = 0; r < panel.half; r += kLanes) {
      sum += lanes(column + panel.half + r) * lanes(next + r);
      if (r + kLanes > k) sum += lanes(column + r) * lanes(x + r);
    }
    double dot = 0.0;
    for (std::size_t lane = 0; lane < kLanes; ++lane) dot += sum[lane];
    x[k] = (column[panel.width] - dot) * inverse_pivots[k];
  }
}

}  // namespace

void ChainSystem::resize(int states, int width) {
  states_ = static_cast<std::size_t>(states);
  width_ = static_cast<std::size_t>(width);
  half_ = padded(width_ + 1);
  // Blocks are written in whole lanes, of which the last may reach beyond the last panel.
  panels_.assign_zeros(states_ * panel_size() + kLanes);
  factor_.assign_zeros(states_ * panel_size() + kLanes);
  rhs_.assign_zeros(states_ * half_ + kLanes);
  inverse_pivots_.assign_zeros(states_ * half_);
  solved_.assign_zeros(2 * half_);
}

void ChainSystem::clear() noexcept {
  std::fill_n(panels_.data(), panels_.size(), 0.0);
  std::fill_n(rhs_.data(), rhs_.size(), 0.0);
}

double* ChainSystem::own_block(int state) noexcept {
  return panels_.data() + static_cast<std::size_t>(state) * panel_size();
}

const double* ChainSystem::own_block(int state) const noexcept {
  return panels_.data() + static_cast<std::size_t>(state) * panel_size();
}

double* ChainSystem::rhs(int state) noexcept {
  return rhs_.data() + static_cast<std::size_t>(state) * half_;
}

const double* ChainSystem::rhs(int state) const noexcept {
  return rhs_.data() + static_cast<std::size_t>(state) * half_;
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
    for (std::size_t j = 0; j < width_; ++j) own_block(i)[j * stride() + width_] = rhs(i)[j];
  }
}

bool ChainSystem::solve(double lambda, std::span<double> x) noexcept {
  if (!factorise(lambda)) return false;
  substitute_back(x);
  return true;
}

bool ChainSystem::factorise(double lambda) noexcept {
  Panel previous{};
  for (std::size_t i = 0; i < states_; ++i) {
    const Panel panel{factor_.data() + i * panel_size(), width_, half_};
    load_panel(panel, own_block(static_cast<int>(i)), lambda, i == 0 ? nullptr : &previous);
    if (!factorise_panel(panel, inverse_pivots_.data() + i * half_)) return false;
    previous = panel;
  }
  return true;
}

void ChainSystem::substitute_back(std::span<double> x) noexcept {
  double* next = solved_.data();
  double* here = next + half_;
  std::fill_n(next, half_, 0.0);
  for (std::size_t i = states_; i-- > 0;) {
    std::fill_n(here, half_, 0.0);
    const Panel panel{factor_.data() + i * panel_size(), width_, half_};
    substitute_panel(panel, inverse_pivots_.data() + i * half_, next, here);
    std::copy_n(here, width_, x.begin() + static_cast<std::ptrdiff_t>(i * width_));
    std::swap(here, next);
  }
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
