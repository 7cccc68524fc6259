#include "ompl_optimiser.hpp"

#include <cmath>
#include <map>
#include <utility>

#include "planners.hpp"

namespace sidestep::ompl_optimiser {

Parameters<Options> Options::parameters() {
  return joint_paths::path_parameters<Options>()
      .add("planner", &Options::planner, "The planner of OMPL that searches.",
           {.choices = planner_names()})
      .add("parameters", &Options::planner_parameters,
           "Parameters of the planner by OMPL's own names, as {samples_per_batch: 200}.")
      .add("metric", &Options::metric,
           "How far apart configurations are, joint by joint: by the `time` that it takes at full "
           "speed, or by the `motion` of the robot's farthest point at its fastest.",
           {.choices = {"time", "motion"}})
      .add("weights", &Options::weights,
           "Weights of joints in place of those of the metric, as {odom_t: 0.5}, in s per m or "
           "rad.")
      .add("max_iterations", &Options::max_iterations,
           "Gives up after this many iterations of the planner.", {.min = 1})
      .add("optimise_iterations", &Options::optimise_iterations,
           "Planners that improve their path (RRTstar, BITstar, ...) go on until this many "
           "iterations.",
           {.min = 1})
      .add("range_s", &Options::range_s,
           "Longest extension of a tree, as the time it takes at full speed; 0 lets OMPL choose.",
           {.unit = "s", .min = 0.0})
      .add("simplify", &Options::simplify, "Shorten the path before it is timed.")
      .add("simplify_rounds", &Options::simplify_rounds,
           "Rounds of shortening, at most; it ends where one has changed nothing.", {.min = 1})
      .add("simplify_tries", &Options::simplify_tries,
           "Short cuts that are tried in a round, and vertices that are left out: so many each.",
           {.min = 1})
      .add("objective", &Options::objective,
           "What planners that improve their path minimise: its `length` in seconds at full speed, "
           "how near it comes to obstacles (`clearance`), or the weighted sum of both.",
           {.choices = {"length", "clearance", "length_and_clearance"}})
      .add("clearance_m", &Options::clearance_m,
           "Beyond this distance from the nearest sphere an obstacle costs nothing.",
           {.unit = "m", .min = 1e-3, .max = 10.0})
      .add("clearance_weight", &Options::clearance_weight,
           "How many times its length a path along an obstacle costs beyond that.",
           {.min = 0.0, .max = 1e6});
}

namespace {

void check_weights(const Node& weights, std::vector<OptionMistake>& mistakes) {
  if (weights.is_null()) return;
  if (!weights.is_map()) {
    mistakes.push_back({{"weights"}, "must be a map of joints", {}});
    return;
  }
  for (const Node::Entry& entry : weights.entries()) {
    const auto weight = entry.value.as_double();
    if (weight && *weight > 0.0 && std::isfinite(*weight)) continue;
    mistakes.push_back({{"weights." + entry.key}, "must be a number greater than 0", {}});
  }
}

}  // namespace

std::vector<OptionMistake> Options::check() const {
  std::vector<OptionMistake> mistakes;
  check_weights(weights, mistakes);
  if (planner_parameters.is_null()) return mistakes;
  if (!planner_parameters.is_map()) {
    mistakes.push_back({{"parameters"}, "must be a map of the planner's parameters", {}});
    return mistakes;
  }
  const std::map<std::string, std::string> known = parameters_of(planner);
  std::vector<std::string> names;
  std::string list;
  for (const auto& [name, value] : known) {
    names.push_back(name);
    list += (list.empty() ? "" : ", ") + name + " (" + value + ")";
  }
  for (const Node::Entry& entry : planner_parameters.entries()) {
    const std::string path = "parameters." + entry.key;
    if (!known.contains(entry.key)) {
      const std::string nearest = nearest_name(entry.key, names);
      mistakes.push_back({{path},
                          "is no parameter of " + planner,
                          (nearest.empty() ? "" : "did you mean '" + nearest + "'? ") +
                              (list.empty() ? planner + " has none"
                                            : planner + " has, with their defaults: " + list)});
    } else if (!entry.value.is_scalar()) {
      mistakes.push_back({{path}, "must be one value, not " + entry.value.kind(), {}});
    } else if (std::string wrong = try_parameter(planner, entry.key, entry.value.text());
               !wrong.empty()) {
      mistakes.push_back({{path}, std::move(wrong), {}});
    }
  }
  return mistakes;
}

}  // namespace sidestep::ompl_optimiser
