#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include <Eigen/Core>

#include <sidestep/planning/problem.hpp>

#include "chain_system.hpp"

namespace sidestep {

/// The GP prior on a chain: 1/2 sum_i e_i^T Q(dt)^-1 e_i, e_i = Phi(dt) x_i - x_{i+1}
/// (docs/numerics.md; GPMP2, IJRR 2018, section 4). With a diagonal Qc each joint has the same 2x2
/// blocks up to a factor, so that nothing is ever built dense.
class PriorChain {
 public:
  /// `qc`: one positive value per joint. `apart`: joints that it leaves out. Allocates only for
  /// more joints than ever before. Returns whether the prior is another one than before.
  bool reset(const Eigen::VectorXd& qc, double dt_s, std::span<const int> apart = {});

  /// `support`: [q; qdot] of each support state, one after the other.
  [[nodiscard]] double cost(std::span<const double> support) const noexcept;

  /// Adds the prior's H, which is the same at every trajectory.
  void add_hessian(ChainSystem& system) const noexcept;
  /// Adds its b = -gradient at `support`.
  void add_rhs(ChainSystem& system, std::span<const double> support) const noexcept;

 private:
  double dt_s_ = 0.0;
  Eigen::Matrix2d information_;     ///< Q(dt)^-1 for Qc = 1.
  std::vector<double> inverse_qc_;  ///< 0 of a joint that is left out.
};

/// Draws how far a motion strays from another one between the same two states: samples of a
/// problem's GP prior with both ends held. With Qc q and T between the ends, half way a position
/// strays by sqrt(q T^3 / 192) in the mean square.
class PriorSampler {
 public:
  void reset(const Problem& problem);

  /// A sample: [q; qdot] of each support state, one after the other, zero at both ends. Equal seeds
  /// draw equal samples.
  void draw(std::uint64_t seed, std::span<double> out);

 private:
  ChainSystem system_;
};

}  // namespace sidestep
