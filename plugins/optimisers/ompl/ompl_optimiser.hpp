#pragma once

#include <cstdint>
#include <memory>
#include <string>
#include <vector>

#include <sidestep/core/log.hpp>
#include <sidestep/planning/optimiser.hpp>
#include <sidestep/plugin/parameters.hpp>

#include "search.hpp"

namespace sidestep::ompl_optimiser {

struct Options {
  std::string planner = "RRTConnect";
  Node planner_parameters;
  std::string checker = "field";
  std::string metric = "time";
  Node weights;
  bool any_turn = false;
  double max_time_s = 5.0;
  int max_iterations = 200000;
  int optimise_iterations = 2000;
  double range_s = 0.0;
  double resolution_m = 0.005;
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
