#pragma once

#include <filesystem>
#include <vector>

#include <sidestep/geometry/scene.hpp>
#include <sidestep/problems/problem_set.hpp>

#include "document_entry.hpp"

namespace sidestep {

/// The objects of a moveit_msgs PlanningScene's world, in the frame of the robot's root. Complains
/// about what the scene has besides and nobody would hear: changes, padding, unknown keys.
[[nodiscard]] std::vector<SceneObject> read_world(const DocumentEntry& scene,
                                                  const RobotDescription& robot,
                                                  const std::filesystem::path& folder);

/// Complains about a moveit_msgs RobotState that has unknown keys, or whose root is elsewhere than
/// in the planning frame's origin.
void check_robot_state(const DocumentEntry& state);

}  // namespace sidestep
