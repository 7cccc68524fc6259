#pragma once

#include <memory>

#include <sidestep/robot/robot_model.hpp>

#include "json_entry.hpp"

namespace sidestep {

/// The robot of a file of recorded problems.
struct RecordedRobot {
  std::shared_ptr<const RobotModel> model;  ///< Null where the file has an error.
  bool has_base = false;  ///< Its first three joints are x, y and heading of a mobile base.
};

/// Reads `robot`; `dof` is the size of the recorded configurations. Without `dh` it is a point that
/// moves along the first axes of the world.
[[nodiscard]] Result<RecordedRobot> read_recorded_robot(const JsonEntry& robot, int dof);

}  // namespace sidestep
