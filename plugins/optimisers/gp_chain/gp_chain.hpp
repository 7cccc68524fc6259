#pragma once

#include <memory>
#include <string>

#include <sidestep/planning/optimiser.hpp>
#include <sidestep/plugin/parameters.hpp>

#include "step_rules.hpp"

namespace sidestep {

/// The method, its stopping rules and its damping.
struct GpChainSettings {
  std::string method = "levenberg_marquardt";  ///< Or "gauss_newton", "dogleg".
  double relative_tolerance = 1e-5;  ///< Stop when an accepted step lowers the cost by less.
  double absolute_tolerance = 1e-5;  ///< The same, as a difference.
  int max_iterations = 100;          ///< Accepted steps.
  double initial_damping = 0.01;     ///< Lambda of the first Levenberg-Marquardt step.
  double initial_radius = 1.0;       ///< Of dogleg's trust region.

  static Parameters<GpChainSettings> parameters();
};

/// The rule that `settings.method` names.
[[nodiscard]] std::unique_ptr<StepRule> make_step_rule(const GpChainSettings& settings);

/// GPMP2's problem solved by the structure of its chain: see README.md.
[[nodiscard]] std::unique_ptr<Optimiser> make_gp_chain(const GpChainSettings& settings);

}  // namespace sidestep
