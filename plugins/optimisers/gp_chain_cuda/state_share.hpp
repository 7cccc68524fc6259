#pragma once

#include "chain_problem.hpp"

namespace sidestep::gp_chain_cuda {

/// What the costs of one state add to the normal equations: J^T J of positions (the lower half, row
/// by row) and of velocities, of which no cost couples two, and J^T r of both.
template <int kMaxDof>
struct StateShare {
  double hessian[kMaxDof * (kMaxDof + 1) / 2];
  double gradient[kMaxDof];
  double velocity_hessian[kMaxDof];
  double velocity_gradient[kMaxDof];

  SIDESTEP_HOST_DEVICE void clear(int dof) {
    for (int k = 0; k < dof * (dof + 1) / 2; ++k) hessian[k] = 0.0;
    for (int j = 0; j < dof; ++j) gradient[j] = velocity_hessian[j] = velocity_gradient[j] = 0.0;
  }
  SIDESTEP_HOST_DEVICE void add_row(int dof, const double* row, double residual) {
    int k = 0;
    for (int r = 0; r < dof; ++r) {
      gradient[r] += row[r] * residual;
      for (int c = 0; c <= r; ++c, ++k) hessian[k] += row[r] * row[c];
    }
  }
  SIDESTEP_HOST_DEVICE void add_position(int joint, double entry, double residual) {
    hessian[joint * (joint + 1) / 2 + joint] += entry * entry;
    gradient[joint] += entry * residual;
  }
  SIDESTEP_HOST_DEVICE void add_velocity(int joint, double entry, double residual) {
    velocity_hessian[joint] += entry * entry;
    velocity_gradient[joint] += entry * residual;
  }

  /// Writes ChainProblem::share_size() numbers.
  SIDESTEP_HOST_DEVICE void store(int dof, double* to) const {
    const int lower = dof * (dof + 1) / 2;
    for (int k = 0; k < lower; ++k) to[k] = hessian[k];
    for (int j = 0; j < dof; ++j) {
      to[lower + j] = gradient[j];
      to[lower + dof + j] = velocity_hessian[j];
      to[lower + 2 * dof + j] = velocity_gradient[j];
    }
  }
};

/// The same where it was stored.
struct StoredShare {
  const double* numbers;
  int dof;

  [[nodiscard]] SIDESTEP_HOST_DEVICE double hessian(int r, int c) const {
    return r < c ? numbers[c * (c + 1) / 2 + r] : numbers[r * (r + 1) / 2 + c];
  }
  [[nodiscard]] SIDESTEP_HOST_DEVICE double gradient(int j) const { return numbers[lower() + j]; }
  [[nodiscard]] SIDESTEP_HOST_DEVICE double velocity_hessian(int j) const {
    return numbers[lower() + dof + j];
  }
  [[nodiscard]] SIDESTEP_HOST_DEVICE double velocity_gradient(int j) const {
    return numbers[lower() + 2 * dof + j];
  }

 private:
  [[nodiscard]] SIDESTEP_HOST_DEVICE int lower() const { return dof * (dof + 1) / 2; }
};

}  // namespace sidestep::gp_chain_cuda
