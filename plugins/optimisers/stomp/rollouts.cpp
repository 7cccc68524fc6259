#include "rollouts.hpp"

#include <algorithm>
#include <cmath>
#include <limits>

namespace sidestep {

void weigh(std::span<const double> costs, double sensitivity, std::span<double> probabilities) {
  double least = std::numeric_limits<double>::infinity(), most = -least;
  for (const double cost : costs) {
    if (!std::isfinite(cost)) continue;
    least = std::min(least, cost);
    most = std::max(most, cost);
  }
  const double range = most - least;
  double sum = 0.0;
  for (std::size_t k = 0; k < costs.size(); ++k) {
    const double above = range > 0.0 ? (costs[k] - least) / range : 0.0;
    probabilities[k] = std::isfinite(costs[k]) ? std::exp(-sensitivity * above) : 0.0;
    sum += probabilities[k];
  }
  if (sum <= 0.0) return;
  for (double& probability : probabilities) probability /= sum;
}

Eigen::MatrixXd weighed_deviation(const std::vector<const Rollout*>& rollouts,
                                  const Waypoints& current, double sensitivity) {
  const Eigen::Index inner = current.cols() - 2;
  Eigen::MatrixXd sum = Eigen::MatrixXd::Zero(current.rows(), inner);
  std::vector<double> costs(rollouts.size()), probabilities(rollouts.size());
  for (Eigen::Index i = 0; i < inner; ++i) {
    for (std::size_t k = 0; k < rollouts.size(); ++k) {
      costs[k] = rollouts[k]->costs[static_cast<std::size_t>(i) + 1];
    }
    weigh(costs, sensitivity, probabilities);
    for (std::size_t k = 0; k < rollouts.size(); ++k) {
      if (probabilities[k] == 0.0) continue;
      sum.col(i) += probabilities[k] * (rollouts[k]->positions.col(i + 1) - current.col(i + 1));
    }
  }
  return sum;
}

Exploration::Exploration(const DifferenceMetric& metric)
    : metric_(metric), column_scales_(metric.inner()) {
  const int n = metric.inner();
  double largest = 0.0;
  for (int i = 0; i < n; ++i) {
    Eigen::MatrixXd unit = Eigen::MatrixXd::Zero(1, n);
    unit(0, i) = 1.0;
    const Eigen::MatrixXd column = metric.solve(unit);
    largest = std::max(largest, column(0, i));
    column_scales_[i] = 1.0 / (n * column.maxCoeff());
  }
  scale_ = 1.0 / std::sqrt(largest);
}

Eigen::MatrixXd Exploration::noise(const Eigen::MatrixXd& z,
                                   const Eigen::VectorXd& deviations) const {
  return (scale_ * deviations).asDiagonal() * metric_.colour(z);
}

Eigen::MatrixXd Exploration::smooth(const Eigen::MatrixXd& x) const {
  return metric_.solve(x * column_scales_.asDiagonal());
}

}  // namespace sidestep
