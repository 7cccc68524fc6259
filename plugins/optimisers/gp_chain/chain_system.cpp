#include "chain_system.hpp"

#include <algorithm>
#include <cmath>
#include <utility>

#include "panel_kernels.hpp"

namespace sidestep {

void ChainSystem::resize(int states, int width) {
  states_ = static_cast<std::size_t>(states);
  width_ = static_cast<std::size_t>(width);
  eliminated_ = 0;
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

void ChainSystem::clear(int changed) noexcept {
  eliminated_ = std::min(eliminated_, static_cast<std::size_t>(changed));
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

ChainPanel ChainSystem::panel_of(std::size_t state) noexcept {
  return {factor_.data() + state * panel_size(),
          rows_.data() + state * width_ * own_,
          inverse_pivots_.data() + state * own_,
          width_,
          own_,
          next_};
}

bool ChainSystem::solve(double lambda, std::span<double> x) noexcept {
  if (lambda != lambda_) eliminated_ = 0;
  lambda_ = lambda;
  for (std::size_t& i = eliminated_; i < states_; ++i) {
    const ChainPanel panel = panel_of(i);
    const ChainPanel previous = panel_of(i == 0 ? 0 : i - 1);
    load_panel(panel, own_block(static_cast<int>(i)), i == 0 ? nullptr : &previous, scaled_.data());
    if (!factorise_panel(panel, lambda)) return false;
  }
  substitute_back(x);
  return true;
}

void ChainSystem::substitute_back(std::span<double> x) noexcept {
  double* next = solved_.data();
  double* here = next + own_;
  std::fill_n(next, 2 * own_, 0.0);
  for (std::size_t i = states_; i-- > 0;) {
    substitute_panel(panel_of(i), next, here);
    std::copy_n(here, width_, x.begin() + static_cast<std::ptrdiff_t>(i * width_));
    std::swap(here, next);
  }
}

double ChainSystem::predicted_decrease(double lambda, std::span<const double> x) const noexcept {
  double sum = 0.0;
  const double* value = x.data();
  for (int i = 0; i < states(); ++i) {
    const double* b = rhs(i);
    for (int j = 0; j < width(); ++j, ++value) sum += *value * (b[j] + lambda * *value);
  }
  return 0.5 * sum;
}

void ChainSystem::spread(std::span<double> x) noexcept {
  // L^T sample = D^-1/2 x: what substitute_panel() takes for y is D^1/2 x.
  eliminated_ = 0;
  for (std::size_t i = 0; i < states_; ++i) {
    const ChainPanel panel = panel_of(i);
    for (std::size_t k = 0; k < width_; ++k) {
      panel.columns[k * stride() + own_ + width_] =
          x[i * width_ + k] / std::sqrt(panel.inverse_pivots[k]);
    }
  }
  substitute_back(x);
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
