#pragma once

#include <filesystem>
#include <memory>
#include <string>
#include <vector>

#include <Eigen/Core>

#include <sidestep/core/error.hpp>
#include <sidestep/core/node.hpp>
#include <sidestep/geometry/scene.hpp>
#include <sidestep/robot/robot_model.hpp>

namespace sidestep {

/// A motion from one configuration to another among shapes that stand still, all known exactly.
struct SetProblem {
  std::string family;  ///< E.g. "bookshelf_small".
  int index = 0;       ///< Within the family, as the set counts.
  Eigen::VectorXd q_start;
  Eigen::VectorXd q_goal;
  std::shared_ptr<const Scene> scene;
};

/// Reads a problem set for a robot (docs/reference/problem_sets.md): a JSON file of one family, a
/// folder of one as MotionBenchMaker writes it (holds_moveit_problems()), or a folder of either, in
/// order of names. What a set says of joints that the robot does not plan for is passed over; those
/// that it does may stand in any order. Fails with kNotFound, kIo, or kConfig, naming the file and
/// the entry. [any]
[[nodiscard]] Result<std::vector<SetProblem>> read_problem_set(const std::filesystem::path& from,
                                                               const RobotDescription& robot);

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

/// What a robot carries, fixed to a link.
struct CarriedObject {
  std::string name;
  std::string link;
  std::vector<std::string> touch_links;  ///< That it may touch, besides its own.
  std::vector<CollisionShape> shapes;    ///< In the link's frame; their `link` says nothing.
};

struct PlanningScene {
  Scene world;
  std::vector<CarriedObject> attached;
};

/// A moveit_msgs PlanningScene, as YAML, in the frame of the robot's root. `folder`: that its
/// meshes are named from. Fails with kConfig naming file, line and entry, also for what would be
/// left out: cones, planes, octomaps, attached objects that are not in their link's frame. [any]
[[nodiscard]] Result<PlanningScene> read_moveit_scene(const Node& message,
                                                      const std::filesystem::path& folder,
                                                      const RobotDescription& robot);

}  // namespace sidestep
