#pragma once

#include <chrono>
#include <memory>
#include <span>
#include <string>
#include <vector>

#include <ros/node_handle.h>

#include <sidestep/core/error.hpp>
#include <sidestep/core/scratch.hpp>
#include <sidestep/core/time.hpp>
#include <sidestep/field/occupancy_bits.hpp>
#include <sidestep/robot/robot_model.hpp>
#include <sidestep/trajectory/trajectory.hpp>

#include "node_messages.hpp"
#include "ros1_executor.hpp"

namespace sidestep::ros1_executor {

/// How a plan is shown.
enum class PlanState { kFollowed, kProposed };

/// Draws a robot and its plans for RViz. One thread at a time.
class MarkerPainter {
 public:
  /// `link`: whose path is drawn; empty: the last. Fails with kConfig where the robot has no such.
  [[nodiscard]] static Result<MarkerPainter> create(std::shared_ptr<const RobotModel> robot,
                                                    const std::string& link,
                                                    const std::string& frame);

  /// The spheres of the robot where it is, and of where the plan ends, and the link's path between.
  /// An empty plan removes what was shown of the last.
  [[nodiscard]] ros_messages::MarkerArray paint(const Eigen::VectorXd& q, const Trajectory& plan,
                                                double from_s, PlanState state, Stamp ros_stamp);

 private:
  MarkerPainter(std::shared_ptr<const RobotModel> robot, std::string frame);
  [[nodiscard]] ros_messages::Marker marker(const std::string& group, int id, int type,
                                            Stamp stamp) const;
  void add_spheres(const std::string& group, std::span<const double> q, Stamp stamp,
                   ros_messages::MarkerArray& into);
  void add_path(const Trajectory& plan, double from_s, PlanState state, Stamp stamp,
                ros_messages::MarkerArray& into);

  std::shared_ptr<const RobotModel> robot_;
  std::string frame_;
  int link_ = 0;
  std::vector<Eigen::Vector3d> centres_m_;
  std::vector<Transform> T_world_link_;
  Scratch scratch_;
};

// What RViz draws of a map, in the world's frame. Each array shows its topic anew. Pure functions.
// [any]

/// At most so many squares along either side of a slice.
inline constexpr int kMostSliceSquares = 128;

/// The occupied voxels as cubes, coloured by height.
[[nodiscard]] ros_messages::MarkerArray voxel_markers(const OccupancyBits& voxels,
                                                      const std::string& frame, ::ros::Time stamp);

/// The distances at height `height_m`, which is moved into the grid, as squares of a voxel's width,
/// or of several voxels' where the grid is large: red at 0 and below, over yellow and green to blue
/// where distances are cut off. Where nothing was observed there are none.
[[nodiscard]] ros_messages::MarkerArray slice_markers(const DistanceField& field, double height_m,
                                                      const std::string& frame, ::ros::Time stamp);

/// The topics on which RViz sees the map. One thread at a time, which may be another than the
/// executor's.
class MapView {
 public:
  /// The process is a node of ROS. `frame`: the world's.
  MapView(const MapMarkerOptions& options, std::string frame);

  /// Whether a picture is due, and somebody sees one of them.
  [[nodiscard]] bool is_wanted() const;
  /// Publishes what is seen; without subscribers, nothing is computed.
  void show(std::shared_ptr<const DistanceField> field);

 private:
  using SteadyClock = std::chrono::steady_clock;

  MapMarkerOptions options_;
  std::string frame_;
  SteadyClock::time_point next_ = SteadyClock::time_point::min();
  OccupancyBits voxels_;
  ::ros::NodeHandle node_;
  ::ros::Publisher voxel_topic_;
  ::ros::Publisher slice_topic_;
};

}  // namespace sidestep::ros1_executor
