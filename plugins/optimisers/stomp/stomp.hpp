#pragma once

#include <cstdint>
#include <memory>
#include <string>
#include <vector>

#include <sidestep/core/worker_pool.hpp>
#include <sidestep/planning/optimiser.hpp>
#include <sidestep/plugin/parameters.hpp>

#include "waypoints.hpp"

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

/// Noise, weights and stopping rule.
struct StompSettings {
  std::string smoothness = "acceleration";  ///< Or "velocity": what the metric R is made of.
  double smoothness_weight = 1.0;
  int rollouts = 20;           ///< Of an iteration, those of earlier ones included.
  int reused = 8;              ///< The best of earlier iterations.
  double noise_s = 0.2;        ///< Standard deviation, as time at a joint's full speed.
  double noise_decay = 0.99;   ///< Of the noise, from one iteration to the next.
  double sensitivity = 10.0;   ///< h of the weights.
  double limit_margin = 0.01;  ///< m, rad
  double relative_tolerance = 1e-2;
  int patience = 30;  ///< Iterations over which the tolerance applies.
  int max_iterations = 500;

  [[nodiscard]] std::vector<OptionMistake> check() const;

  static Parameters<StompSettings> parameters();
};

/// Stochastic optimisation between fixed ends: see README.md. The rollouts of an iteration share
/// the threads of `workers`, or go one after the other where it is null; `seed` is of their noise.
[[nodiscard]] std::unique_ptr<Optimiser> make_stomp(const StompSettings& settings,
                                                    WorkerPool* workers = nullptr,
                                                    std::uint64_t seed = 1);

}  // namespace sidestep
