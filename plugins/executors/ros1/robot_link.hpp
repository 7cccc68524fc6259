#pragma once

#include <memory>
#include <optional>
#include <string>
#include <vector>

#include <ros/callback_queue.h>
#include <ros/node_handle.h>

#include "any_message.hpp"
#include "joint_feed.hpp"
#include "master_probe.hpp"
#include "node_messages.hpp"
#include "options.hpp"

namespace sidestep::ros1_executor {

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

  /// One message for each controller, in order.
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
