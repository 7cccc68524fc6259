#pragma once

#include <string>

#include <sidestep/plugin/parameters.hpp>

namespace sidestep::ompl_optimiser {

struct Options {
  std::string planner = "RRTConnect";
  double max_time_s = 5.0;
  int max_iterations = 200000;
  int optimise_iterations = 2000;
  double range_s = 0.0;
  double resolution_m = 0.005;
  bool simplify = true;

  static Parameters<Options> parameters();
};

}  // namespace sidestep::ompl_optimiser
