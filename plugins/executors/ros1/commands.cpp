#include "commands.hpp"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <string>
#include <utility>

#include <sidestep/trajectory/braking.hpp>
#include <sidestep/trajectory/splice.hpp>

#include "conversions.hpp"

namespace sidestep::ros1_executor {
namespace {

/// A base that goes no farther than this is not going anywhere.
constexpr double kHere_m = 0.1;

/// Two points of a command are at least so far apart.
constexpr double kLeastStep_s = 1e-3;

/// Rate of an angle at state i, from its neighbours; zero at both ends.
double rate_at(const std::vector<HeadAngles>& head, double HeadAngles::*angle,
               const std::vector<double>& times_s, std::size_t i) {
  if (i == 0 || i + 1 == head.size()) return 0.0;
  return (head[i + 1].*angle - head[i - 1].*angle) / (times_s[i + 1] - times_s[i - 1]);
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

Result<Gaze> Gaze::create(const RobotDescription& robot, const OdometryOptions& base,
                          const LookOptions& look, double highest_tilt_rad) {
  const auto x = robot.joint_index(base.x_joint);
  const auto y = robot.joint_index(base.y_joint);
  const auto yaw = robot.joint_index(base.yaw_joint);
  if (x && y && yaw) return Gaze(look, highest_tilt_rad, *x, *y, *yaw);
  return fail(ErrorCode::kConfig, "robot '" + robot.name + "' lacks a joint of its base",
              "executor.odometry");
}

std::optional<HeadAngles> Gaze::wanted(const Trajectory& plan, double at_s) const {
  std::vector<double> here(static_cast<std::size_t>(plan.dof));
  std::vector<double> there(here.size());
  plan.sample(at_s, here, {});
  plan.sample(at_s + look_.ahead_s, there, {});
  const auto of = [](const std::vector<double>& q, int joint) {
    return q[static_cast<std::size_t>(joint)];
  };
  const double dx = of(there, x_) - of(here, x_);
  const double dy = of(there, y_) - of(here, y_);
  const double way_m = std::hypot(dx, dy);
  if (way_m < kHere_m) return {};
  const double bearing =
      std::remainder(std::atan2(dy, dx) - of(here, yaw_), 2.0 * std::numbers::pi);
  return HeadAngles{std::clamp(bearing, look_.lower_rad, look_.upper_rad),
                    std::clamp(-std::atan2(look_.eye_m, way_m), look_.tilt_lower_rad,
                               std::max(look_.tilt_lower_rad, highest_tilt_rad_))};
}

std::vector<HeadAngles> Gaze::along(const Trajectory& plan, double from_s,
                                    std::span<const double> times_s, HeadAngles head) const {
  std::vector<HeadAngles> list;
  double before_s = times_s.empty() ? 0.0 : times_s.front();
  for (const double time_s : times_s) {
    const double most = look_.speed_radps * (time_s - before_s);
    const HeadAngles to = wanted(plan, from_s + time_s).value_or(head);
    head.pan_rad += std::clamp(to.pan_rad - head.pan_rad, -most, most);
    head.tilt_rad += std::clamp(to.tilt_rad - head.tilt_rad, -most, most);
    list.push_back(head);
    before_s = time_s;
  }
  return list;
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
  for (const ControllerEntry& entry : options.controllers) {
    Controller controller{entry.joints, {}};
    for (const std::string& name : entry.joints) {
      const auto held = std::ranges::find(options.hold, name, &HeldJoint::joint);
      if (const auto index = robot.joint_index(name)) {
        is_moved[static_cast<std::size_t>(*index)] = true;
        controller.columns.push_back({*index});
      } else if (held != options.hold.end()) {
        Column column{-1, held->position};
        if (options.look && options.look->pan_joint == name) column.turns_by = &HeadAngles::pan_rad;
        if (options.look && options.look->tilt_joint == name) {
          column.turns_by = &HeadAngles::tilt_rad;
        }
        controller.columns.push_back(column);
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

std::vector<ros_messages::JointTrajectory> CommandWriter::write(
    const Trajectory& trajectory, Stamp stamp, const std::vector<HeadAngles>& head) const {
  const std::vector<double> at_s = times(trajectory);
  std::vector<ros_messages::JointTrajectory> messages;
  for (const Controller& controller : controllers_) {
    messages.push_back(header_of(controller, stamp));
    messages.back().points.resize(at_s.size());
  }
  const auto dof = static_cast<std::size_t>(trajectory.dof);
  std::vector<double> q(dof), qdot(dof);
  for (std::size_t i = 0; i < at_s.size(); ++i) {
    trajectory.sample(at_s[i], q, qdot);
    for (std::size_t c = 0; c < controllers_.size(); ++c) {
      auto& point = messages[c].points[i];
      point.time_from_start = ::ros::Duration(at_s[i]);
      for (const Column& column : controllers_[c].columns) {
        const auto j = static_cast<std::size_t>(column.joint);
        if (column.turns_by != nullptr && !head.empty()) {
          point.positions.push_back(head[i].*column.turns_by);
          point.velocities.push_back(rate_at(head, column.turns_by, at_s, i));
          continue;
        }
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

CommandStream::CommandStream(const Options& options, MotionLimits limits, CommandWriter writer,
                             std::optional<Gaze> gaze, RobotLink& link)
    : is_shadow_(options.mode == "shadow"),
      horizon_s_(options.command_horizon_s),
      renewal_ns_(Stamp::from_seconds(options.command_renewal_s).ns),
      limits_(std::move(limits)),
      writer_(std::move(writer)),
      gaze_(std::move(gaze)),
      link_(link) {}

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
  command(command_window(told.trajectory(), from_s, horizon_s_, limits_), told.trajectory(), from_s,
          time.to_ros(from));
  sent_ = now;
}

void CommandStream::send_whole(const Trajectory& motion, Stamp ros_stamp) {
  if (!is_shadow_) command(motion, motion, 0.0, ros_stamp);
  sent_whole_ = true;
}

void CommandStream::hold(Stamp ros_stamp) {
  if (!is_shadow_) link_.command(writer_.write_hold(ros_stamp));
}

/// A window of a plan that begins at `from_s` of it.
void CommandStream::command(const Trajectory& window, const Trajectory& plan, double from_s,
                            Stamp ros_stamp) {
  std::vector<HeadAngles> head;
  if (gaze_) {
    const auto position = [&](const std::string& joint) {
      return link_.feed().held_position(joint).value_or(0.0);
    };
    const LookOptions& look = gaze_->look();
    const HeadAngles now{position(look.pan_joint), position(look.tilt_joint.value_or(""))};
    head = gaze_->along(plan, from_s, writer_.times(window), now);
  }
  link_.command(writer_.write(window, ros_stamp, head));
}

}  // namespace sidestep::ros1_executor
