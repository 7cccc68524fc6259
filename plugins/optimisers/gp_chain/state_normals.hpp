#pragma once

#include <cstdint>
#include <vector>

#include <sidestep/planning/state_cost.hpp>

#include "lanes.hpp"

namespace sidestep {

/// The Gauss-Newton normal equations J^T J and J^T r of n single states, summed over cost terms.
/// Costs of positions only (obstacles, self-collision, limits) and costs that depend on velocities
/// as well are kept apart, for the second kind has blocks of four times the size.
class StateNormals {
 public:
  /// One state's share: a symmetric `width` x `width` block, column by column, and the gradient.
  struct Block {
    const double* hessian;   ///< Columns stride() apart, zero beyond the width.
    const double* gradient;  ///< Padded likewise.
  };

  void resize(int states, int dof);
  void clear() noexcept;

  [[nodiscard]] int dof() const noexcept { return static_cast<int>(dof_); }
  [[nodiscard]] std::size_t position_stride() const noexcept { return padded(dof_); }
  [[nodiscard]] std::size_t full_stride() const noexcept { return padded(2 * dof_); }

  /// Whether any cost of positions only is felt at a state; else its block is zero.
  [[nodiscard]] bool has_position(std::size_t state) const noexcept {
    return position_.active[state] != 0;
  }
  [[nodiscard]] bool has_full(std::size_t state) const noexcept { return full_.active[state] != 0; }
  [[nodiscard]] Block position(std::size_t state) const noexcept { return position_.at(state); }
  /// Of [q; qdot].
  [[nodiscard]] Block full(std::size_t state) const noexcept { return full_.at(state); }

  /// Adds the rows [by_q, by_qdot | residual] of a state; `by_qdot` is null for a cost of positions
  /// only. Each holds dof() values.
  void add_row(std::size_t state, const double* by_q, const double* by_qdot, double residual);

 private:
  struct Blocks {
    std::size_t width = 0;
    AlignedArray hessians, gradients;
    std::vector<std::uint8_t> active;
    void resize(std::size_t states, std::size_t block_width);
    void clear() noexcept;
    void add(std::size_t state, const double* row, double residual);
    [[nodiscard]] Block at(std::size_t state) const noexcept {
      const std::size_t stride = padded(width);
      return {hessians.data() + state * width * stride, gradients.data() + state * stride};
    }
  };

  std::size_t dof_ = 0;
  Blocks position_, full_;
  AlignedArray row_;
};

/// Evaluates one cost at a batch of states and adds its rows: state i of the batch is state
/// `first + i * step` of `out`. Returns 1/2 the sum of squares. [planning]; allocates nothing
/// once `scratch` is warm.
double add_cost(const StateCost& cost, const StateBatch& states, std::size_t first,
                std::size_t step, StateNormals& out, Scratch& scratch);

}  // namespace sidestep
