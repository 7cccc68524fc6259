#pragma once

#include <optional>

#include <sidestep/robot/robot_model.hpp>
#include <sidestep/runtime/planning_settings.hpp>

namespace sidestep {

/// The floor at height 0 that a robot with a driving base stands on: one that two joints slide
/// along the plane and one turns without end about the vertical, at its root, whether they are
/// planned or held. It is not there for the links whose height no planned joint changes: those
/// stand on it. Nothing for other robots, and those of which every sphere and shape keeps its
/// height.
[[nodiscard]] std::optional<Floor> standing_floor(const RobotModel& robot);

/// Takes that floor where `planning.floor` is left out; and leaves out of any floor the links that
/// only lifts along the vertical lower, and never as far as to it (Floor::clear_links).
void stand_on_floor(PlanningSettings& planning, const RobotModel& robot);

}  // namespace sidestep
