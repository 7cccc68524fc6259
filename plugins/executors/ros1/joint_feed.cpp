#include "joint_feed.hpp"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <numbers>

#include <sidestep/core/index.hpp>

#include "conversions.hpp"

namespace sidestep::ros1_executor {
namespace {

constexpr double kJointsKept_s = 2.0;
/// Positions farther apart in time than this say nothing of what was between them.
constexpr double kLongestGap_s = 0.5;

double seconds_between(Stamp from, Stamp to) { return 1e-9 * static_cast<double>(to.ns - from.ns); }

std::string seconds_text(double value) {
  char text[40];
  std::snprintf(text, sizeof text, "%.3f s", value);
  return text;
}

Result<int> joint_of(const RobotDescription& robot, const std::string& name,
                     const std::string& where) {
  if (const auto index = robot.joint_index(name)) return *index;
  return fail(ErrorCode::kConfig, "robot '" + robot.name + "' has no joint '" + name + "'", where);
}

}  // namespace

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
  const auto pose = ros_messages::pose_of(message);
  if (!pose) return;
  const Stamp stamp = ros_messages::to_stamp(message.header.stamp);
  const Eigen::Matrix3d R = pose->rotation.toRotationMatrix();
  const double yaw = std::atan2(R(1, 0), R(0, 0));
  const auto& twist = message.twist.twist;
  Eigen::Vector2d velocity(twist.linear.x, twist.linear.y);
  if (is_twist_in_base_) velocity = Eigen::Rotation2Dd(yaw) * velocity;
  const auto channel = [&](int index) -> Channel& { return channels_[idx(index)]; };
  add(channel(x_), stamp, pose->translation_m.x(), velocity.x());
  add(channel(y_), stamp, pose->translation_m.y(), velocity.y());
  add(channel(yaw_), stamp, yaw, twist.angular.z);
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

}  // namespace sidestep::ros1_executor
