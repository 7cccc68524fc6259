#pragma once

#include <filesystem>
#include <vector>

#include <sidestep/problems/problem_set.hpp>

namespace sidestep {

/// Whether a folder holds problems as MotionBenchMaker writes them: request0001.yaml and so on.
[[nodiscard]] bool holds_moveit_problems(const std::filesystem::path& folder);

/// Reads a family of problems as MotionBenchMaker writes them, one of each moveit_msgs message a
/// file: scene0001.yaml (PlanningScene) beside request0001.yaml (MotionPlanRequest), in order of
/// their numbers. The family has the folder's name, without "_ROBOT" at its end. Fails with
/// kNotFound or kIo, or with kConfig naming file, line and entry, also for what planning here
/// cannot do: attached objects, goals that are not one configuration, cones, planes, octomaps.
/// [any]
[[nodiscard]] Result<std::vector<SetProblem>> read_moveit_family(
    const std::filesystem::path& folder, const RobotDescription& robot);

}  // namespace sidestep
