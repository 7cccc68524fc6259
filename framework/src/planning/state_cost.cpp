#ifndef SIDESTEP_KERNELS
#include <sidestep/planning/state_cost.hpp>

#include <cstdint>
#include <span>

#include <sidestep/planning/state_normals.hpp>

#define SIDESTEP_KERNELS "state_cost.cpp"
#include <sidestep/core/each_target.hpp>

namespace sidestep {

namespace {

bool all_zero(std::span<const double> values) {
  return SIDESTEP_BEST(all_zero)(values.data(), values.size());
}

}  // namespace

double StateCost::linearise(const StateBatch& states, const StateRange& range, StateNormals& out,
                            Scratch& scratch) const {
  Scratch::Scope scope(scratch);
  const auto per_state = static_cast<std::size_t>(residual_count());
  const auto d = static_cast<std::size_t>(states.dof);
  const std::size_t rows = per_state * static_cast<std::size_t>(states.count);
  const bool velocity = depends_on_velocity();
  const auto residuals = scope.doubles(rows);
  const auto by_q = scope.doubles(rows * d);
  const auto by_qdot = scope.doubles(velocity ? rows * d : 0);
  evaluate(states, {residuals, by_q, by_qdot}, scratch);

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
