#pragma once

#include <map>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include <ros/callback_queue.h>
#include <ros/node_handle.h>

#include <sidestep/core/error.hpp>
#include <sidestep/robot/robot_model.hpp>
#include <sidestep/trajectory/trajectory.hpp>

#include "any_message.hpp"
#include "histories.hpp"
#include "node.hpp"
#include "node_messages.hpp"
#include "ros1_executor.hpp"

namespace sidestep::ros1_executor {

/// Of a base in its plane: x and y in m, yaw in rad, and how fast they change, in the world's
/// frame.
struct PlanarMotion {
  Eigen::Vector3d pose;
  Eigen::Vector3d velocity;
};
/// Nothing where the message's figures are no rigid transform. `is_twist_in_base`: its twist is in
/// the base's frame, not the world's. [any]
[[nodiscard]] std::optional<PlanarMotion> planar_motion_of(const ros_messages::Odometry& message,
                                                           bool is_twist_in_base);

/// A robot's state, from messages that tell of some joints each, at stamps of their own. All stamps
/// are ROS's. One thread at a time.
class JointFeed {
 public:
  /// Fails with kConfig where the robot lacks a joint that odometry is to tell of.
  [[nodiscard]] static Result<JointFeed> create(const RobotDescription& robot,
                                                const Options& options);

  /// Joints that are not the robot's are passed over, but for those that are held. A value that is
  /// not a number says nothing. `received`: ROS time.
  void add(const ros_messages::JointState& message, Stamp received);
  void add(const ros_messages::Odometry& message, Stamp received);

  struct State {
    RobotState state;
    Stamp stamp;
  };
  /// At the newest time at which all joints are known: that of the joint whose newest position is
  /// oldest, the others interpolated to it. Nothing until each has been told of.
  [[nodiscard]] std::optional<State> newest() const;

  /// What is wrong: no message yet, one too old, or stamped ahead of the clock; nothing if all is
  /// well.
  [[nodiscard]] std::optional<std::string> trouble(Stamp now) const;

  /// Of a joint that is held; nothing until it is told.
  [[nodiscard]] std::optional<double> held_position(const std::string& joint) const;

 private:
  struct Motion {
    double q = 0.0;
    std::optional<double> qdot;  ///< Nothing: not told.
  };
  /// What one kind of message tells.
  struct Origin {
    std::string name;    ///< "joint state", "odometry"
    std::string topics;  ///< For messages.
    double max_age_s = 0.0;
    std::optional<Stamp> received;
  };
  struct Channel {
    std::string joint;
    bool is_continuous = false;
    bool is_odometry = false;
    ros_messages::TimeSeries<Motion> series;
  };
  JointFeed() = default;

  [[nodiscard]] const Origin& origin_of(const Channel& channel) const {
    return channel.is_odometry ? odometry_ : joint_states_;
  }
  void add(Channel& channel, Stamp stamp, double q, std::optional<double> qdot);
  [[nodiscard]] std::optional<std::string> trouble_of(const Channel& channel, Stamp now) const;

  std::vector<Channel> channels_;  ///< In the robot's order.
  std::map<std::string, int, std::less<>> by_name_;
  std::map<std::string, std::optional<double>, std::less<>> held_;
  int x_ = -1, y_ = -1, yaw_ = -1;
  bool is_twist_in_base_ = true;
  double clock_tolerance_s_ = 0.0;
  Origin joint_states_;
  Origin odometry_;
};

/// The topics between an executor and its robot. Messages come in while serve() runs, on a queue of
/// its own, and at no other time. One thread at a time.
class RobotLink {
 public:
  /// The process is a node of ROS.
  RobotLink(const Options& options, JointFeed feed, ros1_node::MasterProbe master);
  RobotLink(const RobotLink&) = delete;
  RobotLink& operator=(const RobotLink&) = delete;

  /// Takes in what has come; never waits.
  void serve();

  [[nodiscard]] const JointFeed& feed() const noexcept { return feed_; }
  /// What keeps the robot from moving, and who says so; nothing where all is well. `now`: ROS time.
  [[nodiscard]] std::optional<std::string> trouble(Stamp now) const;
  /// Whether `true` has come on the confirm topic since the last call.
  [[nodiscard]] bool take_confirmation();

  /// One message for each controller, in order; one without joints is not sent.
  void command(const std::vector<ros_messages::JointTrajectory>& messages);
  void show(const ros_messages::MarkerArray& markers) { markers_.publish(markers); }
  [[nodiscard]] bool has_viewers() const { return markers_.getNumSubscribers() > 0; }
  /// Controllers that do not listen, by their topics.
  [[nodiscard]] std::vector<std::string> deaf_controllers() const;

 private:
  struct Controller {
    std::string state_topic;  ///< Empty: not watched.
    std::optional<Stamp> heard;
  };
  template <class Message, class Callback>
  void subscribe(const std::string& topic, Callback callback);
  void subscribe_all();
  [[nodiscard]] std::optional<std::string> controller_trouble(Stamp now) const;
  [[nodiscard]] std::optional<std::string> switch_trouble() const;

  Options options_;
  JointFeed feed_;
  ros1_node::MasterProbe master_;
  std::vector<Controller> controllers_;
  Stamp watched_since_;
  bool is_stopped_ = false;
  std::optional<double> battery_;
  bool is_confirmed_ = false;
  ::ros::CallbackQueue queue_;
  ::ros::NodeHandle node_;
  std::vector<::ros::Subscriber> subscribers_;
  std::vector<::ros::Publisher> commands_;
  ::ros::Publisher markers_;
};

}  // namespace sidestep::ros1_executor
