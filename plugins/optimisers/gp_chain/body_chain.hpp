#pragma once

#include <array>
#include <span>
#include <vector>

#include <Eigen/Core>

#include <sidestep/planning/state_normals.hpp>
#include <sidestep/trajectory/gp_prior.hpp>

#include "chain_system.hpp"

namespace sidestep {

/// What of a chain is another where the GP prior of a planar base is on the velocities of its body
/// in its own frame, a Lie group's (docs/numerics.md; GPMP2, IJRR 2018; Dong et al., ICRA 2018):
/// the prior itself, the states in between, and how a step changes a state. States stay [q; qdot]
/// with velocities along the world's axes.
class BodyChain {
 public:
  /// The joints of the base: x, y, heading.
  using Base = std::array<int, 3>;

  /// `qc`: one positive value per joint.
  BodyChain(const Base& base, const Eigen::VectorXd& qc, double dt_s);

  /// Whether it was made of these.
  [[nodiscard]] bool is_of(const Base& base, const Eigen::VectorXd& qc, double dt_s) const {
    return base == base_ && dt_s == dt_s_ && qc.size() == qc_.size() && qc == qc_;
  }

  /// Of the prior between two states, [q; qdot] each.
  [[nodiscard]] double cost(const double* a, const double* b) const noexcept;
  /// Adds the prior's normal equations at `support`: [q; qdot] of each support state.
  void add_prior(ChainSystem& system, std::span<const double> support) const noexcept;

  /// Puts the base of a state interpolated between `a` and `b` into q and qdot.
  void interpolate(const double* a, const double* b, const GpPrior::Interpolation& at, double* q,
                   double* qdot) const noexcept;
  /// Adds the normal equations of the states interpolated between support states i = `interval`
  /// and i + 1: add_interval(), by how the base follows from these two.
  void add_interval(const StateNormals& normals, std::size_t first,
                    std::span<const GpPrior::Interpolation> checks, std::span<const double> support,
                    ChainSystem& system, int interval);

  /// Turns complete normal equations of [q; qdot] into those of a step, to which the velocity of
  /// the base is in its own frame.
  void turn_into_body(ChainSystem& system, std::span<const double> support) const noexcept;
  /// `moved`: `support` plus a step; turns its velocities of the base back into the world.
  void turn_into_world(std::span<const double> support, std::span<double> moved) const noexcept;

 private:
  /// Of the base alone: x, y and heading, then their velocities.
  [[nodiscard]] Eigen::Matrix<double, 6, 1> state_of(const double* values) const noexcept;
  /// `by_states`: the derivatives of an interpolated state of the base by those at its sides.
  void set_chain(const Eigen::Matrix<double, 6, 12>& by_states, const GpPrior::Interpolation& at);
  void add_state(const StateNormals::Block& block, std::size_t stride, std::size_t width,
                 ChainSystem& system, int interval);

  /// How one value of two support states, m * dof + j of (q_i, qdot_i, q_{i+1}, qdot_{i+1}), moves
  /// those of an interpolated one.
  struct Column {
    std::array<std::size_t, 6> rows{};  ///< In [q; qdot], those of q first.
    std::array<double, 6> weights{};
    std::size_t positions = 0, count = 0;
  };

  Base base_;
  Eigen::VectorXd qc_;
  std::size_t dof_;
  double dt_s_;
  Eigen::Matrix<double, 6, 6> whitening_;
  std::array<std::size_t, 6> variables_;  ///< Of the base in [q; qdot].
  std::vector<Column> chain_;
  std::vector<double> product_;
};

}  // namespace sidestep
