#include "robot_body.hpp"

#include <algorithm>

#include <sidestep/trajectory/motion_limits.hpp>

#include "conversions.hpp"

namespace sidestep::fake_hsr {
namespace {

std::vector<int> indices_of(const RobotDescription& robot, const std::vector<std::string>& names) {
  std::vector<int> indices;
  indices.reserve(names.size());
  for (const std::string& name : names) indices.push_back(robot.joint_index(name).value());
  return indices;
}

/// Those of the joints alone.
MotionLimits limits_of(const RobotDescription& robot, const std::vector<int>& indices) {
  const MotionLimits all = motion_limits(robot, {});
  MotionLimits some;
  for (const int index : indices) {
    some.velocity.push_back(all.velocity[static_cast<std::size_t>(index)]);
    some.acceleration.push_back(all.acceleration[static_cast<std::size_t>(index)]);
    some.braking.push_back(all.while_stopping()[static_cast<std::size_t>(index)]);
  }
  const auto place = [&](int joint) {
    return static_cast<int>(std::ranges::find(indices, joint) - indices.begin());
  };
  const int size = static_cast<int>(indices.size());
  if (const auto& base = robot.rolling; base && place(base->yaw) < size) {
    some.rolling = {place(base->x), place(base->y), place(base->yaw)};
  }
  return some;
}

Eigen::VectorXd part(const Eigen::VectorXd& q, const std::vector<int>& indices) {
  Eigen::VectorXd some(static_cast<Eigen::Index>(indices.size()));
  for (std::size_t i = 0; i < indices.size(); ++i)
    some[static_cast<Eigen::Index>(i)] = q[indices[i]];
  return some;
}

}  // namespace

Result<std::shared_ptr<const KinematicTree>> with_joints(const KinematicTree& tree,
                                                         const std::vector<Joint>& joints) {
  RobotDescription description = tree.description();
  std::vector<TreeJoint> tree_joints = tree.tree_joints();
  description.poses.clear();  // They are of the planned joints.
  for (const Joint& joint : joints) {
    const auto found = std::ranges::find(tree_joints, joint.name, &TreeJoint::name);
    const bool turns = found != tree_joints.end() && found->joint == -1 &&
                       found->motion != TreeJoint::Motion::kFixed;
    if (!turns) {
      return fail(ErrorCode::kConfig, "robot '" + description.name + "' has no joint '" +
                                          joint.name + "' that its profile fixes");
    }
    found->joint = description.dof();
    found->multiplier = 1.0;
    found->offset = 0.0;
    description.joints.push_back(joint);
  }
  auto made = SIDESTEP_TRY(KinematicTree::create(std::move(description), std::move(tree_joints)));
  return std::shared_ptr<const KinematicTree>(std::move(made));
}

JointGroup::JointGroup(const RobotDescription& robot, const std::vector<std::string>& joints,
                       const Eigen::VectorXd& q, Stamp now, double delay_s, double lag_s)
    : names_(joints),
      indices_(indices_of(robot, joints)),
      delay_ns_(Stamp::from_seconds(delay_s).ns),
      rolls_(robot.rolling.has_value()),
      robot_(limits_of(robot, indices_), lag_s, part(q, indices_), now) {}

Result<Command> JointGroup::read(const ros_messages::JointTrajectory& message, Stamp now) const {
  const auto bad = [](std::string what) { return invalid(std::move(what)); };
  if (message.points.empty()) return Command{{}, now};
  std::vector<std::size_t> columns;
  for (const std::string& name : names_) {
    const auto found = std::ranges::find(message.joint_names, name);
    if (found == message.joint_names.end()) return bad("it does not command joint '" + name + "'");
    columns.push_back(static_cast<std::size_t>(found - message.joint_names.begin()));
  }
  if (message.joint_names.size() != names_.size()) return bad("it commands other joints, too");
  Command command;
  command.trajectory.dof = static_cast<int>(names_.size());
  const Stamp header = ros_messages::to_stamp(message.header.stamp);
  const auto since_ns = [](const auto& point) { return point.time_from_start.toNSec(); };
  const std::int64_t first_ns = since_ns(message.points.front());
  command.start = {(header.ns == 0 ? now.ns : header.ns) + first_ns};
  for (const auto& point : message.points) {
    if (point.positions.size() != names_.size() || point.velocities.size() != names_.size()) {
      return bad("a point has not a position and a velocity for each joint");
    }
    command.trajectory.times_s.push_back(1e-9 * static_cast<double>(since_ns(point) - first_ns));
    for (const std::size_t column : columns) {
      command.trajectory.positions.push_back(point.positions[column]);
      command.trajectory.velocities.push_back(point.velocities[column]);
    }
  }
  if (auto valid = command.trajectory.validate(); !valid) return bad(valid.error().message);
  return command;
}

Result<void> JointGroup::follow(const ros_messages::JointTrajectory& message, Stamp now) {
  auto command = SIDESTEP_TRY(read(message, now));
  if (command.trajectory.size() == 0) {
    brake(now);
    return {};
  }
  robot_.follow(std::make_shared<const Trajectory>(std::move(command.trajectory)), command.start,
                later(now));
  return {};
}

void JointGroup::drive(const ros_messages::Twist& twist, Stamp now) {
  constexpr double kStep_s = 0.025;
  constexpr int kSteps = 10;
  const Stamp start = later(now);
  Eigen::VectorXd q = robot_.told_position(start);
  const Eigen::Vector2d v_base(twist.linear.x, rolls_ ? 0.0 : twist.linear.y);
  const double turn_radps = twist.angular.z;
  Trajectory arc = make_trajectory(3, kSteps + 1, kStep_s);
  for (int i = 0; i <= kSteps; ++i) {
    const Eigen::Vector2d v_world = Eigen::Rotation2Dd(q[2]) * v_base;
    std::ranges::copy(q, arc.q(i).begin());
    std::ranges::copy(Eigen::Vector3d(v_world.x(), v_world.y(), turn_radps), arc.qdot(i).begin());
    q.head<2>() += kStep_s * (Eigen::Rotation2Dd(q[2] + 0.5 * kStep_s * turn_radps) * v_base);
    q[2] += kStep_s * turn_radps;
  }
  const Stamp end{start.ns + Stamp::from_seconds(arc.duration_s()).ns};
  robot_.follow(std::make_shared<const Trajectory>(std::move(arc)), start, start);
  robot_.brake(end);
}

void JointGroup::advance(Stamp now, RobotState& into) {
  while (robot_.time().ns + simulated::SimulatedRobot::kStep_ns <= now.ns) robot_.step();
  for (std::size_t i = 0; i < indices_.size(); ++i) {
    into.q[indices_[i]] = robot_.state().q[static_cast<Eigen::Index>(i)];
    into.qdot[indices_[i]] = robot_.state().qdot[static_cast<Eigen::Index>(i)];
  }
}

}  // namespace sidestep::fake_hsr
