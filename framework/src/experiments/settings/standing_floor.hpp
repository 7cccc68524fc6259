#pragma once

#include <optional>
#include <string>

#include <sidestep/experiments/planning_settings.hpp>
#include <sidestep/robot/robot_model.hpp>

#include "settings/task_settings.hpp"

namespace sidestep {

/// The floor at height 0 that a robot with a driving base stands on: one that two planned joints
/// slide along the plane and one turns without end about the vertical, at its root. It is not there
/// for the links whose height no planned joint changes: those stand on it. Nothing for other
/// robots, and those of which every sphere and shape keeps its height.
[[nodiscard]] std::optional<Floor> standing_floor(const RobotModel& robot);

/// Takes that floor where `planning.floor` is left out.
void stand_on_floor(PlanningSettings& planning, const RobotModel& robot);

/// Whether the link that a task sends somewhere is to be below the floor, e.g. "hand_palm_link is
/// to be 0.030 m below the floor"; empty if not.
[[nodiscard]] std::string target_below_floor(const Task& task,
                                             const std::optional<FloorEntry>& floor);

}  // namespace sidestep
