#pragma once

#include <cstdint>
#include <memory>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include <sidestep/core/worker_pool.hpp>
#include <sidestep/planning/optimiser.hpp>
#include <sidestep/planning/validity_check.hpp>
#include <sidestep/plugin/parameters.hpp>

#include "minimise.hpp"
#include "stopping_rules.hpp"

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
  std::string base_prior = "world";   ///< Or "body": which velocities of a planar base it is on.

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

/// Writes how a minimisation ended into a solution: iterations, status and reason. `cost`: what it
/// came to.
void conclude(const Minimisation& end, const StoppingRules& stop, double cost,
              const Deadline& deadline, Solution& solution);

/// Writes that the initial trajectory's cost is no number, and of which of solution.terms.
void name_broken_term(Solution& solution);

/// `costs`: of the GP prior, then of each term of the problem.
[[nodiscard]] std::vector<TermCost> name_terms(const Problem& problem,
                                               std::span<const double> costs);

/// Which of several trajectories are valid: free of collisions, within the limits of positions, at
/// the goal. How fast they are may still be changed.
class Judge {
 public:
  /// `checks`: of the problem's robot; outlives it, as does the problem.
  Judge(const Problem& problem, const FieldChecks& checks);

  /// False where the deadline passes before it is known.
  [[nodiscard]] bool accepts(const Trajectory& found, const Deadline& deadline) const;

 private:
  const Problem& problem_;
  std::unique_ptr<ValidityCheck> check_;
};

}  // namespace sidestep
