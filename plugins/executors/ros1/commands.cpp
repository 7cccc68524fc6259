#include "commands.hpp"

#include <algorithm>
#include <cmath>
#include <string>

#include <sidestep/trajectory/braking.hpp>
#include <sidestep/trajectory/splice.hpp>

#include "conversions.hpp"

namespace sidestep::ros1_executor {
namespace {

/// Two points of a command are at least so far apart.
constexpr double kLeastStep_s = 1e-3;

/// Of values at times, between the neighbours of each; zero at both ends.
double rate_at(const std::vector<double>& values, const std::vector<double>& times_s,
               std::size_t i) {
  if (i == 0 || i + 1 == values.size()) return 0.0;
  return (values[i + 1] - values[i - 1]) / (times_s[i + 1] - times_s[i - 1]);
}

}  // namespace

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
        controller.columns.push_back({*index, 0.0, false});
      } else if (held != options.hold.end()) {
        const bool pans = options.look && options.look->pan_joint == name;
        controller.columns.push_back({-1, held->position, pans});
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
    const Trajectory& trajectory, Stamp stamp, const std::vector<double>& pans) const {
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
        if (column.pans && !pans.empty()) {
          point.positions.push_back(pans[i]);
          point.velocities.push_back(rate_at(pans, at_s, i));
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

}  // namespace sidestep::ros1_executor
