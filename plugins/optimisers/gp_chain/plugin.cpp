#include <memory>

#include <sidestep/plugin/plugin.hpp>

#include "gp_chain.hpp"

namespace sidestep {

Parameters<GpChainSettings> GpChainSettings::parameters() {
  using S = GpChainSettings;
  return declare_minimisation(
             Parameters<S>().add("method", &S::method, "How steps are chosen.",
                                 {.choices = {"levenberg_marquardt", "gauss_newton", "dogleg"}}),
             1000.0)
      .add("initial_radius", &S::initial_radius,
           "Radius of the first trust region of dogleg, in the units of the states.",
           {.min = 1e-6, .max = 1e6})
      .add("incremental", &S::incremental,
           "A solve that begins with the trajectory found last re-uses what is known of it.")
      .add("base_prior", &S::base_prior,
           "Which velocities of a planar base the GP prior wants even: those along the world's "
           "axes, or those of its body in its own frame (SE(2), as GPMP2), so that arcs cost "
           "nothing.",
           {.choices = {"world", "body"}});
}

namespace {

Result<std::unique_ptr<Optimiser>> create(const GpChainSettings& settings,
                                          const HostContext& context) {
  return make_gp_chain(settings, &context.workers, context.seed);
}

}  // namespace
}  // namespace sidestep

SIDESTEP_PLUGIN(sidestep::Optimiser, sidestep::GpChainSettings, sidestep::create, "gp_chain",
                "0.1.0", "GP trajectory optimisation (GPMP2) by the structure of its chain")
