#pragma once

#include <cstdint>
#include <memory>

#include "path_planner.hpp"

namespace sidestep::rrt_connect {

struct Options : joint_paths::PathOptions {
  int max_samples = 100'000'000;
  double range_m = 0.3;
  double least_lever_m = 0.1;
  double domain = 8.0;
  int shorten_tries = 60;

  static Parameters<Options> parameters();
};

/// RRT-Connect as an Optimiser. `log` must outlive it. [planning]
[[nodiscard]] std::unique_ptr<Optimiser> make_rrt_connect(const Options& options,
                                                          std::uint64_t seed, Log& log);

}  // namespace sidestep::rrt_connect
