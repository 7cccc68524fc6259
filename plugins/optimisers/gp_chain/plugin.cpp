#include <memory>

#include <sidestep/plugin/plugin.hpp>

#include "gp_chain.hpp"

namespace sidestep {

Parameters<GpChainSettings> GpChainSettings::parameters() {
  using S = GpChainSettings;
  return Parameters<S>()
      .add("method", &S::method, "How steps are chosen.",
           {.choices = {"levenberg_marquardt", "gauss_newton", "dogleg"}})
      .add("relative_tolerance", &S::relative_tolerance,
           "Stop when an accepted step lowers the cost by less than this share of it.",
           {.min = 0.0, .max = 1.0})
      .add("absolute_tolerance", &S::absolute_tolerance,
           "Stop when an accepted step lowers the cost by less than this.", {.min = 0.0})
      .add("max_iterations", &S::max_iterations, "Stop after this many accepted steps.",
           {.min = 1.0, .max = 1e6})
      .add("initial_damping", &S::initial_damping,
           "Damping of the first step of levenberg_marquardt.", {.min = 1e-12, .max = 1e4})
      .add("initial_radius", &S::initial_radius,
           "Radius of the first trust region of dogleg, in the units of the states.",
           {.min = 1e-6, .max = 1e6})
      .add("starts", &S::starts,
           "Initial trajectories: the given one, and that plus samples of the GP prior.",
           {.min = 1.0, .max = 1000.0})
      .add("spread", &S::spread, "What the samples are multiplied with.", {.min = 0.0})
      .add("accept", &S::accept,
           "Of several starts: the cheapest trajectory that is free of collisions, or the first.",
           {.choices = {"best_valid", "first_valid"}})
      .add("incremental", &S::incremental,
           "A solve that begins with the trajectory found last re-uses what is known of it.");
}

}  // namespace sidestep

namespace {

using namespace sidestep;

Result<std::unique_ptr<Optimiser>> create(const GpChainSettings& settings,
                                          const HostContext& context) {
  return make_gp_chain(settings, &context.workers, context.seed);
}

}  // namespace

SIDESTEP_PLUGIN(Optimiser, GpChainSettings, create, "gp_chain", "0.1.0",
                "GP trajectory optimisation (GPMP2) by the structure of its chain")
