#pragma once

#include <cstdint>
#include <filesystem>
#include <memory>
#include <vector>

#include <sidestep/core/log.hpp>
#include <sidestep/core/node.hpp>
#include <sidestep/core/time.hpp>
#include <sidestep/core/worker_pool.hpp>
#include <sidestep/geometry/scene.hpp>
#include <sidestep/robot/robot_model.hpp>
#include <sidestep/sensing/source.hpp>
#include <sidestep/trajectory/robot_motion.hpp>

namespace sidestep {

/// What the host lends to a plugin at creation. What the references refer to outlives the plugin's
/// objects; the context itself does not outlive create(): keep its members, not the context.
struct HostContext {
  Log& log;
  const Clock& clock;
  WorkerPool& workers;
  const DocumentReader& documents;
  std::uint64_t seed = 0;  ///< The plugin's own, derived from the run's.
  /// Folders in which profiles and scenes that are named rather than given by path are found.
  std::vector<std::filesystem::path> robot_paths;
  std::vector<std::filesystem::path> scene_paths;
  /// The robot of the run; for a cost, with what it carries in the plan; null while the robot
  /// itself is being created.
  std::shared_ptr<const RobotModel> robot;
  /// Where the robot of the run is; null in runs in which none moves.
  std::shared_ptr<RobotMotion> motion;
  /// What is truly there, at times of `clock`, in simulations that know it; null elsewhere.
  std::shared_ptr<const Scene> scene = nullptr;
  /// Who knows it as the run goes on: the run's first source; null elsewhere.
  GroundTruth* truth = nullptr;
};

}  // namespace sidestep
