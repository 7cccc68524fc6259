#include "difference_metric.hpp"

#include <cmath>
#include <vector>

namespace sidestep {
namespace {

using Entries = std::vector<Eigen::Triplet<double>>;

/// d q / d tau between neighbours, tau running from 0 to 1; each row counts for one interval.
Entries velocity_rows(int waypoints) {
  const double per_unit = std::sqrt(waypoints - 1.0);
  Entries entries;
  for (int i = 0; i + 1 < waypoints; ++i) {
    entries.emplace_back(i, i, -per_unit);
    entries.emplace_back(i, i + 1, per_unit);
  }
  return entries;
}

/// d^2 q / d tau^2 at every waypoint; at the ends without what their velocities add.
Entries acceleration_rows(int waypoints) {
  const int last = waypoints - 1;
  const double per_unit = std::pow(last, 1.5);
  const double at_end = std::sqrt(2.0) * per_unit;  // half the weight of 2 (q_1 - q_0 - dt v_0)
  Entries entries{{0, 0, -at_end}, {0, 1, at_end}, {last, last, -at_end}, {last, last - 1, at_end}};
  for (int i = 1; i < last; ++i) {
    entries.emplace_back(i, i - 1, per_unit);
    entries.emplace_back(i, i, -2.0 * per_unit);
    entries.emplace_back(i, i + 1, per_unit);
  }
  return entries;
}

}  // namespace

Derivative derivative_of(std::string_view name) noexcept {
  return name == "velocity" ? Derivative::kVelocity : Derivative::kAcceleration;
}

std::string singular_metric_reason(const Problem& problem) {
  return "the smoothness metric of " + std::to_string(problem.support_states) +
         " states is singular in double precision";
}

DifferenceMetric::DifferenceMetric(const Problem& problem, Derivative derivative) {
  const int waypoints = problem.support_states, last = waypoints - 1;
  const bool of_acceleration = derivative == Derivative::kAcceleration;
  k_.resize(of_acceleration ? waypoints : last, waypoints);
  const Entries entries = of_acceleration ? acceleration_rows(waypoints) : velocity_rows(waypoints);
  k_.setFromTriplets(entries.begin(), entries.end());
  e_.setZero(problem.qc.size(), k_.rows());
  if (of_acceleration) {
    const double at_end = std::sqrt(2.0) * std::pow(last, 1.5) * problem.dt_s;
    e_.col(0) = -at_end * problem.start.qdot;
    e_.col(last) = at_end * problem.goal.qdot;
  }
  const Eigen::SparseMatrix<double> all = k_.transpose() * k_;
  a_ = all.block(1, 1, waypoints - 2, waypoints - 2);
  weights_ = problem.qc.maxCoeff() * problem.qc.cwiseInverse();
  factor_.compute(a_);
}

double DifferenceMetric::cost(const Waypoints& positions) const {
  const Eigen::MatrixXd rows = positions * k_.transpose() + e_;
  return 0.5 * weights_.dot(rows.rowwise().squaredNorm());
}

void DifferenceMetric::add_gradient(const Waypoints& positions, double weight,
                                    Waypoints& gradient) const {
  const Eigen::MatrixXd rows = positions * k_.transpose() + e_;
  gradient += (weight * weights_).asDiagonal() * (rows * k_);
}

Eigen::MatrixXd DifferenceMetric::solve(const Eigen::MatrixXd& x) const {
  const Eigen::MatrixXd solved = factor_.solve(x.transpose());
  return solved.transpose();
}

Eigen::MatrixXd DifferenceMetric::colour(const Eigen::MatrixXd& z) const {
  const Eigen::MatrixXd coloured = factor_.matrixU().solve(z.transpose());
  return coloured.transpose();
}

}  // namespace sidestep
