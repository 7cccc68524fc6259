#include "robot_link.hpp"

#include <algorithm>
#include <cmath>
#include <numbers>

#include <boost/function.hpp>

#include <sidestep/core/format.hpp>
#include <sidestep/core/index.hpp>

#include "conversions.hpp"

namespace sidestep::ros1_executor {
namespace {

using ros1_node::ros_now;

constexpr double kJointsKept_s = 2.0;
/// Positions farther apart in time than this say nothing of what was between them.
constexpr double kLongestGap_s = 0.5;

double seconds_between(Stamp from, Stamp to) { return 1e-9 * static_cast<double>(to.ns - from.ns); }

std::string seconds_text(double value) { return format("%.3f s", value); }

Result<int> joint_of(const RobotDescription& robot, const std::string& name,
                     const std::string& where) {
  if (const auto index = robot.joint_index(name)) return *index;
  return fail(ErrorCode::kConfig, "robot '" + robot.name + "' has no joint '" + name + "'", where);
}

/// A burst of messages after a pause of the caller's must not be lost, nor grow without bound.
constexpr std::uint32_t kQueueLength = 50;

}  // namespace

std::optional<PlanarMotion> planar_motion_of(const ros_messages::Odometry& message,
                                             bool is_twist_in_base) {
  const auto pose = ros_messages::pose_of(message);
  if (!pose) return {};
  const Eigen::Matrix3d R = pose->rotation.toRotationMatrix();
  const double yaw = std::atan2(R(1, 0), R(0, 0));
  const auto& twist = message.twist.twist;
  Eigen::Vector2d velocity(twist.linear.x, twist.linear.y);
  if (is_twist_in_base) velocity = Eigen::Rotation2Dd(yaw) * velocity;
  if (!velocity.allFinite() || !std::isfinite(twist.angular.z)) return {};
  return PlanarMotion{{pose->translation_m.x(), pose->translation_m.y(), yaw},
                      {velocity.x(), velocity.y(), twist.angular.z}};
}

Result<JointFeed> JointFeed::create(const RobotDescription& robot, const Options& options) {
  JointFeed feed;
  feed.clock_tolerance_s_ = options.watch.clock_tolerance_s;
  feed.joint_states_ = {
      "joint state", joined(options.joint_state_topics), options.watch.max_joint_age_s, {}};
  for (const Joint& joint : robot.joints) {
    feed.by_name_[joint.name] = static_cast<int>(feed.channels_.size());
    feed.channels_.push_back({joint.name, joint.type == Joint::Type::kContinuous, false, {}});
  }
  for (const HeldJoint& held : options.hold) feed.held_[held.joint] = std::nullopt;
  if (!options.odometry) return feed;

  const OdometryOptions& odometry = *options.odometry;
  feed.odometry_ = {"odometry", odometry.topic, options.watch.max_odometry_age_s, {}};
  feed.is_twist_in_base_ = odometry.twist_in == "base";
  const auto find = [&](const std::string& name, const char* key, int& into) -> Result<void> {
    into = SIDESTEP_TRY(joint_of(robot, name, std::string("executor.odometry.") + key));
    Channel& channel = feed.channels_[idx(into)];
    channel.is_odometry = true;
    // Yaw is told within a turn, and goes on beyond it.
    channel.is_continuous = channel.is_continuous || &into == &feed.yaw_;
    return {};
  };
  for (const auto& found :
       {find(odometry.x_joint, "x_joint", feed.x_), find(odometry.y_joint, "y_joint", feed.y_),
        find(odometry.yaw_joint, "yaw_joint", feed.yaw_)}) {
    if (!found) return error_of(found);
  }
  return feed;
}

void JointFeed::add(Channel& channel, Stamp stamp, double q, std::optional<double> qdot) {
  if (!std::isfinite(q) || (qdot && !std::isfinite(*qdot))) return;
  if (channel.is_continuous && !channel.series.samples().empty()) {
    const double before = channel.series.samples().back().value.q;
    q = before + std::remainder(q - before, 2.0 * std::numbers::pi);
  }
  channel.series.add(stamp, {q, qdot});
  const Stamp newest = channel.series.samples().back().stamp;
  channel.series.forget_before({newest.ns - Stamp::from_seconds(kJointsKept_s).ns});
}

void JointFeed::add(const ros_messages::JointState& message, Stamp received) {
  const Stamp stamp = ros_messages::to_stamp(message.header.stamp);
  const std::size_t count = std::min(message.name.size(), message.position.size());
  for (std::size_t i = 0; i < count; ++i) {
    if (const auto held = held_.find(message.name[i]); held != held_.end()) {
      held->second = message.position[i];
    }
    const auto at = by_name_.find(message.name[i]);
    if (at == by_name_.end()) continue;
    Channel& channel = channels_[idx(at->second)];
    if (channel.is_odometry) continue;
    std::optional<double> qdot;
    if (i < message.velocity.size()) qdot = message.velocity[i];
    add(channel, stamp, message.position[i], qdot);
    joint_states_.received = received;
  }
}

void JointFeed::add(const ros_messages::Odometry& message, Stamp received) {
  if (x_ < 0) return;
  const auto motion = planar_motion_of(message, is_twist_in_base_);
  if (!motion) return;
  const Stamp stamp = ros_messages::to_stamp(message.header.stamp);
  Eigen::Index i = 0;
  for (const int joint : {x_, y_, yaw_}) {
    add(channels_[idx(joint)], stamp, motion->pose[i], motion->velocity[i]);
    ++i;
  }
  odometry_.received = received;
}

std::optional<JointFeed::State> JointFeed::newest() const {
  if (channels_.empty()) return {};
  Stamp common{std::numeric_limits<std::int64_t>::max()};
  for (const Channel& channel : channels_) {
    if (channel.series.samples().empty()) return {};
    common = std::min(common, channel.series.samples().back().stamp);
  }
  const auto dof = static_cast<Eigen::Index>(channels_.size());
  State result{{Eigen::VectorXd(dof), Eigen::VectorXd(dof)}, common};
  for (Eigen::Index j = 0; j < dof; ++j) {
    const auto& series = channels_[idx(j)].series;
    const auto around = series.around(common, kLongestGap_s);
    if (!around) return {};
    const Motion& before = around->before->value;
    const Motion& after = around->after->value;
    const auto blend = [&](double a, double b) { return a + around->share * (b - a); };
    result.state.q[j] = blend(before.q, after.q);
    if (before.qdot && after.qdot) {
      result.state.qdot[j] = blend(*before.qdot, *after.qdot);
      continue;
    }
    // Without velocities, that between the last two positions.
    const auto& samples = series.samples();
    const auto at =
        std::ranges::lower_bound(samples, common, {}, [](const auto& s) { return s.stamp; });
    const auto next = at == samples.begin() ? at : std::prev(at);
    const double dt_s = seconds_between(next->stamp, at->stamp);
    result.state.qdot[j] = dt_s > 0.0 ? (at->value.q - next->value.q) / dt_s : 0.0;
  }
  return result;
}

std::optional<std::string> JointFeed::trouble_of(const Channel& channel, Stamp now) const {
  const Origin& origin = origin_of(channel);
  if (!origin.received) return "no " + origin.name + " has come on " + origin.topics;
  if (channel.series.samples().empty()) {
    return "the " + origin.name + " on " + origin.topics + " does not tell of joint '" +
           channel.joint + "'";
  }
  const double age_s = seconds_between(channel.series.samples().back().stamp, now);
  if (age_s < -clock_tolerance_s_) {
    return "the " + origin.name + " on " + origin.topics + " is stamped " + seconds_text(-age_s) +
           " ahead of this machine's clock: the clocks are not synchronised";
  }
  if (age_s <= origin.max_age_s) return std::nullopt;
  const double silence_s = seconds_between(*origin.received, now);
  const std::string late = silence_s < 0.5 * origin.max_age_s
                               ? ", though messages come: they are late, not of this joint, or the "
                                 "clocks are not synchronised"
                               : "";
  return "the newest " + origin.name + " of joint '" + channel.joint + "' on " + origin.topics +
         " is " + seconds_text(age_s) + " old" + late;
}

std::optional<std::string> JointFeed::trouble(Stamp now) const {
  for (const Channel& channel : channels_) {
    if (auto found = trouble_of(channel, now)) return found;
  }
  return std::nullopt;
}

std::optional<double> JointFeed::held_position(const std::string& joint) const {
  const auto held = held_.find(joint);
  return held == held_.end() ? std::nullopt : held->second;
}

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
  for (std::size_t i = 0; i < commands_.size(); ++i) {
    if (!messages[i].joint_names.empty()) commands_[i].publish(messages[i]);
  }
}

std::vector<std::string> RobotLink::deaf_controllers() const {
  std::vector<std::string> deaf;
  for (const ::ros::Publisher& publisher : commands_) {
    if (publisher.getNumSubscribers() == 0) deaf.push_back(publisher.getTopic());
  }
  return deaf;
}

}  // namespace sidestep::ros1_executor
