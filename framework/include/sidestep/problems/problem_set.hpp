#pragma once

#include <filesystem>
#include <memory>
#include <string>
#include <vector>

#include <Eigen/Core>

#include <sidestep/core/error.hpp>
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
/// folder of one as MotionBenchMaker writes it (moveit_problems.hpp), or a folder of either, in
/// order of names. What a set says of joints that the robot does not plan for is passed over; those
/// that it does may stand in any order. Fails with kNotFound, kIo, or kConfig, naming the file and
/// the entry. [any]
[[nodiscard]] Result<std::vector<SetProblem>> read_problem_set(const std::filesystem::path& from,
                                                               const RobotDescription& robot);

}  // namespace sidestep
