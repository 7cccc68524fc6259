#pragma once

#include <Eigen/Core>

namespace sidestep {

/// The white-noise-on-acceleration GP prior on a chain of states x = [q; qdot] with diagonal
/// power spectral density Qc (docs/numerics.md; GPMP2, IJRR 2018, section 4). All joints share
/// the 2x2 structure, so nothing is ever built dense.
///
/// Residual of one interval, whitened: for joint j with e = Phi(dt) x_i - x_{i+1},
/// r_j = U e_j / sqrt(qc_j), where U^T U = Q(dt)^-1 for Qc = 1.
class GpPrior {
 public:
  /// `qc`: one positive value per joint. `dt_s` > 0.
  GpPrior(Eigen::VectorXd qc, double dt_s);

  [[nodiscard]] int dof() const noexcept { return static_cast<int>(qc_.size()); }
  [[nodiscard]] double dt_s() const noexcept { return dt_s_; }
  [[nodiscard]] const Eigen::VectorXd& qc() const noexcept { return qc_; }

  /// The upper-triangular U with U^T U = Q(dt)^-1 for Qc = 1 (2x2, position then velocity).
  [[nodiscard]] const Eigen::Matrix2d& whitening() const noexcept { return whitening_; }

  /// Interpolation at dt_s * fraction, 0 <= fraction <= 1: x = Lambda x_i + Psi x_{i+1}, both
  /// 2x2 per joint.
  struct Interpolation {
    Eigen::Matrix2d lambda;
    Eigen::Matrix2d psi;
  };
  [[nodiscard]] Interpolation interpolation(double fraction) const noexcept;

 private:
  Eigen::VectorXd qc_;
  double dt_s_;
  Eigen::Matrix2d whitening_;
};

}  // namespace sidestep
