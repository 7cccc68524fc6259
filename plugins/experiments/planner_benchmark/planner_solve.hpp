#pragma once

#include <cstdint>
#include <memory>
#include <stop_token>

#include <sidestep/problems/problem_set.hpp>
#include <sidestep/runtime/planning_race.hpp>
#include <sidestep/runtime/planning_settings.hpp>
#include "planner_rows.hpp"

namespace sidestep {

/// What every problem of a set is solved with.
struct SetBench {
  std::shared_ptr<const RobotModel> robot;
  PlanningSettings planning;
  CheckSettings check;
  double reach_m = 0.0;  ///< How far the known world reaches from the robot's foot.
  double deadline_s = 0.0;
  std::stop_token stop;
};

/// Poses a problem, has it raced for, and holds every answer against the shapes, independently.
/// In the race proposals are checked by the robot's spheres, or, for what is planned `by_shapes`
/// and may come nearer than they can, by its shapes. SetSolve::problem and seed are the caller's.
/// Fails where a planner or a check does. [planning]
[[nodiscard]] Result<SetSolve> solve_set_problem(PlanningRace& race, const SetProblem& posed,
                                                 std::uint64_t seed, const SetBench& bench,
                                                 bool by_shapes = false);

}  // namespace sidestep
