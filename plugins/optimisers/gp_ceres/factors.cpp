#include "factors.hpp"

#include <algorithm>
#include <cmath>

namespace sidestep {
namespace {

/// out = [by_q, by_qdot] * [[c00 I, c01 I], [c10 I, c11 I]] for one row.
void chain_row(const double* row, const Eigen::Matrix2d& c, int dof, double* out) {
  for (int j = 0; j < dof; ++j) {
    out[j] = c(0, 0) * row[j] + c(1, 0) * row[dof + j];
    out[dof + j] = c(0, 1) * row[j] + c(1, 1) * row[dof + j];
  }
}

}  // namespace

void BatchEvaluation::PrepareForEvaluation(bool, bool new_evaluation_point) {
  // Jacobians come along at once: most steps are accepted, and Ceres then asks for them at the
  // same point.
  if (new_evaluation_point) rows_.update(support_);
}

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

SupportFactor::SupportFactor(const StateRows& rows, int state) : rows_(rows), state_(state) {
  set_num_residuals(rows.row_count(state));
  mutable_parameter_block_sizes()->assign(1, 2 * rows.dof());
}

bool SupportFactor::Evaluate(double const* const*, double* residuals, double** jacobians) const {
  const int width = 2 * rows_.dof() + 1;
  const double* row = rows_.rows(state_).data();
  for (int i = 0; i < num_residuals(); ++i, row += width) {
    residuals[i] = row[width - 1];
    if (jacobians != nullptr && jacobians[0] != nullptr) {
      std::copy_n(row, width - 1, jacobians[0] + i * (width - 1));
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
