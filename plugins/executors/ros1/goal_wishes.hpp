#pragma once

#include <map>
#include <memory>
#include <string>

#include <Eigen/Core>

#include <sidestep/core/error.hpp>
#include <sidestep/core/node.hpp>
#include <sidestep/robot/robot_model.hpp>

#include "conversions.hpp"
#include "options.hpp"

namespace sidestep::ros1_executor {

/// Turns what messages say of where the robot is to be into wishes as a GoalRequest has them.
/// Failures are kInvalidArgument, with the topic and what is wrong. What depends on the robot
/// alone, its joints' names and limits and its named poses, is left to whoever reads the wish.
/// [any]
class GoalWishes {
 public:
  /// `options` with goals. Fails with kConfig where the robot lacks the link of `goals`; has the
  /// joints of `odometry`, as JointFeed has found.
  [[nodiscard]] static Result<GoalWishes> create(std::shared_ptr<const RobotModel> robot,
                                                 const Options& options);

  /// The base is to be at a pose of the world; the other joints stay. Of the turns that yaw may
  /// mean, the one nearest to `q_now`. Fails where the pose is not level or out of keep_in, and
  /// where there is no odometry.
  [[nodiscard]] Result<Node> base_pose(const Transform& T_world_goal,
                                       const Eigen::VectorXd& q_now) const;
  /// The link is to be at a pose of the world; where the robot stands then is free. The search for
  /// a posture begins with reach_seed().
  [[nodiscard]] Result<Node> end_effector(const Transform& T_world_goal,
                                          const Eigen::VectorXd& q_now) const;
  /// Positions by name; joints left out stay. Fails where a name stands there twice, lacks a
  /// position or has one that is not finite, and where the base would be out of keep_in.
  [[nodiscard]] Result<Node> joints(const ros_messages::JointState& message) const;
  /// A pose of the robot's profile. Fails where it takes the base out of keep_in.
  [[nodiscard]] Result<Node> named_pose(const std::string& name) const;

 private:
  using Positions = std::map<std::string, double>;
  GoalWishes() = default;
  [[nodiscard]] Result<void> check_box(const std::string& topic, const Positions& positions) const;
  /// The block `goal` of a wish.
  [[nodiscard]] static Node goal_block(const std::string& topic, const Positions& positions);
  [[nodiscard]] static Node state_wish(const std::string& topic, const Positions& positions);

  std::shared_ptr<const RobotModel> robot_;
  GoalOptions topics_;
  std::optional<OdometryOptions> odometry_;
  std::optional<KeepInBox> keep_in_;
  int link_ = -1;  ///< The end effector's.
  int yaw_ = -1;
};

}  // namespace sidestep::ros1_executor
