#pragma once

#include <cstdint>
#include <memory>
#include <string>
#include <utility>
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

/// Declares the settings that every way of solving these problems has.
template <class S>
[[nodiscard]] Parameters<S> declare_minimisation(Parameters<S> parameters, double most_starts) {
  return std::move(parameters)
      .add("relative_tolerance", &S::relative_tolerance,
           "Stop when an accepted step lowers the cost by less than this share of it.",
           {.min = 0.0, .max = 1.0})
      .add("absolute_tolerance", &S::absolute_tolerance,
           "Stop when an accepted step lowers the cost by less than this.", {.min = 0.0})
      .add("max_iterations", &S::max_iterations, "Stop after this many accepted steps.",
           {.min = 1.0, .max = 1e6})
      .add("initial_damping", &S::initial_damping,
           "Damping of the first step of Levenberg-Marquardt.", {.min = 1e-12, .max = 1e4})
      .add("starts", &S::starts,
           "Initial trajectories: the given one, and that plus samples of the GP prior.",
           {.min = 1.0, .max = most_starts})
      .add("spread", &S::spread, "What the samples are multiplied with.", {.min = 0.0})
      .add("accept", &S::accept,
           "Of several starts: the cheapest trajectory that is free of collisions, or the first.",
           {.choices = {"best_valid", "first_valid"}});
}

/// The rule that `settings.method` names.
[[nodiscard]] std::unique_ptr<StepRule> make_step_rule(const GpChainSettings& settings);

/// GPMP2's problem solved by the structure of its chain: see README.md. Several starts share the
/// threads of `workers`, or go one after the other where it is null; `seed` is of their samples.
[[nodiscard]] std::unique_ptr<Optimiser> make_gp_chain(const GpChainSettings& settings,
                                                       WorkerPool* workers = nullptr,
                                                       std::uint64_t seed = 1);

}  // namespace sidestep
