#include <memory>

#include <sidestep/plugin/plugin.hpp>

#include "trajopt.hpp"

namespace sidestep {

Parameters<TrajoptSettings> TrajoptSettings::parameters() {
  using S = TrajoptSettings;
  return Parameters<S>()
      .add("smoothness", &S::smoothness, "The derivative whose squares are kept small.",
           {.choices = {"velocity", "acceleration"}})
      .add("smoothness_weight", &S::smoothness_weight,
           "Weight of the smoothness: half the integral of the squared derivative over the time of "
           "the motion taken as 1.",
           {.min = 1e-9, .max = 1e9})
      .add("keep_m", &S::keep_m,
           "Clearance that swept spheres are to keep, and no less than the problem's collision "
           "margin.",
           {.unit = "m", .min = 0.0, .max = 10.0})
      .add("reach_m", &S::reach_m, "Swept spheres of less clearance than this are modelled.",
           {.unit = "m", .min = 0.0, .max = 10.0})
      .add("initial_penalty", &S::initial_penalty,
           "What a sphere costs per metre that it lacks of `keep_m`, at first.",
           {.unit = "1/m", .min = 1e-6, .max = 1e9})
      .add("penalty_factor", &S::penalty_factor,
           "What the penalty is multiplied with while a sphere lacks more than `violation_m`.",
           {.min = 1.0, .max = 1e6})
      .add("max_penalties", &S::max_penalties, "How often it is multiplied.",
           {.min = 0.0, .max = 100.0})
      .add("trust_region", &S::trust_region,
           "How far a waypoint may move in the first program, in m or rad.",
           {.min = 1e-3, .max = 100.0})
      .add("limit_margin", &S::limit_margin,
           "Waypoints keep this far from joint limits, in m or rad, as far as start and goal do.",
           {.min = 0.0, .max = 10.0})
      .add("relative_tolerance", &S::relative_tolerance,
           "A penalty is settled when a step lowers the merit by less than this share of it.",
           {.min = 0.0, .max = 1.0})
      .add("violation_m", &S::violation_m, "What a sphere may lack of `keep_m` in the end.",
           {.unit = "m", .min = 0.0, .max = 1.0})
      .add("max_iterations", &S::max_iterations, "Stop after this many quadratic programs.",
           {.min = 1.0, .max = 1e6});
}

namespace {

Result<std::unique_ptr<Optimiser>> create(const TrajoptSettings& settings, const HostContext&) {
  return make_trajopt(settings);
}

}  // namespace
}  // namespace sidestep

SIDESTEP_PLUGIN(sidestep::Optimiser, sidestep::TrajoptSettings, sidestep::create, "trajopt",
                "0.1.0", "Sequential convex optimisation with swept collision (TrajOpt)")
