#include "urdf_motion.hpp"

#include <algorithm>

namespace sidestep {
namespace {

using urdf_robot::UrdfJoint;

/// 0, or what is nearest to it within the limits.
double rest_value(const UrdfJoint& joint) {
  if (!joint.limits || joint.type == UrdfJoint::Type::kContinuous) return 0.0;
  const auto [lower, upper, velocity] = *joint.limits;
  return lower > upper ? 0.0 : std::clamp(0.0, lower, upper);
}

}  // namespace

const TreeJoint* find_joint(const KinematicTree& robot, const std::string& name) {
  const auto& joints = robot.tree_joints();
  const auto found = std::ranges::find(joints, name, &TreeJoint::name);
  return found == joints.end() ? nullptr : &*found;
}

UrdfMotion::UrdfMotion(const urdf_robot::UrdfModel& urdf, const KinematicTree& robot)
    : urdf_(urdf), robot_(robot) {
  for (const urdf_robot::UrdfLink& link : urdf.links) {
    const bool moves = link.joint && link.joint->type != UrdfJoint::Type::kFixed;
    values_.push_back(moves ? value_of(*link.joint) : Value{});
  }
}

UrdfMotion::Value UrdfMotion::value_of(const UrdfJoint& joint) const {
  if (joint.mimic) {
    const UrdfJoint* const master = urdf_.find_joint(joint.mimic->joint);
    Value value = master == nullptr ? Value{} : value_of(*master);
    value.multiplier *= joint.mimic->multiplier;
    value.offset = joint.mimic->multiplier * value.offset + joint.mimic->offset;
    return value;
  }
  const TreeJoint* const own = find_joint(robot_, joint.name);
  if (own == nullptr || own->motion == TreeJoint::Motion::kFixed)
    return {.offset = rest_value(joint)};
  return {own->joint, own->multiplier, own->offset};
}

std::vector<Transform> UrdfMotion::link_poses(std::span<const double> q) const {
  std::vector<Transform> poses;
  poses.reserve(urdf_.links.size());
  for (std::size_t i = 0; i < urdf_.links.size(); ++i) {
    const urdf_robot::UrdfLink& link = urdf_.links[i];
    if (link.parent == -1 || !link.joint) {
      poses.push_back(Transform::Identity());
      continue;
    }
    Transform T = poses[static_cast<std::size_t>(link.parent)] * link.joint->T_parent_joint;
    const Value& value = values_[i];
    double at = value.offset;
    if (value.joint != -1) at += value.multiplier * q[static_cast<std::size_t>(value.joint)];
    switch (link.joint->type) {
      case UrdfJoint::Type::kFixed: break;
      case UrdfJoint::Type::kPrismatic: T.translate(at * link.joint->axis); break;
      default: T.rotate(Eigen::AngleAxisd(at, link.joint->axis));
    }
    poses.push_back(T);
  }
  return poses;
}

}  // namespace sidestep
