#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include <sidestep/core/lanes.hpp>

namespace sidestep {

struct ChainPanel;

/// The normal equations H x = b of a chain of states, each coupled to the next only, so that H is
/// block tridiagonal; and their Cholesky factor, which has the same blocks (no fill).
///
/// Each state has a panel, stored column by column: the w rows of its own block of H (lower
/// triangle; what stands above the diagonal is ignored), then, beginning at a whole number of
/// lanes, the w rows of the block that couples the next state to it, and b as row w. With b among
/// the rows, eliminating a state also substitutes forward, and what is left of it updates the next
/// panel at once.
///
/// Where nothing but a GP prior of single joints is felt no joint is coupled with another one, and
/// a state is eliminated joint by joint, all of them side by side (panel_kernels.hpp). Such states
/// at the beginning of the chain are eliminated forwards, those at its end backwards, and the
/// panels between them one after the other.
class ChainSystem {
 public:
  /// `states` blocks of `width` variables [q; qdot], an even number. Allocates only where it was
  /// never as large.
  void resize(int states, int width);

  [[nodiscard]] int states() const noexcept { return static_cast<int>(states_); }
  [[nodiscard]] int width() const noexcept { return static_cast<int>(width_); }
  /// Values from one column of a panel to the next.
  [[nodiscard]] std::size_t stride() const noexcept { return own_ + next_; }

  /// Sets b to zero, and H to what it was at the last keep(), or else to zero. The panels before
  /// `changed` are going to be filled with what they held: their elimination is kept.
  void clear(int changed = 0) noexcept;
  /// Keeps H as it is for clear() to go back to.
  void keep() noexcept;
  /// Column 0 of a state's own block of H. What is not const counts as written to, until seal().
  [[nodiscard]] double* own_block(int state) noexcept;
  [[nodiscard]] const double* own_block(int state) const noexcept;
  /// Column 0 of the block with the rows of state + 1 and the columns of `state`.
  [[nodiscard]] double* coupling(int state) noexcept { return own_block(state) + own_; }
  [[nodiscard]] const double* coupling(int state) const noexcept { return own_block(state) + own_; }
  /// b of a state: width() values in a row, to be completed before seal().
  [[nodiscard]] double* rhs(int state) noexcept;
  [[nodiscard]] const double* rhs(int state) const noexcept;

  /// Makes a state's x zero: its rows and columns of H become those of the identity, its b zero.
  void hold(int state) noexcept;
  /// Copies b into the panels; after it only solve(), predicted_decrease(), product() and rhs() are
  /// called.
  void seal() noexcept;

  /// x of (H + lambda I) x = b; states() * width() values. False where that is not positive
  /// definite; x is then undefined. H and b are kept, so that another lambda can follow. Where
  /// panels have not changed since they were eliminated with the same lambda, begins after them.
  [[nodiscard]] bool solve(double lambda, std::span<double> x) noexcept;

  /// The decrease of 1/2 |r + J x|^2 from x = 0 to the x of (H + lambda I) x = b, where H = J^T J
  /// and b = -J^T r: 1/2 (b . x + lambda x . x).
  [[nodiscard]] double predicted_decrease(double lambda, std::span<const double> x) const noexcept;

  /// Turns independent normal numbers into a sample of N(0, (H + lambda I)^-1) for the H and lambda
  /// of the last solve(). states() * width() values.
  void spread(std::span<double> x) noexcept;

  /// out = H x.
  void product(std::span<const double> x, std::span<double> out) const noexcept;

 private:
  [[nodiscard]] std::size_t panel_size() const noexcept { return width_ * stride(); }

  [[nodiscard]] double* panel(std::size_t state) noexcept {
    return panels_.data() + state * panel_size();
  }
  [[nodiscard]] std::size_t dof() const noexcept { return width_ / 2; }
  /// Lanes may be written beyond whole ones of width_: the velocities of joints begin anywhere.
  [[nodiscard]] std::size_t solved_stride() const noexcept { return padded(width_) + kLanes; }
  [[nodiscard]] std::size_t joint_row() const noexcept { return padded(dof()); }
  [[nodiscard]] double* joint_panel(std::size_t state) noexcept;
  [[nodiscard]] double* joint_factor(std::size_t state) noexcept;
  [[nodiscard]] double* remainder(std::size_t state) noexcept;

  void examine(std::size_t state) noexcept;
  void divide() noexcept;
  [[nodiscard]] ChainPanel panel_of(std::size_t state) noexcept;
  [[nodiscard]] bool eliminate_end(double lambda) noexcept;
  [[nodiscard]] bool eliminate_next(double lambda) noexcept;
  void substitute_back(std::span<double> x) noexcept;

  /// What has happened to a panel.
  struct Traits {
    bool is_written = false;    ///< H may not be what was kept.
    bool is_examined = false;   ///< What follows is known.
    bool own_couples = false;   ///< Joints with each other, in its own block,
    bool next_couples = false;  ///< and in the coupling.
  };

  std::size_t states_ = 0;
  std::size_t width_ = 0;
  std::size_t eliminated_ = 0;  ///< Panels from the first on whose factor stands for H and lambda_.
  double lambda_ = 0.0;
  std::size_t begin_ = 0;  ///< Panels before it are eliminated joint by joint forwards,
  std::size_t end_ = 0;    ///< and from it on backwards.
  std::vector<Traits> traits_;
  std::vector<std::int64_t> masks_;  ///< Of mark_couplings().
  std::size_t own_ = 0;              ///< Rows of a panel for a block, in whole lanes,
  std::size_t next_ = 0;             ///< and for a block and b.
  AlignedArray panels_;              ///< H and b.
  AlignedArray kept_;                ///< H at the last keep().
  /// The panel of kept_ that a state had then: the first of equal ones, which stays in the cache.
  std::vector<std::size_t> kept_as_;
  AlignedArray factor_;  ///< The same of L D and L^-1 b.
  AlignedArray rows_;    ///< L of the states' own blocks, row by row.
  AlignedArray rhs_;
  AlignedArray inverse_pivots_;
  AlignedArray scaled_;  ///< Of one panel: the coupling times its inverse pivots, and b.
  AlignedArray solved_;  ///< x of every state, zero beyond width_.
  AlignedArray joint_panels_, joint_factors_, remainders_;
};

}  // namespace sidestep
