#include <memory>

#include <sidestep/plugin/plugin.hpp>

#include "stomp.hpp"

namespace sidestep {

Parameters<StompSettings> StompSettings::parameters() {
  using S = StompSettings;
  return Parameters<S>()
      .add("smoothness", &S::smoothness,
           "The derivative whose squares make the covariance of the noise and the smoothness cost.",
           {.choices = {"acceleration", "velocity"}})
      .add("smoothness_weight", &S::smoothness_weight,
           "Weight of the smoothness: half the integral of the squared derivative over the time of "
           "the motion taken as 1.",
           {.min = 0.0, .max = 1e9})
      .add("rollouts", &S::rollouts, "Noisy paths of an iteration, those that are reused included.",
           {.min = 1.0, .max = 10000.0})
      .add("reused", &S::reused, "How many of them are the best of earlier iterations.",
           {.min = 0.0, .max = 10000.0})
      .add("noise_s", &S::noise_s,
           "Standard deviation of the noise where it is largest, as the time it takes a joint to "
           "move by it at its full speed.",
           {.unit = "s", .min = 1e-6, .max = 100.0})
      .add("noise_decay", &S::noise_decay, "What the noise is multiplied with every iteration.",
           {.min = 0.01, .max = 1.0})
      .add("sensitivity", &S::sensitivity,
           "h of the weights exp(-h (S - min S) / (max S - min S)) of the rollouts' costs.",
           {.min = 0.0, .max = 1000.0})
      .add("limit_margin", &S::limit_margin,
           "Waypoints keep this far from joint limits, in m or rad, as far as start and goal do.",
           {.min = 0.0, .max = 10.0})
      .add("relative_tolerance", &S::relative_tolerance,
           "Stop when `patience` iterations lowered the best objective by less than this share of "
           "it.",
           {.min = 0.0, .max = 1.0})
      .add("patience", &S::patience, "Iterations over which `relative_tolerance` applies.",
           {.min = 1.0, .max = 1e6})
      .add("max_iterations", &S::max_iterations, "Stop after this many iterations.",
           {.min = 1.0, .max = 1e6});
}

namespace {

Result<std::unique_ptr<Optimiser>> create(const StompSettings& settings,
                                          const HostContext& context) {
  return make_stomp(settings, &context.workers, context.seed);
}

}  // namespace
}  // namespace sidestep

SIDESTEP_PLUGIN(sidestep::Optimiser, sidestep::StompSettings, sidestep::create, "stomp", "0.1.0",
                "Stochastic trajectory optimisation without derivatives (STOMP)")
