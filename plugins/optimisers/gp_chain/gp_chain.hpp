#pragma once

#include <cstdint>
#include <memory>
#include <string>
#include <vector>

#include <sidestep/core/worker_pool.hpp>
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
  int starts = 1;  ///< Initial trajectories: the given one, and that plus samples of the GP prior.
  double spread = 1.0;                ///< What the samples are multiplied with.
  std::string accept = "best_valid";  ///< Or "first_valid", of several starts.
  bool incremental = false;           ///< A solve leads on from the last one where it can.

  [[nodiscard]] std::vector<OptionMistake> check() const;

  static Parameters<GpChainSettings> parameters();
};

/// The rule that `settings.method` names.
[[nodiscard]] std::unique_ptr<StepRule> make_step_rule(const GpChainSettings& settings);

/// GPMP2's problem solved by the structure of its chain: see README.md. Several starts share the
/// threads of `workers`, or go one after the other where it is null; `seed` is of their samples.
[[nodiscard]] std::unique_ptr<Optimiser> make_gp_chain(const GpChainSettings& settings,
                                                       WorkerPool* workers = nullptr,
                                                       std::uint64_t seed = 1);

}  // namespace sidestep
