#pragma once

#include <span>
#include <vector>

#include <Eigen/Core>

#include "chain_system.hpp"

namespace sidestep {

/// The GP prior on a chain: 1/2 sum_i e_i^T Q(dt)^-1 e_i, e_i = Phi(dt) x_i - x_{i+1}
/// (docs/numerics.md; GPMP2, IJRR 2018, section 4). With a diagonal Qc each joint has the same 2x2
/// blocks up to a factor, so that nothing is ever built dense.
class PriorChain {
 public:
  /// `qc`: one positive value per joint. Allocates only for more joints than ever before.
  /// Returns whether the prior is another one than before.
  bool reset(const Eigen::VectorXd& qc, double dt_s);

  /// `support`: [q; qdot] of each support state, one after the other.
  [[nodiscard]] double cost(std::span<const double> support) const noexcept;

  /// Adds the prior's H, which is the same at every trajectory.
  void add_hessian(ChainSystem& system) const noexcept;
  /// Adds its b = -gradient at `support`.
  void add_rhs(ChainSystem& system, std::span<const double> support) const noexcept;

 private:
  double dt_s_ = 0.0;
  Eigen::Matrix2d information_;  ///< Q(dt)^-1 for Qc = 1.
  std::vector<double> inverse_qc_;
};

}  // namespace sidestep
