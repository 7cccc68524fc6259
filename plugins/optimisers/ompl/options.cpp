#include "options.hpp"

namespace sidestep::ompl_optimiser {

Parameters<Options> Options::parameters() {
  return Parameters<Options>()
      .add("planner", &Options::planner, "The planner of OMPL that searches.",
           {.choices = {"RRTConnect", "RRTstar", "BITstar", "PRM"}})
      .add("max_time_s", &Options::max_time_s,
           "Gives up after this long, or at the caller's deadline if that is sooner.",
           {.unit = "s", .min = 0.001})
      .add("max_iterations", &Options::max_iterations,
           "Gives up after this many iterations of the planner.", {.min = 1})
      .add("optimise_iterations", &Options::optimise_iterations,
           "RRTstar and BITstar go on improving their path until this many iterations.", {.min = 1})
      .add("range_s", &Options::range_s,
           "Longest extension of a tree, as the time it takes at full speed; 0 lets OMPL choose.",
           {.unit = "s", .min = 0.0})
      .add("resolution_m", &Options::resolution_m,
           "A motion that is not shown clear before no sphere moves more than this between two "
           "checks counts as blocked.",
           {.unit = "m", .min = 1e-4})
      .add("simplify", &Options::simplify, "Shorten the path before it is timed.");
}

}  // namespace sidestep::ompl_optimiser
