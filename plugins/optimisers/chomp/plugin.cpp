#include <memory>

#include <sidestep/plugin/plugin.hpp>

#include "chomp.hpp"

namespace sidestep {

Parameters<ChompSettings> ChompSettings::parameters() {
  using S = ChompSettings;
  return Parameters<S>()
      .add("smoothness", &S::smoothness,
           "The derivative whose squares make the metric and the smoothness cost.",
           {.choices = {"acceleration", "velocity"}})
      .add("smoothness_weight", &S::smoothness_weight,
           "Weight of the smoothness: half the integral of the squared derivative over the time of "
           "the motion taken as 1.",
           {.min = 1e-9, .max = 1e9})
      .add("obstacle_weight", &S::obstacle_weight, "Weight of the obstacle functional.",
           {.unit = "1/m^2", .min = 0.0, .max = 1e12})
      .add(
          "epsilon_m", &S::epsilon_m,
          "Obstacles and the floor are felt this far from a sphere, and no less than the problem's "
          "collision margin.",
          {.unit = "m", .min = 1e-4, .max = 10.0})
      .add("learning_rate", &S::learning_rate,
           "Length of the first and the longest step, 1 / eta; halved where it does not lower the "
           "objective.",
           {.min = 1e-6, .max = 2.0})
      .add("limit_margin", &S::limit_margin,
           "Waypoints keep this far from joint limits, in m or rad, as far as start and goal do.",
           {.min = 0.0, .max = 10.0})
      .add("relative_tolerance", &S::relative_tolerance,
           "Stop when `patience` accepted iterations lowered the objective by less than this share "
           "of it.",
           {.min = 0.0, .max = 1.0})
      .add("patience", &S::patience, "Iterations over which `relative_tolerance` applies.",
           {.min = 1.0, .max = 1e6})
      .add("max_iterations", &S::max_iterations, "Stop after this many iterations.",
           {.min = 1.0, .max = 1e6});
}

namespace {

Result<std::unique_ptr<Optimiser>> create(const ChompSettings& settings, const HostContext&) {
  return make_chomp(settings);
}

}  // namespace
}  // namespace sidestep

SIDESTEP_PLUGIN(sidestep::Optimiser, sidestep::ChompSettings, sidestep::create, "chomp", "0.1.0",
                "Covariant gradient descent with an obstacle functional (CHOMP)")
