#include "commands.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <string>
#include <utility>

#include <sidestep/trajectory/braking.hpp>
#include <sidestep/trajectory/splice.hpp>

#include "base_drive.hpp"
#include "conversions.hpp"

namespace sidestep::ros1_executor {
namespace {

/// Two points of a command are at least so far apart.
constexpr double kLeastStep_s = 1e-3;

/// In which a joint turns within its limits by one cubic from rest to rest, as controllers go to a
/// point: its largest velocity is 3/2 of the mean, its largest acceleration 6 d / T^2.
double cubic_time_s(const Joint& joint, double from_rad, double to_rad) {
  const double way_rad = std::abs(to_rad - from_rad);
  const double by_velocity_s = 1.5 * way_rad / joint.max_velocity;
  const bool is_limited = std::isfinite(joint.max_acceleration);
  return std::max(by_velocity_s,
                  is_limited ? std::sqrt(6.0 * way_rad / joint.max_acceleration) : 0.0);
}

}  // namespace

void CommandedMotion::set(Trajectory trajectory, Stamp start) {
  trajectory_ = std::move(trajectory);
  start_ = start;
}

std::optional<RobotState> CommandedMotion::at(Stamp now) const {
  if (is_empty()) return {};
  RobotState state{Eigen::VectorXd(trajectory_.dof), Eigen::VectorXd(trajectory_.dof)};
  const double at_s = since_start_s(now);
  const auto dof = static_cast<std::size_t>(trajectory_.dof);
  trajectory_.sample(at_s, {state.q.data(), dof}, {state.qdot.data(), dof});
  if (at_s < 0.0 || at_s > trajectory_.duration_s()) state.qdot.setZero();
  return state;
}

Trajectory stopping(const CommandedMotion& told, const std::optional<Executor::Measured>& measured,
                    double tolerance, const MotionLimits& limits, Stamp now) {
  const auto plan = told.at(now);
  // The newest state may be of a while ago.
  const auto plan_then = measured ? told.at(measured->stamp) : std::nullopt;
  const bool is_off =
      plan_then && (plan_then->q - measured->state.q).cwiseAbs().maxCoeff() > tolerance;
  if (told.is_under_way(now) && !is_off && told.since_start_s(now) >= 0.0) {
    if (auto along = brake(told.trajectory(), told.since_start_s(now), limits)) return *along;
  }
  if (plan && !is_off) {
    if (auto straight = brake_straight(*plan, limits)) return *straight;
  }
  if (!measured) return {};
  const auto straight = brake_straight(measured->state, limits);
  return straight ? *straight : Trajectory{};
}

Trajectory command_window(const Trajectory& followed, double from_s, double horizon_s,
                          const MotionLimits& limits) {
  const double rest_s = followed.duration_s();
  const double end_s = from_s + horizon_s;
  if (horizon_s <= 0.0 || end_s >= rest_s) return cut(followed, from_s, rest_s);
  const auto stop = brake(followed, end_s, limits);
  if (!stop) return cut(followed, from_s, rest_s);
  return joined(cut(followed, from_s, end_s), *stop);
}

Result<CommandWriter> CommandWriter::create(const RobotDescription& robot, const Options& options) {
  CommandWriter writer;
  writer.rate_hz_ = options.command_rate_hz;
  std::vector<bool> is_moved(robot.joints.size(), false);
  if (options.twist) {
    for (const auto& name :
         {options.odometry->x_joint, options.odometry->y_joint, options.odometry->yaw_joint}) {
      if (const auto index = robot.joint_index(name)) {
        is_moved[static_cast<std::size_t>(*index)] = true;
      }
    }
  }
  for (const ControllerEntry& entry : options.controllers) {
    Controller controller{entry.joints, {}};
    for (const std::string& name : entry.joints) {
      const auto held = std::ranges::find(options.hold, name, &HeldJoint::joint);
      if (const auto index = robot.joint_index(name)) {
        is_moved[static_cast<std::size_t>(*index)] = true;
        controller.columns.push_back({*index});
      } else if (held != options.hold.end()) {
        controller.columns.push_back({-1, held->position});
      } else {
        return fail(ErrorCode::kConfig,
                    "robot '" + robot.name + "' has no joint '" + name + "', which " +
                        entry.command_topic + " is to move",
                    "executor.controllers", "if it is not planned, say in `hold` where it stays");
      }
    }
    writer.controllers_.push_back(std::move(controller));
  }
  for (std::size_t j = 0; j < is_moved.size(); ++j) {
    if (is_moved[j] || options.mode == "shadow") continue;
    return fail(ErrorCode::kConfig, "no controller moves joint '" + robot.joints[j].name + "'",
                "executor.controllers");
  }
  return writer;
}

ros_messages::JointTrajectory CommandWriter::header_of(const Controller& controller,
                                                       Stamp stamp) const {
  ros_messages::JointTrajectory message;
  message.header.stamp = ros_messages::to_ros_time(stamp);
  message.joint_names.assign(controller.names.begin(), controller.names.end());
  return message;
}

std::vector<double> CommandWriter::times(const Trajectory& trajectory) const {
  const double duration_s = trajectory.duration_s();
  std::vector<double> list{0.0};
  for (int k = 1; k / rate_hz_ < duration_s - kLeastStep_s; ++k) list.push_back(k / rate_hz_);
  list.push_back(std::max(duration_s, kLeastStep_s));
  return list;
}

std::vector<ros_messages::JointTrajectory> CommandWriter::write(const Trajectory& trajectory,
                                                                Stamp stamp) const {
  const std::vector<double> at_s = times(trajectory);
  std::vector<ros_messages::JointTrajectory> messages;
  for (const Controller& controller : controllers_) {
    messages.emplace_back();
    if (controller.turns_head) continue;
    messages.back() = header_of(controller, stamp);
    messages.back().points.resize(at_s.size());
  }
  const auto dof = static_cast<std::size_t>(trajectory.dof);
  std::vector<double> q(dof), qdot(dof);
  for (std::size_t i = 0; i < at_s.size(); ++i) {
    trajectory.sample(at_s[i], q, qdot);
    for (std::size_t c = 0; c < controllers_.size(); ++c) {
      if (controllers_[c].turns_head) continue;
      auto& point = messages[c].points[i];
      point.time_from_start = ::ros::Duration(at_s[i]);
      for (const Column& column : controllers_[c].columns) {
        const auto j = static_cast<std::size_t>(column.joint);
        point.positions.push_back(column.joint < 0 ? column.held : q[j]);
        point.velocities.push_back(column.joint < 0 ? 0.0 : qdot[j]);
      }
    }
  }
  return messages;
}

std::vector<ros_messages::JointTrajectory> CommandWriter::write_hold(Stamp stamp) const {
  std::vector<ros_messages::JointTrajectory> messages;
  for (const Controller& controller : controllers_) {
    messages.push_back(header_of(controller, stamp));
  }
  return messages;
}

Result<std::vector<ros_messages::JointTrajectory>> CommandWriter::turn_head(
    const HeadDescription& head, const HeadAngles& from, const HeadAngles& to, Stamp stamp) {
  const std::array angles{std::pair(&head.pan.joint, to.pan_rad),
                          std::pair(&head.tilt.joint, to.tilt_rad)};
  const double time_s =
      std::max({kLeastStep_s, cubic_time_s(head.pan.joint, from.pan_rad, to.pan_rad),
                cubic_time_s(head.tilt.joint, from.tilt_rad, to.tilt_rad)});
  std::size_t found = 0;
  std::vector<std::size_t> turning;
  std::vector<ros_messages::JointTrajectory> messages(controllers_.size());
  for (std::size_t c = 0; c < controllers_.size(); ++c) {
    const Controller& controller = controllers_[c];
    ros_messages::JointTrajectory message = header_of(controller, stamp);
    auto& point = message.points.emplace_back();
    point.time_from_start = ::ros::Duration(time_s);
    const std::size_t before = found;
    for (std::size_t i = 0; i < controller.names.size(); ++i) {
      const auto turned = std::ranges::find(angles, controller.names[i],
                                            [](const auto& angle) { return angle.first->name; });
      const bool is_turned = turned != angles.end();
      found += is_turned ? 1 : 0;
      point.positions.push_back(is_turned ? turned->second : controller.columns[i].held);
      point.velocities.push_back(0.0);
    }
    if (found == before) continue;
    if (std::ranges::any_of(controller.columns, [](const Column& k) { return k.joint >= 0; })) {
      return fail(ErrorCode::kUnsupported, "the head's controller moves planned joints, too",
                  "executor.controllers");
    }
    turning.push_back(c);
    messages[c] = std::move(message);
  }
  if (found != angles.size()) {
    return fail(
        ErrorCode::kUnsupported,
        "no controller moves '" + head.pan.joint.name + "' and '" + head.tilt.joint.name + "'",
        "executor.controllers", "name them there and in `hold`");
  }
  for (const std::size_t c : turning) controllers_[c].turns_head = true;
  return messages;
}

CommandStream::CommandStream(const Options& options, MotionLimits limits, CommandWriter writer,
                             RobotLink& link, std::unique_ptr<BaseDrive> drive)
    : is_shadow_(options.mode == "shadow"),
      horizon_s_(options.command_horizon_s),
      renewal_ns_(Stamp::from_seconds(options.command_renewal_s).ns),
      limits_(std::move(limits)),
      writer_(std::move(writer)),
      link_(link),
      drive_(std::move(drive)) {}

CommandStream::~CommandStream() = default;

std::vector<std::string> CommandStream::deaf_topics() const {
  std::vector<std::string> deaf = link_.deaf_controllers();
  if (auto topic = drive_ ? drive_->deaf_topic() : std::nullopt) deaf.push_back(std::move(*topic));
  return deaf;
}

void CommandStream::command(const Trajectory& motion, Stamp ros_stamp) {
  link_.command(writer_.write(motion, ros_stamp));
  if (drive_) drive_->follow(motion, ros_stamp);
}

void CommandStream::begin() {
  sent_whole_ = false;
  sent_ = kLongAgo;
}

void CommandStream::send(const CommandedMotion& told, Stamp now, const ros1_node::RunTime& time) {
  if (is_shadow_ || sent_whole_ || now.ns - sent_.ns < renewal_ns_) return;
  const Stamp from = std::max(now, told.start());
  const double from_s = told.since_start_s(from), duration_s = told.trajectory().duration_s();
  constexpr double kShortest_s = 1e-3;
  if (from_s + kShortest_s >= duration_s) return;
  sent_whole_ = horizon_s_ <= 0.0 || from_s + horizon_s_ >= duration_s;
  command(command_window(told.trajectory(), from_s, horizon_s_, limits_), time.to_ros(from));
  sent_ = now;
}

void CommandStream::send_whole(const Trajectory& motion, Stamp ros_stamp) {
  if (!is_shadow_) command(motion, ros_stamp);
  sent_whole_ = true;
}

void CommandStream::hold(Stamp ros_stamp) {
  if (is_shadow_) return;
  link_.command(writer_.write_hold(ros_stamp));
  if (drive_) drive_->hold();
}

Result<void> CommandStream::turn_head(const HeadDescription& head, const HeadAngles& from,
                                      const HeadAngles& to, Stamp ros_stamp) {
  const auto messages = SIDESTEP_TRY(writer_.turn_head(head, from, to, ros_stamp));
  if (!is_shadow_) link_.command(messages);
  return {};
}

}  // namespace sidestep::ros1_executor
