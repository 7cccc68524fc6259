#pragma once

#include <memory>

#include <sidestep/planning/optimiser.hpp>
#include <sidestep/plugin/parameters.hpp>

namespace sidestep {

struct SpaceTimeSettings {
  int directions = 16;           ///< Of each speed.
  double step_s = 1.0;           ///< Duration of a step.
  double cell_m = 0.3;           ///< Places nearer to each other than this count as one.
  double extra_margin_m = 0.02;  ///< Beyond the problem's margins, for what is between two looks.
  double greed = 1.15;           ///< Weight of the time that is left.
  int max_nodes = 3000;          ///< Of each search.

  static Parameters<SpaceTimeSettings> parameters();
};

/// Searches place, velocity and time for the motion of a robot's base that is first at the goal,
/// clear of the field and of what is predicted: best first, each node with the time of the straight
/// way from it to the goal, which is exact where that way is free. The base is the robot's first
/// two prismatic joints; the others go straight to their goal. Steps change the velocity evenly,
/// within the limits, so that the result is timed. It starts at any velocity and ends at rest.
[[nodiscard]] std::unique_ptr<Optimiser> make_space_time(const SpaceTimeSettings& settings);

}  // namespace sidestep
