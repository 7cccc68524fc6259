#ifndef SIDESTEP_KERNELS
#include <sidestep/planning/state_normals.hpp>

#include <algorithm>
#include <cstdint>
#include <span>

#include <sidestep/planning/state_cost.hpp>

#define SIDESTEP_KERNELS "state_normals.cpp"
#include <sidestep/core/each_target.hpp>
#include <sidestep/core/index.hpp>

namespace sidestep {

void StateNormals::Blocks::resize(std::size_t states, std::size_t block_width) {
  if (active.size() == states && width == block_width) {
    std::ranges::fill(active, 0);
    return;
  }
  width = block_width;
  hessians.assign_zeros(states * width * padded(width));
  gradients.assign_zeros(states * padded(width));
  active.assign(states, 0);
}

void StateNormals::Blocks::open(std::size_t state) noexcept {
  if (active[state] != 0) return;
  const std::size_t stride = padded(width);
  std::fill_n(hessians.data() + state * width * stride, width * stride, 0.0);
  std::fill_n(gradients.data() + state * stride, stride, 0.0);
  active[state] = 1;
}

void StateNormals::Blocks::add(std::size_t state, const double* row, double residual) {
  open(state);
  const std::size_t stride = padded(width);
  SIDESTEP_DISPATCH(add_outer)
  (hessians.data() + state * width * stride, gradients.data() + state * stride, row, residual,
   width);
}

void StateNormals::resize(int states, int dof) {
  dof_ = idx(dof);
  position_.resize(idx(states), dof_);
  full_.resize(idx(states), 2 * dof_);
  row_.assign_zeros(padded(2 * dof_));
}

void StateNormals::clear() noexcept {
  std::ranges::fill(position_.active, 0);
  std::ranges::fill(full_.active, 0);
}

void StateNormals::clear(std::size_t state) noexcept {
  position_.active[state] = 0;
  full_.active[state] = 0;
}

void StateNormals::add_rows(std::size_t state, std::span<const double> by_q,
                            std::span<const double> residuals) {
  if (residuals.empty()) return;
  if (dof_ > kLanes) {
    std::fill_n(row_.data(), row_.size(), 0.0);
    for (std::size_t i = 0; i < residuals.size(); ++i) {
      std::copy_n(by_q.data() + i * dof_, dof_, row_.data());
      position_.add(state, row_.data(), residuals[i]);
    }
    return;
  }
  SIDESTEP_DISPATCH(add_narrow_products)
  (position_.hessians.data() + state * dof_ * kLanes, position_.gradients.data() + state * kLanes,
   by_q.data(), residuals.data(), residuals.size(), dof_, position_.active[state] != 0);
  position_.active[state] = 1;
}

void StateNormals::add_row(std::size_t state, std::span<const double> by_q,
                           std::span<const double> by_qdot, double residual) {
  std::fill_n(row_.data(), row_.size(), 0.0);
  std::ranges::copy(by_q, row_.data());
  std::ranges::copy(by_qdot, row_.data() + dof_);
  full_.add(state, row_.data(), residual);
}

void StateNormals::Blocks::add_entry(std::size_t state, std::size_t variable, double entry,
                                     double residual) {
  open(state);
  const std::size_t stride = padded(width);
  hessians.data()[(state * width + variable) * stride + variable] += entry * entry;
  gradients.data()[state * stride + variable] += entry * residual;
}

void StateNormals::add_position_entry(std::size_t state, std::size_t joint, double entry,
                                      double residual) {
  position_.add_entry(state, joint, entry, residual);
}

void StateNormals::add_velocity_entry(std::size_t state, std::size_t joint, double entry,
                                      double residual) {
  full_.add_entry(state, dof_ + joint, entry, residual);
}

double StateCost::linearise(const StateBatch& states, const StateRange& range, StateNormals& out,
                            Scratch& scratch) const {
  Scratch::Scope scope(scratch);
  const auto per_state = idx(residual_count());
  const auto d = idx(states.dof);
  const std::size_t rows = per_state * idx(states.count);
  const bool velocity = depends_on_velocity();
  const auto residuals = scope.doubles(rows);
  const auto by_q = scope.doubles(rows * d);
  const auto by_qdot = scope.doubles(velocity ? rows * d : 0);
  evaluate(states, {residuals, by_q, by_qdot}, scratch);

  const auto all_zero = [](std::span<const double> values) {
    return SIDESTEP_DISPATCH(all_zero)(values.data(), values.size());
  };
  double sum = 0.0;
  for (std::size_t row = 0; row < rows; ++row) {
    const auto row_q = by_q.subspan(row * d, d);
    const auto row_qdot = by_qdot.empty() ? by_qdot : by_qdot.subspan(row * d, d);
    if (residuals[row] == 0.0 && all_zero(row_q) && all_zero(row_qdot)) continue;
    sum += residuals[row] * residuals[row];
    const std::size_t state = range[row / per_state];
    if (velocity) {
      out.add_row(state, row_q, row_qdot, residuals[row]);
    } else {
      out.add_rows(state, row_q, residuals.subspan(row, 1));
    }
  }
  return 0.5 * sum;
}

}  // namespace sidestep

#else

namespace {

/// hessian += row row^T and gradient += residual row, all padded to whole lanes.
void add_outer(double* hessian, double* gradient, const double* row, double residual,
               std::size_t width) {
  const std::size_t stride = padded(width);
  for (std::size_t r = 0; r < stride; r += kLanes) {
    const Lanes values = lanes(row + r);
    lanes(gradient + r) += residual * values;
    for (std::size_t j = 0; j < width; ++j) {
      lanes(hessian + j * stride + r) += row[j] * values;
    }
  }
}

/// The same for many rows of `kWidth` entries, at most kLanes, one after the other; what is there
/// before counts only if `is_open`.
template <std::size_t kWidth>
SIDESTEP_INLINE void add_products_of(double* hessian, double* gradient, const double* rows,
                                     const double* residuals, std::size_t count, bool is_open) {
  Mask<double, kParts> lane;
  count_lanes(lane);
  const Mask<double, kParts> is_in_row = lane < static_cast<std::int64_t>(kWidth);
  Lanes sums[kWidth];
#pragma GCC unroll 8
  for (std::size_t j = 0; j < kWidth; ++j) {
    sums[j] = is_open ? lanes(hessian + j * kLanes) : Lanes{};
  }
  Lanes pull = is_open ? lanes(gradient) : Lanes{};
  alignas(64) double last_row[kLanes] = {};
  for (std::size_t i = 0; i < count; ++i) {
    // Read in whole lanes, of which those beyond the row count as zero, where there is so much.
    const double* row = rows + i * kWidth;
    if ((count - i) * kWidth < kLanes) {
      for (std::size_t j = 0; j < kWidth; ++j) last_row[j] = row[j];
      row = last_row;
    }
    const Lanes values = choose(is_in_row, lanes(row), 0.0);
    pull += residuals[i] * values;
#pragma GCC unroll 8
    for (std::size_t j = 0; j < kWidth; ++j) sums[j] += row[j] * values;
  }
  lanes(gradient) = pull;
#pragma GCC unroll 8
  for (std::size_t j = 0; j < kWidth; ++j) lanes(hessian + j * kLanes) = sums[j];
}

/// The same for any width: with one that is known the sums stay in registers.
void add_narrow_products(double* hessian, double* gradient, const double* rows,
                         const double* residuals, std::size_t count, std::size_t width,
                         bool is_open) {
  switch (width) {
    case 1: return add_products_of<1>(hessian, gradient, rows, residuals, count, is_open);
    case 2: return add_products_of<2>(hessian, gradient, rows, residuals, count, is_open);
    case 3: return add_products_of<3>(hessian, gradient, rows, residuals, count, is_open);
    case 4: return add_products_of<4>(hessian, gradient, rows, residuals, count, is_open);
    case 5: return add_products_of<5>(hessian, gradient, rows, residuals, count, is_open);
    case 6: return add_products_of<6>(hessian, gradient, rows, residuals, count, is_open);
    case 7: return add_products_of<7>(hessian, gradient, rows, residuals, count, is_open);
    default: return add_products_of<8>(hessian, gradient, rows, residuals, count, is_open);
  }
}

/// Whether all values are zero, eight at a time: most rows of most costs are.
bool all_zero(const double* values, std::size_t count) {
  Mask<double, kParts> any = {};
  std::size_t i = 0;
  for (; i + kLanes <= count; i += kLanes) {
    any |= lanes(values + i) != 0.0;
  }
  std::int64_t sum = 0;
  for (std::size_t lane = 0; lane < kLanes; ++lane) sum |= any[lane];
  for (; i < count; ++i) sum |= values[i] != 0.0;
  return sum == 0;
}

}  // namespace

#endif
