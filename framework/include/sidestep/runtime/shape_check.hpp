#pragma once

#include <memory>
#include <span>

#include <sidestep/geometry/scene.hpp>
#include <sidestep/mapping/occupancy_view.hpp>
#include <sidestep/planning/validity_check.hpp>

namespace sidestep {

/// Obstacles of the independent check: boxes of `resolution_m` around occupied voxels, or the
/// true scene at its times.
struct ShapeObstacles {
  double resolution_m = 0.0;
  std::vector<Eigen::Vector3d> occupied_centres_m;
  std::shared_ptr<const Scene> scene;  ///< May be null.
  double scene_time_s = 0.0;           ///< Scene time at the trajectory's time 0.
};

/// Centres of all occupied voxels of a view.
[[nodiscard]] std::vector<Eigen::Vector3d> occupied_centres(const OccupancyView& view);

struct ShapeCheckSettings {
  double max_step_m = 0.01;  ///< Largest motion of any point of the robot between checks.
  double speed_fraction = 1.0;
  double limit_tolerance = 1e-6;
};

/// The independent check: the collision shapes of the robot's URDF against occupied voxels or
/// the true scene, and against each other, with FCL, at steps no point of the robot moves
/// more than max_step_m between; distances, so that clearances are exact at the steps. Shares
/// no code with the planner's own check: its own limits, its own spheres-free geometry.
[[nodiscard]] Result<std::unique_ptr<ValidityCheck>> make_shape_check(
    std::shared_ptr<const RobotModel> robot, ShapeObstacles obstacles, ShapeCheckSettings settings);

}  // namespace sidestep
