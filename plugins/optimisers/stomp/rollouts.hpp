#pragma once

#include <vector>

#include "difference_metric.hpp"

namespace sidestep {

/// A path that strays from the current one, and what it costs.
struct Rollout {
  Waypoints positions;
  std::vector<double> costs;  ///< Of each waypoint, derivative-free.
  double total = 0.0;         ///< Their sum and the smoothness; what a path is judged by.
  bool is_known = false;      ///< Whether costs and total are.
};

/// P of every rollout at one waypoint (Kalakrishnan 2011, eq. 11):
/// exp(-h (S - min S) / (max S - min S)), normalised. A cost that is not a finite number has none;
/// equal costs have equal ones.
void weigh(std::span<const double> costs, double sensitivity, std::span<double> probabilities);

/// The mean of the rollouts' deviations from `current` at each waypoint, weighed by their costs
/// there: dof x inner waypoints.
[[nodiscard]] Eigen::MatrixXd weighed_deviation(const std::vector<const Rollout*>& rollouts,
                                                const Waypoints& current, double sensitivity);

/// What of a path between fixed ends is drawn, and how an update is made smooth.
class Exploration {
 public:
  explicit Exploration(const DifferenceMetric& metric);

  /// L^-T z of `DifferenceMetric::colour`, scaled so that the largest standard deviation of all
  /// waypoints is `deviations` of each joint. z: standard normal, dof x inner waypoints.
  [[nodiscard]] Eigen::MatrixXd noise(const Eigen::MatrixXd& z,
                                      const Eigen::VectorXd& deviations) const;

  /// M x, M being A^-1 with every column scaled so that its largest element is one over the number
  /// of waypoints (Kalakrishnan 2011, section II).
  [[nodiscard]] Eigen::MatrixXd smooth(const Eigen::MatrixXd& x) const;

 private:
  const DifferenceMetric& metric_;
  double scale_ = 1.0;             ///< Of noise.
  Eigen::VectorXd column_scales_;  ///< Of M.
};

}  // namespace sidestep
