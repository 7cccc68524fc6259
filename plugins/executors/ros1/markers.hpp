#pragma once

#include <memory>
#include <span>
#include <string>
#include <vector>

#include <sidestep/core/error.hpp>
#include <sidestep/core/scratch.hpp>
#include <sidestep/core/time.hpp>
#include <sidestep/robot/robot_model.hpp>
#include <sidestep/trajectory/trajectory.hpp>

#include "node_messages.hpp"

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

}  // namespace sidestep::ros1_executor
