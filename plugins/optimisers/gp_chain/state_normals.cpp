#include "state_normals.hpp"

#include <algorithm>
#include <cstdint>
#include <span>

namespace sidestep {
namespace {

/// hessian += row row^T and gradient += residual row, all padded to whole lanes.
SIDESTEP_SIMD_CLONES
void add_outer(double* hessian, double* gradient, const double* row, double residual,
               std::size_t width) {
  const std::size_t stride = padded(width);
  for (std::size_t r = 0; r < stride; r += kLanes) {
    const Lanes values = *reinterpret_cast<const Lanes*>(row + r);
    *reinterpret_cast<Lanes*>(gradient + r) += residual * values;
    for (std::size_t j = 0; j < width; ++j) {
      *reinterpret_cast<Lanes*>(hessian + j * stride + r) += row[j] * values;
    }
  }
}

/// Whether all values are zero, eight at a time: most rows of most costs are.
SIDESTEP_SIMD_CLONES
bool all_zero(const double* values, std::size_t count) {
  using Bits = std::int64_t __attribute__((vector_size(8 * kLanes), aligned(8), may_alias));
  Bits any = {};
  std::size_t i = 0;
  for (; i + kLanes <= count; i += kLanes) {
    any |= *reinterpret_cast<const Lanes*>(values + i) != 0.0;
  }
  std::int64_t sum = 0;
  for (std::size_t lane = 0; lane < kLanes; ++lane) sum |= any[lane];
  for (; i < count; ++i) sum |= values[i] != 0.0;
  return sum == 0;
}

bool all_zero(std::span<const double> values) { return all_zero(values.data(), values.size()); }

}  // namespace

void StateNormals::Blocks::resize(std::size_t states, std::size_t block_width) {
  width = block_width;
  hessians.assign_zeros(states * width * padded(width));
  gradients.assign_zeros(states * padded(width));
  active.assign(states, 0);
}

void StateNormals::Blocks::clear() noexcept {
  const std::size_t stride = padded(width);
  for (std::size_t s = 0; s < active.size(); ++s) {
    if (active[s] == 0) continue;
    std::fill_n(hessians.data() + s * width * stride, width * stride, 0.0);
    std::fill_n(gradients.data() + s * stride, stride, 0.0);
    active[s] = 0;
  }
}

void StateNormals::Blocks::add(std::size_t state, const double* row, double residual) {
  const std::size_t stride = padded(width);
  add_outer(hessians.data() + state * width * stride, gradients.data() + state * stride, row,
            residual, width);
  active[state] = 1;
}

void StateNormals::resize(int states, int dof) {
  dof_ = static_cast<std::size_t>(dof);
  position_.resize(static_cast<std::size_t>(states), dof_);
  full_.resize(static_cast<std::size_t>(states), 2 * dof_);
  row_.assign_zeros(padded(2 * dof_));
}

void StateNormals::clear() noexcept {
  position_.clear();
  full_.clear();
}

void StateNormals::add_row(std::size_t state, const double* by_q, const double* by_qdot,
                           double residual) {
  std::fill_n(row_.data(), row_.size(), 0.0);
  std::copy_n(by_q, dof_, row_.data());
  if (by_qdot == nullptr) {
    position_.add(state, row_.data(), residual);
  } else {
    std::copy_n(by_qdot, dof_, row_.data() + dof_);
    full_.add(state, row_.data(), residual);
  }
}

double add_cost(const StateCost& cost, const StateBatch& states, std::size_t first,
                std::size_t step, StateNormals& out, Scratch& scratch) {
  Scratch::Scope scope(scratch);
  const auto per_state = static_cast<std::size_t>(cost.residual_count());
  const auto d = static_cast<std::size_t>(states.dof);
  const std::size_t rows = per_state * static_cast<std::size_t>(states.count);
  const bool velocity = cost.depends_on_velocity();
  const auto residuals = scope.doubles(rows);
  const auto by_q = scope.doubles(rows * d);
  const auto by_qdot = scope.doubles(velocity ? rows * d : 0);
  cost.evaluate(states, {residuals, by_q, by_qdot}, scratch);

  double sum = 0.0;
  for (std::size_t state = 0; state < static_cast<std::size_t>(states.count); ++state) {
    const std::size_t begin = state * per_state;
    const auto state_qdot =
        velocity ? by_qdot.subspan(begin * d, per_state * d) : std::span<double>();
    if (all_zero(residuals.subspan(begin, per_state)) &&
        all_zero(by_q.subspan(begin * d, per_state * d)) && all_zero(state_qdot)) {
      continue;
    }
    for (std::size_t row = begin; row < begin + per_state; ++row) {
      const auto row_q = by_q.subspan(row * d, d);
      const auto row_qdot = velocity ? by_qdot.subspan(row * d, d) : std::span<double>();
      if (residuals[row] == 0.0 && all_zero(row_q) && all_zero(row_qdot)) continue;
      sum += residuals[row] * residuals[row];
      out.add_row(first + state * step, row_q.data(), velocity ? row_qdot.data() : nullptr,
                  residuals[row]);
    }
  }
  return 0.5 * sum;
}

}  // namespace sidestep
