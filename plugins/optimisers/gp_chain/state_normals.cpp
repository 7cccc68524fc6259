#include "state_normals.hpp"

#include <algorithm>
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

bool all_zero(std::span<const double> values) noexcept {
  return std::ranges::all_of(values, [](double value) { return value == 0.0; });
}

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
  for (std::size_t row = 0; row < rows; ++row) {
    const auto row_q = by_q.subspan(row * d, d);
    const auto row_qdot = velocity ? by_qdot.subspan(row * d, d) : by_qdot;
    if (residuals[row] == 0.0 && all_zero(row_q) && all_zero(row_qdot)) continue;
    sum += residuals[row] * residuals[row];
    out.add_row(first + row / per_state * step, row_q.data(), velocity ? row_qdot.data() : nullptr,
                residuals[row]);
  }
  return 0.5 * sum;
}

}  // namespace sidestep
