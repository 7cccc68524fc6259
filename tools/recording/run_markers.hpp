#pragma once

#include <span>

#include <sidestep/field/occupancy_bits.hpp>
#include <sidestep/geometry/scene.hpp>
#include <sidestep/robot/robot_model.hpp>
#include <sidestep/trajectory/trajectory.hpp>

#include "ros_messages.hpp"

/// What rviz draws of a run. Each message shows its topic anew: it begins with a marker that
/// deletes all others of the topic. Pure functions. [any]
namespace sidestep {

/// The collision spheres, in the frames of their links, with which rviz moves them.
[[nodiscard]] ros::MarkerArray sphere_markers(const RobotDescription& robot, ros::Time time);

/// All occupied voxels as cubes.
[[nodiscard]] ros::MarkerArray voxel_markers(const OccupancyBits& voxels, ros::Time time);

/// The objects that move, or those that do not, where they truly are at scene time `time_s`. A
/// half-space is drawn as a slab, 20 m a side and 1 cm thick.
[[nodiscard]] ros::MarkerArray object_markers(const Scene& scene, bool moving, double time_s,
                                              ros::Time time);

/// A motion to be drawn, as the way of the robot's base and of its tool.
struct DrawnMotion {
  std::string name;  ///< "followed", "refused": the first part of the markers' namespaces.
  const Trajectory& trajectory;
  ros::ColorRGBA base, tool;
};
[[nodiscard]] ros::MarkerArray path_markers(const RobotModel& robot,
                                            std::span<const DrawnMotion> motions, ros::Time time);

}  // namespace sidestep
