#pragma once

#include <map>
#include <memory>
#include <string>
#include <vector>

#include <sidestep/core/error.hpp>
#include <sidestep/robot/kinematic_tree.hpp>
#include <sidestep/trajectory/trajectory.hpp>

#include "node_messages.hpp"
#include "simulated_robot.hpp"

namespace sidestep::fake_hsr {

/// `tree` with joints that it keeps where they are made movable, behind those that it has. Fails
/// with kConfig where it has no such.
[[nodiscard]] Result<std::shared_ptr<const KinematicTree>> with_joints(
    const KinematicTree& tree, const std::vector<Joint>& joints);

/// What a message commands, on ROS's clock.
struct Command {
  Trajectory trajectory;  ///< In the group's order; empty: stop.
  Stamp start;
};

/// Joints that one controller moves, each within its limits. Stamps are ROS's.
class JointGroup {
 public:
  /// Commands are taken over `delay_s` after they came; `lag_s`: see SimulatedRobot.
  JointGroup(const RobotDescription& robot, const std::vector<std::string>& joints,
             const Eigen::VectorXd& q, Stamp now, double delay_s = 0.0, double lag_s = 0.0);

  /// Fails with kInvalidArgument, saying what is wrong with the command.
  [[nodiscard]] Result<void> follow(const ros_messages::JointTrajectory& message, Stamp now);
  /// Of joints along x and y and about z alone: the twist, in the frame that they move, for a
  /// quarter of a second; then they brake. On wheels, nothing goes sideways.
  void drive(const ros_messages::Twist& twist, Stamp now);
  void brake(Stamp now) { robot_.brake(later(now)); }
  /// Moves until the last whole millisecond before `now`, and writes positions and velocities to
  /// their places in the robot's order.
  void advance(Stamp now, RobotState& into);

  [[nodiscard]] const std::vector<std::string>& joints() const noexcept { return names_; }
  [[nodiscard]] const RobotState& state() const noexcept { return robot_.state(); }

 private:
  [[nodiscard]] Result<Command> read(const ros_messages::JointTrajectory& message, Stamp now) const;

  [[nodiscard]] Stamp later(Stamp now) const { return {now.ns + delay_ns_}; }

  std::vector<std::string> names_;
  std::vector<int> indices_;
  std::int64_t delay_ns_;
  bool rolls_;
  simulated::SimulatedRobot robot_;
};

}  // namespace sidestep::fake_hsr
