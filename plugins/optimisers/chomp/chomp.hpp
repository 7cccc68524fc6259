#pragma once

#include <memory>
#include <string>

#include <sidestep/planning/optimiser.hpp>
#include <sidestep/plugin/parameters.hpp>

namespace sidestep {

/// Weights, step lengths and stopping rule.
struct ChompSettings {
  std::string smoothness = "acceleration";  ///< Or "velocity": what the metric A is made of.
  double smoothness_weight = 1.0;
  double obstacle_weight = 1e4;  ///< 1/m^2
  double epsilon_m = 0.05;       ///< Obstacles are felt this far from a sphere.
  double learning_rate = 0.2;    ///< The longest step: 1 / eta.
  double limit_margin = 0.01;    ///< m, rad
  double relative_tolerance = 1e-3;
  int patience = 10;  ///< Iterations over which the tolerance applies.
  int max_iterations = 2000;

  static Parameters<ChompSettings> parameters();
};

/// Covariant gradient descent between fixed ends: see README.md.
[[nodiscard]] std::unique_ptr<Optimiser> make_chomp(const ChompSettings& settings);

}  // namespace sidestep
