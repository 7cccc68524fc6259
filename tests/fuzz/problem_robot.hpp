#pragma once

#include <cmath>

#include <sidestep/problems/problem_set.hpp>

#include "fuzzing.hpp"

namespace sidestep::fuzzing {

inline RobotDescription shoulder_and_elbow() {
  RobotDescription robot;
  robot.name = "arm";
  robot.joints.resize(2);
  robot.joints[0].name = "shoulder";
  robot.joints[1].name = "elbow";
  robot.links = {{"pedestal", -1}, {"arm", 0}};
  return robot;
}

inline void require_sound(const std::vector<SetProblem>& problems) {
  for (const SetProblem& problem : problems) {
    require(problem.q_start.size() == 2 && problem.q_start.allFinite(), "a start is finite");
    require(problem.q_goal.size() == 2 && problem.q_goal.allFinite(), "a goal is finite");
    require(!std::isnan(problem.scene->signed_distance({0.1, 0.2, 0.3}, 0.0).distance_m),
            "a distance is a number");
  }
}

}  // namespace sidestep::fuzzing
