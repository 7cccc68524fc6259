#pragma once

#include <optional>
#include <span>
#include <vector>

#include <Eigen/Core>
#include <Eigen/SparseCholesky>
#include <Eigen/SparseCore>

namespace sidestep {

/// A symmetric matrix of blocks x blocks blocks of `width` x `width` that is zero farther than
/// `reach` blocks off its diagonal. Holds the lower half of its band as one sparse matrix.
class BandMatrix {
 public:
  BandMatrix(int blocks, int width, int reach);

  [[nodiscard]] int size() const noexcept { return static_cast<int>(lower_.cols()); }
  /// Adds a value at (row, column) and at (column, row).
  void add(int row, int column, double value) noexcept;
  /// Adds weight * a a^T to the variables from `first` on.
  void add_square(int first, std::span<const double> a, double weight) noexcept;
  [[nodiscard]] Eigen::VectorXd times(const Eigen::VectorXd& x) const;
  [[nodiscard]] const Eigen::SparseMatrix<double>& lower() const noexcept { return lower_; }

 private:
  Eigen::SparseMatrix<double> lower_;
};

/// weight * max(0, bound - sum_i coefficients[i] x[first + i])
struct Hinge {
  int first = 0;
  std::vector<double> coefficients;
  double bound = 0.0;
  double weight = 0.0;

  /// Of its argument: positive where the hinge costs.
  [[nodiscard]] double shortfall(const Eigen::VectorXd& x) const noexcept;
};

/// 1/2 x^T H x + g^T x + sum of hinges, lower <= x <= upper. H is positive semidefinite, and no
/// hinge is wider than its band.
struct PenaltyQp {
  BandMatrix h;
  Eigen::VectorXd g;
  Eigen::VectorXd lower, upper;
  std::vector<Hinge> hinges;

  [[nodiscard]] double value(const Eigen::VectorXd& x) const;
};

/// The minimum, by Mehrotra's predictor and corrector on the optimality conditions (Nocedal and
/// Wright, Numerical Optimization, 2nd ed., section 16.6): a hinge is a slack t >= 0, t >= bound -
/// a x, whose multipliers add up to its weight, so that a step factorises H + A^T W A + D, which
/// has the band of H. Hinges that cost nothing anywhere within the bounds are left out. Nothing
/// where the numbers go wrong. Bounds are kept to 1e-9.
[[nodiscard]] std::optional<Eigen::VectorXd> minimise(const PenaltyQp& qp);

}  // namespace sidestep
