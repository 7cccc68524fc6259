#pragma once

#include <cstddef>
#include <cstdint>
#include <limits>
#include <span>
#include <vector>

#include <sidestep/core/export.hpp>
#include <sidestep/core/lanes.hpp>

namespace sidestep {

/// The Gauss-Newton normal equations J^T J and J^T r of n single states, summed over cost terms.
/// Costs of positions only (obstacles, self-collision, limits) and costs that depend on velocities
/// as well are kept apart, for the second kind has blocks of four times the size.
class SIDESTEP_EXPORT StateNormals {
 public:
  /// One state's share: a symmetric `width` x `width` block, column by column, and the gradient.
  struct Block {
    const double* hessian;   ///< Columns stride() apart, zero beyond the width.
    const double* gradient;  ///< Padded likewise.
  };

  void resize(int states, int dof);
  void clear() noexcept;
  void clear(std::size_t state) noexcept;  ///< One of them.

  /// Rows of a term may be skipped once its cost reaches this, as where a step that costs too much
  /// is refused: StateCost::linearise() may then leave them out. Infinity by default.
  void want_rows_below(double cost) noexcept { rows_wanted_below_ = cost; }
  [[nodiscard]] double rows_wanted_below() const noexcept { return rows_wanted_below_; }

  [[nodiscard]] int dof() const noexcept { return static_cast<int>(dof_); }
  [[nodiscard]] std::size_t position_stride() const noexcept { return padded(dof_); }
  [[nodiscard]] std::size_t full_stride() const noexcept { return padded(2 * dof_); }

  /// Whether any cost of positions only is felt at a state; else its block means nothing.
  [[nodiscard]] bool has_position(std::size_t state) const noexcept {
    return position_.active[state] != 0;
  }
  [[nodiscard]] bool has_full(std::size_t state) const noexcept { return full_.active[state] != 0; }
  [[nodiscard]] Block position(std::size_t state) const noexcept { return position_.at(state); }
  /// Of [q; qdot].
  [[nodiscard]] Block full(std::size_t state) const noexcept { return full_.at(state); }

  /// Adds rows of positions only to a state: by_q holds residuals.size() x dof() values.
  void add_rows(std::size_t state, std::span<const double> by_q, std::span<const double> residuals);
  /// Adds the row [by_q, by_qdot | residual]; each holds dof() values.
  void add_row(std::size_t state, std::span<const double> by_q, std::span<const double> by_qdot,
               double residual);
  /// Adds a row with a single entry, of a joint's position or of its velocity.
  void add_position_entry(std::size_t state, std::size_t joint, double entry, double residual);
  void add_velocity_entry(std::size_t state, std::size_t joint, double entry, double residual);

 private:
  struct Blocks {
    std::size_t width = 0;
    AlignedArray hessians, gradients;
    std::vector<std::uint8_t> active;
    void resize(std::size_t states, std::size_t block_width);
    /// Zeroes a block that has no contribution yet.
    void open(std::size_t state) noexcept;
    void add(std::size_t state, const double* row, double residual);
    void add_entry(std::size_t state, std::size_t variable, double entry, double residual);
    [[nodiscard]] Block at(std::size_t state) const noexcept {
      const std::size_t stride = padded(width);
      return {hessians.data() + state * width * stride, gradients.data() + state * stride};
    }
  };

  std::size_t dof_ = 0;
  double rows_wanted_below_ = std::numeric_limits<double>::infinity();
  Blocks position_, full_;
  AlignedArray row_;
};

/// Where a batch of states lies among all: state i of the batch is state first + i * step.
struct StateRange {
  std::size_t first = 0;
  std::size_t step = 1;
  [[nodiscard]] std::size_t operator[](std::size_t i) const noexcept { return first + i * step; }
};

}  // namespace sidestep
