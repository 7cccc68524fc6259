#pragma once

#include <optional>
#include <span>
#include <string>

#include <sidestep/field/occupancy_bits.hpp>
#include <sidestep/geometry/scene.hpp>
#include <sidestep/robot/robot_model.hpp>
#include <sidestep/sensing/frame.hpp>
#include <sidestep/trajectory/trajectory.hpp>

#include "ros_messages.hpp"

/// What a run tells, as ROS messages. Pure functions. [any]
namespace sidestep {

inline constexpr const char* kWorldFrame = "world";

/// The run's clock is this much behind that of a recording, for ROS takes 0 for "no time".
inline constexpr Stamp kRosEpoch{1'000'000'000};

/// A stamp on a clock whose zero is `epoch` in ROS's time. Before the first nanosecond and after
/// the last second that ROS can tell: these.
[[nodiscard]] ros::Time ros_time(Stamp stamp, Stamp epoch = kRosEpoch) noexcept;
/// The other way round.
[[nodiscard]] Stamp run_stamp(ros::Time time, Stamp epoch = kRosEpoch) noexcept;

[[nodiscard]] ros::Transform ros_transform(const Transform& transform);
[[nodiscard]] ros::Pose ros_pose(const Transform& T_frame_object);

/// In mm (16UC1) where no depth loses by that, else in m (32FC1). No measurement: 0 and NaN.
[[nodiscard]] ros::Image depth_image(const DepthImage& depth, const ros::Header& header);
[[nodiscard]] ros::CameraInfo camera_info(const CameraIntrinsics& camera,
                                          const ros::Header& header);
[[nodiscard]] ros::PointCloud2 point_cloud(const PointCloud& cloud, const ros::Header& header);

/// All links, each in its parent's frame, the root in the world; links of the world's own name are
/// the world. T_world_link: links.size().
[[nodiscard]] ros::TFMessage link_transforms(const RobotDescription& robot,
                                             std::span<const Transform> T_world_link,
                                             ros::Time time);

/// Positions only. q: dof().
[[nodiscard]] ros::JointState joint_state(const RobotDescription& robot, std::span<const double> q,
                                          ros::Time time);

/// Its time 0 is the stamp of its header.
[[nodiscard]] ros::JointTrajectory joint_trajectory(const RobotDescription& robot,
                                                    const Trajectory& trajectory, ros::Time start);

/// Bytes that mean nothing to ROS.
[[nodiscard]] ros::UInt8MultiArray byte_array(std::span<const std::byte> bytes);

// What rviz draws of a run. Each message shows its topic anew: it begins with a marker that
// deletes all others of the topic. Pure functions. [any]

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
