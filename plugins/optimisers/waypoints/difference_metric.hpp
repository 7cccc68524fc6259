#pragma once

#include <string>
#include <string_view>

#include <Eigen/SparseCholesky>
#include <Eigen/SparseCore>

#include <sidestep/planning/problem.hpp>

#include "waypoint_states.hpp"

namespace sidestep {

/// Of what the square is summed.
enum class Derivative { kVelocity, kAcceleration };
/// By the name that a parameter gives it: "velocity", else acceleration.
[[nodiscard]] Derivative derivative_of(std::string_view name) noexcept;

/// How smooth waypoints are, by finite differences (Zucker 2013, section 3.1): over the time of the
/// motion taken as 1, half the integral of the squared derivative,
///
///     F(q) = 1/2 sum_j w_j |K q_j + e_j|^2,   A = K^T K,
///
/// with w_j the largest qc over that of joint j. It therefore depends neither on the time between
/// waypoints nor on the number of them, up to the error of the differences. Accelerations are
/// second differences; those at the ends are made with the velocities of start and goal, for which
/// the neighbour beyond an end is the one that makes the central difference that velocity, and
/// count half (trapezoidal rule). The ends are fixed: A is that of the waypoints between them.
/// [any]; allocates.
class DifferenceMetric {
 public:
  DifferenceMetric(const Problem& problem, Derivative derivative);

  /// False where A is not positive definite in double precision; nothing else may be called then.
  [[nodiscard]] bool is_usable() const noexcept { return factor_.info() == Eigen::Success; }

  [[nodiscard]] double cost(const Waypoints& positions) const;
  /// Adds weight times the gradient by all waypoints, ends included.
  void add_gradient(const Waypoints& positions, double weight, Waypoints& gradient) const;

  /// A^-1 x, joint by joint and without the weights w_j, of the inner waypoints: dof x inner().
  [[nodiscard]] Eigen::MatrixXd solve(const Eigen::MatrixXd& x) const;
  /// L^-T z for A = L L^T: with z standard normal, a sample of N(0, A^-1) per joint.
  [[nodiscard]] Eigen::MatrixXd colour(const Eigen::MatrixXd& z) const;

  [[nodiscard]] int inner() const noexcept { return static_cast<int>(a_.cols()); }
  [[nodiscard]] const Eigen::SparseMatrix<double>& a() const noexcept { return a_; }
  /// w_j of each joint, at least 1.
  [[nodiscard]] const Eigen::VectorXd& joint_weights() const noexcept { return weights_; }

 private:
  Eigen::SparseMatrix<double> k_;  ///< Rows x waypoints.
  Eigen::MatrixXd e_;              ///< dof x rows.
  Eigen::SparseMatrix<double> a_;  ///< Inner waypoints only.
  Eigen::VectorXd weights_;
  Eigen::SimplicialLLT<Eigen::SparseMatrix<double>, Eigen::Lower, Eigen::NaturalOrdering<int>>
      factor_;
};

/// Why a problem has no usable metric.
[[nodiscard]] std::string singular_metric_reason(const Problem& problem);

}  // namespace sidestep
