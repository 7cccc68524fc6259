#include "robot_link.hpp"

#include <cmath>
#include <cstdio>

#include <boost/function.hpp>

#include "conversions.hpp"

namespace sidestep::ros1_executor {
namespace {

/// A burst of messages after a pause of the caller's must not be lost, nor grow without bound.
constexpr std::uint32_t kQueueLength = 50;

Stamp ros_now() { return ros_messages::to_stamp(::ros::Time::now()); }

std::string seconds_text(double value) {
  char text[40];
  std::snprintf(text, sizeof text, "%.3f s", value);
  return text;
}

}  // namespace

RobotLink::RobotLink(const Options& options, JointFeed feed, ros1_node::MasterProbe master)
    : options_(options),
      feed_(std::move(feed)),
      master_(std::move(master)),
      watched_since_(ros_now()) {
  node_.setCallbackQueue(&queue_);
  subscribe_all();
  for (std::size_t i = 0; i < options_.controllers.size(); ++i) {
    const ControllerEntry& entry = options_.controllers[i];
    controllers_.push_back({entry.state_topic.value_or(""), {}});
    if (options_.mode != "shadow") {
      commands_.push_back(node_.advertise<ros_messages::JointTrajectory>(entry.command_topic, 1));
    }
    if (!entry.state_topic) continue;
    subscribe<ros1_node::AnyMessage>(*entry.state_topic,
                                     [this, i](const auto&) { controllers_[i].heard = ros_now(); });
  }
  markers_ = node_.advertise<ros_messages::MarkerArray>(options_.markers.topic, 1);
}

template <class Message, class Callback>
void RobotLink::subscribe(const std::string& topic, Callback callback) {
  using Pointer = boost::shared_ptr<const Message>;
  const boost::function<void(const Pointer&)> call(callback);
  // Small messages that must not wait for others to fill a packet.
  subscribers_.push_back(node_.subscribe<Message>(topic, kQueueLength, call, ::ros::VoidConstPtr(),
                                                  ::ros::TransportHints().tcpNoDelay()));
}

void RobotLink::subscribe_all() {
  for (const std::string& topic : options_.joint_state_topics) {
    subscribe<ros_messages::JointState>(
        topic, [this](const auto& message) { feed_.add(*message, ros_now()); });
  }
  if (options_.odometry) {
    subscribe<ros_messages::Odometry>(
        options_.odometry->topic, [this](const auto& message) { feed_.add(*message, ros_now()); });
  }
  if (options_.watch.stop_topic) {
    subscribe<ros_messages::Bool>(*options_.watch.stop_topic, [this](const auto& message) {
      is_stopped_ = (message->data != 0) == options_.watch.stop_value;
    });
  }
  if (options_.watch.battery_topic) {
    subscribe<ros_messages::BatteryState>(
        *options_.watch.battery_topic,
        [this](const auto& message) { battery_ = message->percentage; });
  }
  if (options_.mode == "confirm") {
    subscribe<ros_messages::Bool>(options_.confirm_topic, [this](const auto& message) {
      is_confirmed_ = message->data != 0;
    });
  }
}

void RobotLink::serve() {
  queue_.callAvailable(::ros::WallDuration(0.0));
  master_.poll();
}

bool RobotLink::take_confirmation() { return std::exchange(is_confirmed_, false); }

std::optional<std::string> RobotLink::trouble(Stamp now) const {
  const double limit_s = options_.watch.master_silence_s;
  if (limit_s > 0.0 && master_.silence_s() > limit_s) {
    return "the ROS master has not answered for " + seconds_text(master_.silence_s());
  }
  if (auto found = switch_trouble()) return found;
  if (auto found = feed_.trouble(now)) return found;
  return controller_trouble(now);
}

std::optional<std::string> RobotLink::switch_trouble() const {
  if (is_stopped_) return "the emergency stop on " + *options_.watch.stop_topic + " is pressed";
  if (battery_ && !(*battery_ >= options_.watch.min_battery)) {
    return "the battery on " + *options_.watch.battery_topic + " is at " +
           std::to_string(*battery_) + ", below " + std::to_string(options_.watch.min_battery);
  }
  return std::nullopt;
}

std::optional<std::string> RobotLink::controller_trouble(Stamp now) const {
  for (const Controller& controller : controllers_) {
    if (controller.state_topic.empty()) continue;
    const Stamp since = controller.heard.value_or(watched_since_);
    const double silence_s = 1e-9 * static_cast<double>(now.ns - since.ns);
    if (silence_s <= options_.watch.controller_silence_s) continue;
    return "the controller on " + controller.state_topic + " has been silent for " +
           seconds_text(silence_s);
  }
  return std::nullopt;
}

void RobotLink::command(const std::vector<ros_messages::JointTrajectory>& messages) {
  for (std::size_t i = 0; i < commands_.size(); ++i) commands_[i].publish(messages[i]);
}

std::vector<std::string> RobotLink::deaf_controllers() const {
  std::vector<std::string> deaf;
  for (const ::ros::Publisher& publisher : commands_) {
    if (publisher.getNumSubscribers() == 0) deaf.push_back(publisher.getTopic());
  }
  return deaf;
}

}  // namespace sidestep::ros1_executor
