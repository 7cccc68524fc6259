#pragma once

#include <memory>
#include <string>

#include <sidestep/planning/optimiser.hpp>
#include <sidestep/plugin/parameters.hpp>

namespace sidestep {

/// Weights, trust region and penalties.
struct TrajoptSettings {
  std::string smoothness = "velocity";  ///< Or "acceleration".
  double smoothness_weight = 1.0;
  double keep_m = 0.02;            ///< Clearance that spheres are to keep.
  double reach_m = 0.1;            ///< Contacts of less clearance are modelled.
  double initial_penalty = 100.0;  ///< 1/m
  double penalty_factor = 10.0;
  int max_penalties = 4;       ///< Times that the penalty is multiplied.
  double trust_region = 0.2;   ///< m, rad: of the first step.
  double limit_margin = 0.01;  ///< m, rad
  double relative_tolerance = 1e-3;
  double violation_m = 1e-3;  ///< Of keep_m, that is let pass.
  int max_iterations = 200;   ///< Quadratic programs.

  static Parameters<TrajoptSettings> parameters();
};

/// Sequential convex optimisation between fixed ends: see README.md.
[[nodiscard]] std::unique_ptr<Optimiser> make_trajopt(const TrajoptSettings& settings);

}  // namespace sidestep
