#pragma once

#include <memory>
#include <string>

#include "conformance/test_host.hpp"
#include "ompl_optimiser.hpp"
#include "rrt_connect.hpp"

namespace sidestep::joint_paths {

inline constexpr int kMostSamples = 5000;

/// rrt_connect, or else a planner of OMPL by its name; `samples` end it, rather than time.
inline std::unique_ptr<Optimiser> make_planner(const std::string& planner,
                                               const std::string& checker, std::uint64_t seed,
                                               Log& log, int samples = kMostSamples) {
  if (planner == "rrt_connect") {
    rrt_connect::Options options;
    options.checker = checker;
    options.max_time_s = 300.0;
    options.max_samples = 100 * samples;
    return rrt_connect::make_rrt_connect(options, seed, log);
  }
  ompl_optimiser::Options options;
  options.planner = planner;
  options.checker = checker;
  options.max_time_s = 300.0;
  options.max_iterations = samples;
  options.optimise_iterations = 300;
  return ompl_optimiser::make_ompl_optimiser(options, seed, log);
}

}  // namespace sidestep::joint_paths
