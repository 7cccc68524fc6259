#include "chain_system.hpp"

#include <algorithm>
#include <cmath>

#include "panel_kernels.hpp"

namespace sidestep {

void ChainSystem::resize(int states, int width) {
  states_ = static_cast<std::size_t>(states);
  width_ = static_cast<std::size_t>(width);
  eliminated_ = 0;
  begin_ = 0;
  end_ = states_;
  own_ = padded(width_);
  next_ = padded(width_ + 1);
  // Blocks are written in whole lanes, of which the last may reach beyond the last panel.
  panels_.assign_zeros(states_ * panel_size() + kLanes);
  kept_.assign_zeros(panels_.size());
  kept_as_.assign(states_, 0);
  factor_.assign_zeros(states_ * panel_size() + kLanes);
  rows_.assign_zeros(states_ * width_ * own_);
  rhs_.assign_zeros(states_ * next_ + kLanes);
  inverse_pivots_.assign_zeros(states_ * own_);
  scaled_.assign_zeros((width_ + 1) * next_);
  solved_.assign_zeros((states_ + 1) * solved_stride());
  joint_panels_.assign_zeros(states_ * JointPanel::kRows * joint_row());
  joint_factors_.assign_zeros(states_ * JointFactor::kRows * joint_row());
  remainders_.assign_zeros(states_ * JointRemainder::kRows * joint_row());
  traits_.assign(states_, Traits{});
  masks_.resize(panel_size());
  mark_couplings(stride(), own_, dof(), masks_.data());
}

void ChainSystem::clear(int changed) noexcept {
  const auto first = static_cast<std::size_t>(changed);
  if (first < states_ && end_ < states_) eliminated_ = std::min(eliminated_, end_ - 1);
  eliminated_ = std::min(eliminated_, first);
  for (std::size_t i = 0; i < states_; ++i) {
    if (!traits_[i].is_written) continue;
    std::copy_n(kept_.data() + kept_as_[i] * panel_size(), panel_size(), panel(i));
    traits_[i] = {};
  }
  std::fill_n(rhs_.data(), rhs_.size(), 0.0);
}

void ChainSystem::keep() noexcept {
  std::copy_n(panels_.data(), panels_.size(), kept_.data());
  for (std::size_t i = 0; i < states_; ++i) {
    const bool is_same = i > 0 && std::equal(panel(i), panel(i) + panel_size(), panel(i - 1));
    kept_as_[i] = is_same ? kept_as_[i - 1] : i;
    traits_[i].is_written = false;
  }
}

double* ChainSystem::own_block(int state) noexcept {
  const auto i = static_cast<std::size_t>(state);
  traits_[i] = {.is_written = true};
  return panel(i);
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
  double* const own = own_block(state);
  std::fill_n(own, panel_size(), 0.0);
  std::fill_n(rhs(state), width_, 0.0);
  for (std::size_t j = 0; j < width_; ++j) own[j * stride() + j] = 1.0;
  if (state == 0) return;
  double* const before = coupling(state - 1);
  for (std::size_t j = 0; j < width_; ++j) std::fill_n(before + j * stride(), width_, 0.0);
}

void ChainSystem::seal() noexcept {
  for (std::size_t i = 0; i < states_; ++i) {
    if (!traits_[i].is_examined) examine(i);
  }
  divide();
  for (std::size_t i = begin_; i < end_; ++i) {
    const double* b = rhs_.data() + i * next_;
    for (std::size_t j = 0; j < width_; ++j) panel(i)[j * stride() + own_ + width_] = b[j];
  }
}

/// Whether a panel couples joints, and what it holds if it does not.
void ChainSystem::examine(std::size_t state) noexcept {
  Traits& traits = traits_[state];
  traits.is_examined = true;
  find_couplings(panel(state), masks_.data(), stride(), own_, dof(), traits.own_couples,
                 traits.next_couples);
  if (!traits.own_couples || !traits.next_couples) {
    read_joint_panel(panel(state), stride(), own_, dof(), joint_panel(state));
  }
}

/// Finds out which states are eliminated in which way.
void ChainSystem::divide() noexcept {
  begin_ = 0;
  while (begin_ < states_ && !traits_[begin_].own_couples && !traits_[begin_].next_couples) {
    ++begin_;
  }
  end_ = states_;
  while (end_ > begin_ + 1 && !traits_[end_ - 1].own_couples && !traits_[end_ - 2].next_couples) {
    --end_;
  }
}

double* ChainSystem::joint_panel(std::size_t state) noexcept {
  return joint_panels_.data() + state * JointPanel::kRows * joint_row();
}

double* ChainSystem::joint_factor(std::size_t state) noexcept {
  return joint_factors_.data() + state * JointFactor::kRows * joint_row();
}

double* ChainSystem::remainder(std::size_t state) noexcept {
  return remainders_.data() + state * JointRemainder::kRows * joint_row();
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
  if (eliminated_ < states_) {
    if (!eliminate_end(lambda)) return false;
    while (eliminated_ < end_) {
      if (!eliminate_next(lambda)) return false;
    }
    eliminated_ = states_;
  }
  substitute_back(x);
  return true;
}

/// The states from end_ on, the last one first.
bool ChainSystem::eliminate_end(double lambda) noexcept {
  if (end_ == states_) return true;
  eliminated_ = std::min(eliminated_, end_ - 1);
  for (std::size_t i = states_; i-- > end_;) {
    const double* taken = i + 1 < states_ ? remainder(i + 1) : nullptr;
    if (!eliminate_joints(Neighbour::kPrevious, joint_panel(i), joint_panel(i - 1),
                          rhs_.data() + i * next_, taken, lambda, dof(), joint_factor(i),
                          remainder(i))) {
      return false;
    }
  }
  return true;
}

bool ChainSystem::eliminate_next(double lambda) noexcept {
  const std::size_t i = eliminated_;
  const double* taken = i > 0 && i <= begin_ ? remainder(i - 1) : nullptr;
  if (i < begin_) {
    if (!eliminate_joints(Neighbour::kNext, joint_panel(i), joint_panel(i), rhs_.data() + i * next_,
                          taken, lambda, dof(), joint_factor(i), remainder(i))) {
      return false;
    }
  } else {
    const ChainPanel here = panel_of(i);
    const ChainPanel previous = panel_of(i == 0 ? 0 : i - 1);
    load_panel(here, panel(i), i > begin_ ? &previous : nullptr, scaled_.data());
    if (taken != nullptr) take_remainder(taken, stride(), own_, dof(), here.columns);
    if (i + 1 == end_ && end_ < states_) {
      take_remainder(remainder(end_), stride(), own_, dof(), here.columns);
    }
    if (!factorise_panel(here, lambda)) return false;
  }
  ++eliminated_;
  return true;
}

void ChainSystem::substitute_back(std::span<double> x) noexcept {
  const std::size_t step = solved_stride();
  const auto solved = [&](std::size_t state) { return solved_.data() + state * step; };
  // Nothing is left of the neighbour where it is eliminated backwards, and of what is no number.
  std::fill_n(solved_.data(), solved_.size(), 0.0);
  for (std::size_t i = end_; i-- > 0;) {
    if (i < begin_) {
      substitute_joints(Neighbour::kNext, joint_factor(i), joint_panel(i), solved(i + 1), dof(),
                        solved(i));
    } else {
      substitute_panel(panel_of(i), solved(i + 1), solved(i));
    }
  }
  for (std::size_t i = end_; i < states_; ++i) {
    substitute_joints(Neighbour::kPrevious, joint_factor(i), joint_panel(i - 1), solved(i - 1),
                      dof(), solved(i));
  }
  for (std::size_t i = 0; i < states_; ++i) {
    std::copy_n(solved(i), width_, x.data() + i * width_);
  }
}

double ChainSystem::predicted_decrease(double lambda, std::span<const double> x) const noexcept {
  double sum = lambda * dot(x.data(), x.data(), x.size());
  for (std::size_t i = 0; i < states_; ++i) {
    sum += dot(x.data() + i * width_, rhs_.data() + i * next_, width_);
  }
  return 0.5 * sum;
}

void ChainSystem::spread(std::span<double> x) noexcept {
  // L^T sample = D^-1/2 x: what substitute_panel() takes for y is D^1/2 x.
  eliminated_ = 0;
  for (std::size_t i = 0; i < states_; ++i) {
    if (i < begin_ || i >= end_) {
      put_normals(x.data() + i * width_, dof(), joint_factor(i));
      continue;
    }
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
