#pragma once

#include <memory>

#include <sidestep/core/log.hpp>
#include <sidestep/planning/optimiser.hpp>
#include <sidestep/plugin/parameters.hpp>

namespace sidestep::tool_line {

struct Options {
  double step_m = 0.01;
  double step_rad = 0.05;
  double deviation_m = 5e-4;
  double deviation_rad = 5e-3;
  double most_jump = 0.3;

  static Parameters<Options> parameters();
};

/// Moves the link of the one end effector's goal that the problem has in a straight line to it, at
/// rest at both ends: it turns about one axis meanwhile, or not at all where its orientation is
/// left open. Obstacles are the checks' affair. `log` must outlive it. [planning]
[[nodiscard]] std::unique_ptr<Optimiser> make_tool_line(const Options& options, Log& log);

}  // namespace sidestep::tool_line
