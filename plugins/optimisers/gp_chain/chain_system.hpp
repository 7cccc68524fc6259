#pragma once

#include <cstddef>
#include <span>

#include "lanes.hpp"

namespace sidestep {

/// The normal equations H x = b of a chain of states, each coupled to the next only, so that H is
/// block tridiagonal; and their Cholesky factor, which has the same blocks (no fill).
///
/// Each state has a panel, stored column by column: rows 0 to w - 1 are its own block of H (lower
/// triangle; what stands above the diagonal is ignored), row w is its b, then, beginning at a whole
/// number of lanes, the w rows of the block that couples the next state to it, and b once more.
/// With b among the rows, eliminating a state also substitutes forward, and what is left of it
/// updates the next panel at once.
class ChainSystem {
 public:
  /// `states` blocks of `width` variables. Allocates only where it was never as large.
  void resize(int states, int width);

  [[nodiscard]] int states() const noexcept { return static_cast<int>(states_); }
  [[nodiscard]] int width() const noexcept { return static_cast<int>(width_); }
  /// Values from one column of a panel to the next.
  [[nodiscard]] std::size_t stride() const noexcept { return 2 * half_; }

  /// Sets H and b to zero.
  void clear() noexcept;
  /// Column 0 of a state's own block of H.
  [[nodiscard]] double* own_block(int state) noexcept;
  [[nodiscard]] const double* own_block(int state) const noexcept;
  /// Column 0 of the block with the rows of state + 1 and the columns of `state`.
  [[nodiscard]] double* coupling(int state) noexcept { return own_block(state) + half_; }
  [[nodiscard]] const double* coupling(int state) const noexcept {
    return own_block(state) + half_;
  }
  /// b of a state: width() values in a row, to be completed before seal().
  [[nodiscard]] double* rhs(int state) noexcept;
  [[nodiscard]] const double* rhs(int state) const noexcept;

  /// Makes a state's x zero: its rows and columns of H become those of the identity, its b zero.
  void hold(int state) noexcept;
  /// Copies b into the panels; after it only solve(), product() and rhs() are called.
  void seal() noexcept;

  /// x of (H + lambda I) x = b; states() * width() values. False where that is not positive
  /// definite; x is then undefined. H and b are kept, so that another lambda can follow.
  [[nodiscard]] bool solve(double lambda, std::span<double> x) noexcept;

  /// out = H x.
  void product(std::span<const double> x, std::span<double> out) const noexcept;

 private:
  [[nodiscard]] std::size_t panel_size() const noexcept { return width_ * 2 * half_; }
  [[nodiscard]] bool factorise(double lambda) noexcept;
  void substitute_back(std::span<double> x) noexcept;

  std::size_t states_ = 0;
  std::size_t width_ = 0;
  std::size_t half_ = 0;  ///< Rows of half a panel: a block and b, padded to whole lanes.
  AlignedArray panels_;   ///< H and b.
  AlignedArray factor_;   ///< The same for L and L^-1 b.
  AlignedArray rhs_;
  AlignedArray inverse_pivots_;
  AlignedArray solved_;  ///< x of two neighbours, zero beyond width_.
};

}  // namespace sidestep
