#include "factors.hpp"

#include <algorithm>
#include <cmath>

#include <sidestep/core/index.hpp>

namespace sidestep {
namespace {

bool all_zero(std::span<const double> values) noexcept {
  return std::ranges::all_of(values, [](double value) { return value == 0.0; });
}

}  // namespace

void reduce_to_r(double* a, std::size_t rows, std::size_t columns, std::size_t stride) noexcept {
  for (std::size_t k = 0; k < std::min(rows, columns); ++k) {
    double* v = a + k * stride;
    double squared = 0.0;
    for (std::size_t i = k; i < rows; ++i) squared += v[i] * v[i];
    if (squared == 0.0) continue;
    const double pivot = v[k] > 0.0 ? -std::sqrt(squared) : std::sqrt(squared);
    v[k] -= pivot;
    const double scale = -1.0 / (pivot * v[k]);  // 2 / (v . v)
    for (std::size_t j = k + 1; j < columns; ++j) {
      double* column = a + j * stride;
      double dot = 0.0;
      for (std::size_t i = k; i < rows; ++i) dot += v[i] * column[i];
      for (std::size_t i = k; i < rows; ++i) column[i] -= scale * dot * v[i];
    }
    v[k] = pivot;
  }
}

StateBatch StateRows::States::batch(int first, int count, int dof) const noexcept {
  const std::size_t at = idx(first) * idx(dof);
  const std::size_t size = idx(count) * idx(dof);
  return {count, dof, std::span(q).subspan(at, size), std::span(qdot).subspan(at, size),
          std::span(times_s).subspan(idx(first), idx(count))};
}

StateRows::StateRows(const Problem& problem, const GpPrior& prior)
    : dof_(prior.dof()),
      checks_(problem.interpolated_checks),
      intervals_(problem.support_states - 1),
      dt_s_(problem.dt_s) {
  for (int k = 1; k <= checks_; ++k) {
    interpolations_.push_back(prior.interpolation(k / (checks_ + 1.0)));
  }
  const auto resize = [&](States& states, int count) {
    states.q.resize(idx(count) * idx(dof_));
    states.qdot = states.q;
    states.times_s.resize(idx(count));
  };
  const int states = intervals_ * (checks_ + 1) + 1;
  resize(support_, intervals_ + 1);
  resize(all_, states);
  for (int i = 0; i <= intervals_; ++i) support_.times_s[idx(i)] = i * dt_s_;
  for (int i = 0; i < states; ++i) all_.times_s[idx(i)] = i * dt_s_ / (checks_ + 1);

  std::size_t most_residuals = 0;
  for (const CostTerm& term : problem.terms) {
    Term& added = terms_.emplace_back();
    added.cost = term.cost.get();
    added.placement = term.placement;
    added.residuals_per_state = idx(term.cost->residual_count());
    added.depends_on_velocity = term.cost->depends_on_velocity();
    const std::size_t residuals = added.residuals_per_state * idx(batch_of(term.placement).count);
    added.residuals.resize(residuals);
    added.jacobian_q.resize(residuals * idx(dof_));
    if (added.depends_on_velocity) added.jacobian_qdot.resize(residuals * idx(dof_));
    most_residuals += added.residuals_per_state;
  }
  begin_.push_back(0);
  for (int s = 0; s < states; ++s) {
    begin_.push_back(begin_.back() + group_rows(s, false) + group_rows(s, true));
  }
  rows_.resize(begin_.back() * idx(2 * dof_ + 1));
  work_.resize(most_residuals * idx(2 * dof_ + 1));
}

StateBatch StateRows::batch_of(Placement placement) const noexcept {
  switch (placement) {
    case Placement::kStart: return support_.batch(0, 1, dof_);
    case Placement::kGoal: return support_.batch(intervals_, 1, dof_);
    case Placement::kSupport: return support_.batch(0, intervals_ + 1, dof_);
    case Placement::kSupportAndInterpolated: break;
  }
  return all_.batch(0, static_cast<int>(all_.times_s.size()), dof_);
}

int StateRows::index_in(Placement placement, int state) const noexcept {
  const int last = intervals_ * (checks_ + 1);
  switch (placement) {
    case Placement::kStart: return state == 0 ? 0 : -1;
    case Placement::kGoal: return state == last ? 0 : -1;
    case Placement::kSupport: return state % (checks_ + 1) == 0 ? state / (checks_ + 1) : -1;
    case Placement::kSupportAndInterpolated: break;
  }
  return state;
}

std::size_t StateRows::group_rows(int state, bool velocity) const noexcept {
  std::size_t residuals = 0;
  for (const Term& term : terms_) {
    if (term.depends_on_velocity == velocity && index_in(term.placement, state) >= 0) {
      residuals += term.residuals_per_state;
    }
  }
  return std::min(residuals, idx(velocity ? 2 * dof_ + 1 : dof_ + 1));
}

void StateRows::update(std::span<const double> support) {
  interpolate(support);
  for (Term& term : terms_) {
    term.cost->evaluate(batch_of(term.placement),
                        {term.residuals, term.jacobian_q, term.jacobian_qdot}, scratch_);
  }
  for (int s = 0; s < state_count(); ++s) pack(s);
}

void StateRows::interpolate(std::span<const double> support) {
  const std::size_t d = idx(dof_);
  const auto store = [d](States& states, int at, const double* x) {
    std::copy_n(x, d, states.q.begin() + static_cast<std::ptrdiff_t>(idx(at) * d));
    std::copy_n(x + d, d, states.qdot.begin() + static_cast<std::ptrdiff_t>(idx(at) * d));
  };
  for (int i = 0; i <= intervals_; ++i) {
    const double* a = &support[idx(i) * 2 * d];
    store(support_, i, a);
    store(all_, i * (checks_ + 1), a);
    if (i == intervals_) break;
    const double* b = a + 2 * d;
    for (int k = 0; k < checks_; ++k) {
      const auto& [lambda, psi] = interpolation(k);
      const std::size_t at = idx(i * (checks_ + 1) + k + 1) * d;
      for (std::size_t j = 0; j < d; ++j) {
        all_.q[at + j] =
            lambda(0, 0) * a[j] + lambda(0, 1) * a[d + j] + psi(0, 0) * b[j] + psi(0, 1) * b[d + j];
        all_.qdot[at + j] =
            lambda(1, 0) * a[j] + lambda(1, 1) * a[d + j] + psi(1, 0) * b[j] + psi(1, 1) * b[d + j];
      }
    }
  }
}

void StateRows::pack(int state) {
  double* out = rows_.data() + begin_[idx(state)] * idx(2 * dof_ + 1);
  out = pack_group(state, false, out);
  pack_group(state, true, out);
}

double* StateRows::pack_group(int state, bool velocity, double* out) {
  const std::size_t d = idx(dof_);
  const std::size_t variables = velocity ? 2 * d : d;
  const std::size_t stride = work_.size() / (2 * d + 1);  // the most rows there can be
  std::size_t active = 0;
  for (const Term& term : terms_) {
    const int at = index_in(term.placement, state);
    if (term.depends_on_velocity != velocity || at < 0) continue;
    for (std::size_t m = 0; m < term.residuals_per_state; ++m) {
      const std::size_t row = idx(at) * term.residuals_per_state + m;
      const auto by_q = std::span(term.jacobian_q).subspan(row * d, d);
      const auto by_qdot =
          std::span(term.jacobian_qdot).subspan(velocity ? row * d : 0, velocity ? d : 0);
      if (term.residuals[row] == 0.0 && all_zero(by_q) && all_zero(by_qdot)) continue;
      for (std::size_t j = 0; j < d; ++j) work_[j * stride + active] = by_q[j];
      for (std::size_t j = 0; j < by_qdot.size(); ++j) {
        work_[(d + j) * stride + active] = by_qdot[j];
      }
      work_[variables * stride + active] = term.residuals[row];
      ++active;
    }
  }
  const std::size_t capacity = group_rows(state, velocity);
  const bool reduced = active > capacity;
  if (reduced) reduce_to_r(work_.data(), active, variables + 1, stride);

  std::fill_n(out, capacity * (2 * d + 1), 0.0);
  for (std::size_t row = 0; row < std::min(active, capacity); ++row) {
    double* to = out + row * (2 * d + 1);
    for (std::size_t j = reduced ? std::min(row, variables) : 0; j < variables; ++j) {
      to[j] = work_[j * stride + row];
    }
    to[2 * d] = work_[variables * stride + row];
  }
  return out + capacity * (2 * d + 1);
}

std::span<const double> StateRows::rows(int state) const noexcept {
  const std::size_t width = idx(2 * dof_ + 1);
  return std::span(rows_).subspan(begin_[idx(state)] * width, idx(row_count(state)) * width);
}

double StateRows::term_cost(std::size_t term) const noexcept {
  double sum = 0.0;
  for (const double residual : terms_[term].residuals) sum += residual * residual;
  return 0.5 * sum;
}

namespace {

/// out = [by_q, by_qdot] * [[c00 I, c01 I], [c10 I, c11 I]] for one row.
void chain_row(const double* row, const Eigen::Matrix2d& c, int dof, double* out) {
  for (int j = 0; j < dof; ++j) {
    out[j] = c(0, 0) * row[j] + c(1, 0) * row[dof + j];
    out[dof + j] = c(0, 1) * row[j] + c(1, 1) * row[dof + j];
  }
}

}  // namespace

GpPriorFactor::GpPriorFactor(const GpPrior& prior) : prior_(prior) {
  set_num_residuals(2 * prior.dof());
  mutable_parameter_block_sizes()->assign(2, 2 * prior.dof());
}

bool GpPriorFactor::Evaluate(double const* const* states, double* residuals,
                             double** jacobians) const {
  const int d = prior_.dof();
  const double dt = prior_.dt_s();
  const Eigen::Matrix2d& u = prior_.whitening();
  const double* a = states[0];
  const double* b = states[1];
  if (jacobians != nullptr) {
    for (int block = 0; block < 2; ++block) {
      if (jacobians[block] != nullptr) std::fill_n(jacobians[block], 4 * d * d, 0.0);
    }
  }
  // Row `r`, column `c` of a 2d x 2d block.
  const auto at = [d](double* block, int r, int c) -> double& { return block[r * 2 * d + c]; };
  for (int j = 0; j < d; ++j) {
    const double weight = 1.0 / std::sqrt(prior_.qc()[j]);
    const double position_error = a[j] + dt * a[d + j] - b[j];
    const double velocity_error = a[d + j] - b[d + j];
    residuals[j] = weight * (u(0, 0) * position_error + u(0, 1) * velocity_error);
    residuals[d + j] = weight * u(1, 1) * velocity_error;
    if (jacobians == nullptr) continue;
    if (double* block = jacobians[0]) {
      at(block, j, j) = weight * u(0, 0);
      at(block, j, d + j) = weight * (u(0, 0) * dt + u(0, 1));
      at(block, d + j, d + j) = weight * u(1, 1);
    }
    if (double* block = jacobians[1]) {
      at(block, j, j) = -weight * u(0, 0);
      at(block, j, d + j) = -weight * u(0, 1);
      at(block, d + j, d + j) = -weight * u(1, 1);
    }
  }
  return true;
}

IntervalFactor::IntervalFactor(const StateRows& rows, int first) : rows_(rows), first_(first) {
  int residuals = 0;
  for (int k = 0; k < rows.checks(); ++k) residuals += rows.row_count(first + k);
  set_num_residuals(residuals);
  mutable_parameter_block_sizes()->assign(2, 2 * rows.dof());
}

bool IntervalFactor::Evaluate(double const* const*, double* residuals, double** jacobians) const {
  const int d = rows_.dof();
  int i = 0;
  for (int k = 0; k < rows_.checks(); ++k) {
    const auto& [lambda, psi] = rows_.interpolation(k);
    const double* row = rows_.rows(first_ + k).data();
    for (int r = 0; r < rows_.row_count(first_ + k); ++r, ++i, row += 2 * d + 1) {
      residuals[i] = row[2 * d];
      if (jacobians == nullptr) continue;
      if (jacobians[0] != nullptr) chain_row(row, lambda, d, jacobians[0] + i * 2 * d);
      if (jacobians[1] != nullptr) chain_row(row, psi, d, jacobians[1] + i * 2 * d);
    }
  }
  return true;
}

}  // namespace sidestep
