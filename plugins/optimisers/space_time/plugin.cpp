#include <memory>

#include <sidestep/plugin/plugin.hpp>

#include "space_time.hpp"

namespace sidestep {

Parameters<SpaceTimeSettings> SpaceTimeSettings::parameters() {
  using S = SpaceTimeSettings;
  return Parameters<S>()
      .add("directions", &S::directions, "Directions of half and of full speed that steps lead to.",
           {.min = 4, .max = 64})
      .add("step_s", &S::step_s,
           "Duration of a step; longer where the limits need longer for half of the speed, and "
           "halved, twice, where nothing is found.",
           {.unit = "s", .min = 0.01, .max = 10.0})
      .add(
          "cell_m", &S::cell_m,
          "Places nearer to each other than this, or than 0.3 of a step's way at full speed, count "
          "as one.",
          {.unit = "m", .min = 1e-3, .max = 10.0})
      .add("extra_margin_m", &S::extra_margin_m,
           "Kept beyond the problem's margins where the robot is looked at: so much nearer may "
           "something come before the next look.",
           {.unit = "m", .min = 1e-3, .max = 1.0})
      .add("greed", &S::greed,
           "Weight of the time that is left to the goal: more finds a motion sooner, which takes "
           "at most so many times that of the fastest.",
           {.min = 1.0, .max = 10.0})
      .add("max_nodes", &S::max_nodes, "Each search ends after so many.", {.min = 1, .max = 1e7});
}

namespace {

Result<std::unique_ptr<Optimiser>> create(const SpaceTimeSettings& settings, const HostContext&) {
  return make_space_time(settings);
}

}  // namespace
}  // namespace sidestep

SIDESTEP_PLUGIN(sidestep::Optimiser, sidestep::SpaceTimeSettings, sidestep::create, "space_time",
                "0.1.0", "Search of place, velocity and time for a base among what moves")
