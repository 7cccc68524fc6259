#pragma once

#include <cstdint>
#include <memory>
#include <string>
#include <vector>

#include "path_planner.hpp"
#include "search.hpp"

namespace sidestep::ompl_optimiser {

struct Options : joint_paths::PathOptions {
  Options() = default;  // g++ 12 warns of aggregates with a base
  std::string planner = "RRTConnect";
  Node planner_parameters;
  std::string metric = "time";
  Node weights;
  int max_iterations = 200000;
  int optimise_iterations = 2000;
  double range_s = 0.0;
  bool simplify = true;
  int simplify_rounds = 3;
  int simplify_tries = 30;
  std::string objective = "length";
  double clearance_m = 0.1;
  double clearance_weight = 10.0;

  [[nodiscard]] JointMetric joint_metric() const { return {metric, weights}; }

  static Parameters<Options> parameters();
  [[nodiscard]] std::vector<OptionMistake> check() const;
};

/// A sampling-based planner of OMPL as an Optimiser. `log` must outlive it. [planning]
[[nodiscard]] std::unique_ptr<Optimiser> make_ompl_optimiser(const Options& options,
                                                             std::uint64_t seed, Log& log);

}  // namespace sidestep::ompl_optimiser
