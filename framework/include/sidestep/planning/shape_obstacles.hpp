#pragma once

#include <memory>
#include <optional>
#include <string>
#include <vector>

#include <Eigen/Core>

#include <sidestep/geometry/scene.hpp>
#include <sidestep/planning/problem.hpp>

namespace sidestep {

/// Obstacles for the collision shapes of a robot's URDF: boxes of `resolution_m` around occupied
/// voxels, the true scene at its times, or the floor.
struct ShapeObstacles {
  double resolution_m = 0.0;
  std::vector<Eigen::Vector3d> occupied_centres_m;
  bool voxels_in_octree = false;       ///< Keep them in an OctoMap instead of joining their boxes.
  std::shared_ptr<const Scene> scene;  ///< May be null.
  double scene_time_s = 0.0;           ///< Scene time at the trajectory's time 0.
  std::optional<Floor> floor;          ///< That the robot stands on, if any.
};

/// Centres of the voxels in which a map says that there is something: where an obstacle is nearer
/// than half a voxel, for those that are free are a whole one away, and where nothing is known if
/// that counts as occupied. [any]; allocates.
[[nodiscard]] SIDESTEP_EXPORT std::vector<Eigen::Vector3d> occupied_centres(
    const DistanceField& field, Space unknown);

/// A link that may touch an object of the scene, e.g. a wheel the floor.
struct AllowedContact {
  std::string link;
  std::string object;
};

}  // namespace sidestep
