#pragma once

#include <limits>
#include <memory>
#include <string>
#include <vector>

#include <sidestep/mapping/occupancy_view.hpp>
#include <sidestep/planning/shape_obstacles.hpp>
#include <sidestep/planning/validity_check.hpp>

namespace sidestep {

/// Centres of all occupied voxels of a view.
[[nodiscard]] std::vector<Eigen::Vector3d> occupied_centres(const OccupancyView& view);

struct ShapeCheckSettings {
  double max_step_m = 0.01;  ///< Largest motion of any point of the robot between checks.
  double min_step_m = 5e-4;  ///< Steps get this short near obstacles before "unproven".
  double farthest_m = 0.5;   ///< Clearances are searched up to this; what is farther counts so.
  double speed_fraction = 1.0;
  /// Acceleration limits that must hold, where they are known; infinity checks none.
  double acceleration_fraction = std::numeric_limits<double>::infinity();
  double limit_tolerance = 1e-6;
  std::vector<AllowedContact> allowed_contacts;
};

/// The independent check: the collision shapes of the robot's URDF against occupied voxels (as
/// boxes), the floor and the true scene at its times, and against each other, with FCL. No point of
/// the robot moves more than max_step_m between two checks, nor more than the clearance found, so
/// that what passes is clear in between, too; where that would take steps below min_step_m the
/// outcome is kUnproven. Clearances are exact (to 1e-5 m) at the steps; a depth is that into a
/// single box or shape. Meshes are surfaces: what is wholly inside one does not touch it. Moving
/// objects may not jump (a repeated motion ends where it began).
///
/// Shares no code with the planner's own check: its own limits, its own bounds on motion, no
/// spheres. Fails with kInvalidArgument for a robot without collision shapes, for obstacles or
/// settings that make no sense, and for allowed contacts that name no link or object.
[[nodiscard]] Result<std::unique_ptr<ValidityCheck>> make_shape_check(
    std::shared_ptr<const RobotModel> robot, const ShapeObstacles& obstacles,
    ShapeCheckSettings settings);

}  // namespace sidestep
