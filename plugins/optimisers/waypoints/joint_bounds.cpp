#include "joint_bounds.hpp"

#include <algorithm>
#include <cmath>

namespace sidestep {

JointBounds::JointBounds(const Problem& problem, double margin)
    : lower(problem.qc.size()), upper(problem.qc.size()) {
  for (Eigen::Index j = 0; j < lower.size(); ++j) {
    const Joint& joint = problem.robot->description().joints[static_cast<std::size_t>(j)];
    const double inset = std::min(margin, 0.5 * (joint.upper - joint.lower));
    const auto [low, high] = std::minmax(problem.start.q[j], problem.goal.q[j]);
    lower[j] = std::max(joint.lower, std::min(joint.lower + inset, low));
    upper[j] = std::min(joint.upper, std::max(joint.upper - inset, high));
  }
}

bool JointBounds::contain(const Waypoints& positions) const {
  return ((positions.colwise() - lower).array() >= 0.0).all() &&
         ((positions.colwise() - upper).array() <= 0.0).all();
}

void keep_within(const JointBounds& bounds, const DifferenceMetric& metric, Waypoints& positions) {
  auto inner = positions.middleCols(1, metric.inner());
  for (int round = 0; round < metric.inner(); ++round) {
    const Eigen::MatrixXd low = inner.colwise() - bounds.lower;
    const Eigen::MatrixXd high = inner.colwise() - bounds.upper;
    const Eigen::MatrixXd beyond = low.cwiseMin(0.0) + high.cwiseMax(0.0);
    if (beyond.isZero(1e-12) || !beyond.allFinite()) break;
    const Eigen::MatrixXd spread = metric.solve(beyond);
    for (Eigen::Index j = 0; j < inner.rows(); ++j) {
      Eigen::Index worst = 0;
      if (beyond.row(j).cwiseAbs().maxCoeff(&worst) <= 0.0) continue;
      // A^-1 is positive on the diagonal, but neighbours pull the other way where a joint breaks
      // both of its limits.
      const double scale = beyond(j, worst) / spread(j, worst);
      if (std::isfinite(scale) && scale > 0.0) inner.row(j) -= scale * spread.row(j);
    }
  }
  inner = inner.cwiseMax(bounds.lower.replicate(1, inner.cols()))
              .cwiseMin(bounds.upper.replicate(1, inner.cols()));
}

}  // namespace sidestep
