#pragma once

#include <memory>

#include <sidestep/planning/optimiser.hpp>
#include <sidestep/plugin/parameters.hpp>

namespace sidestep {

/// Stopping rules and damping of the Levenberg-Marquardt iteration.
struct GpCeresSettings {
  double relative_tolerance = 1e-5;  ///< Stop when an accepted step lowers the cost by less.
  double absolute_tolerance = 1e-5;  ///< The same, as a difference.
  int max_iterations = 100;          ///< Steps tried, accepted or not.
  double initial_damping = 0.01;     ///< Lambda of the first step: (H + lambda I) dx = -g.

  static Parameters<GpCeresSettings> parameters();
};

/// GPMP2's problem on Ceres: see README.md.
[[nodiscard]] std::unique_ptr<Optimiser> make_gp_ceres(const GpCeresSettings& settings);

}  // namespace sidestep
