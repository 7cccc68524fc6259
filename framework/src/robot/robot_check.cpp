#include "robot_check.hpp"

#include <cmath>
#include <unordered_set>

namespace sidestep::detail {
namespace {

constexpr double kUnitTolerance = 1e-9;

tl::unexpected<Error> refuse(std::string message, std::string where) {
  return fail(ErrorCode::kInvalidArgument, std::move(message), std::move(where));
}

bool in_range(int index, std::size_t size) {
  return index >= 0 && static_cast<std::size_t>(index) < size;
}

template <class Named>
Result<void> check_names(const std::vector<Named>& items, const char* what) {
  std::unordered_set<std::string_view> seen;
  for (const Named& item : items) {
    const std::string where = std::string(what) + " '" + item.name + "'";
    if (item.name.empty()) return refuse("has no name", std::string("a ") + what);
    if (!seen.insert(item.name).second) return refuse("the name is used twice", where);
  }
  return {};
}

Result<void> check_joint(const Joint& joint) {
  const std::string where = "joint '" + joint.name + "'";
  if (std::isnan(joint.lower) || std::isnan(joint.upper) || joint.lower > joint.upper)
    return refuse("the lower limit lies above the upper one", where);
  if (joint.type != Joint::Type::kContinuous &&
      (std::isinf(joint.lower) || std::isinf(joint.upper)))
    return refuse("only a continuous joint may be without limits", where);
  if (!(joint.max_velocity > 0.0) || std::isinf(joint.max_velocity))
    return refuse("the velocity limit must be positive", where);
  if (!(joint.max_acceleration > 0.0))
    return refuse("the acceleration limit must be positive", where);
  return {};
}

Result<void> check_tree(const RobotDescription& description,
                        const std::vector<TreeJoint>& tree_joints) {
  if (description.links.empty()) return refuse("has no links", "robot '" + description.name + "'");
  if (tree_joints.size() != description.links.size())
    return refuse("needs one tree joint per link", "robot '" + description.name + "'");
  std::vector<bool> moved(description.joints.size(), false);
  for (std::size_t i = 0; i < tree_joints.size(); ++i) {
    const Link& link = description.links[i];
    const TreeJoint& joint = tree_joints[i];
    const std::string where = "link '" + link.name + "'";
    if ((i == 0) != (link.parent == -1))
      return refuse("the first link must be the only root", where);
    if (i > 0 && !in_range(link.parent, i)) return refuse("must come after its parent", where);
    if (!joint.T_parent_joint.matrix().allFinite()) return refuse("its pose is not finite", where);
    if (!joint.T_parent_joint.linear().isUnitary(kUnitTolerance))
      return refuse("its pose is not a rigid transform", where);
    if (!std::isfinite(joint.multiplier) || !std::isfinite(joint.offset))
      return refuse("its joint's multiplier and offset must be finite", where);
    if (joint.motion == TreeJoint::Motion::kFixed) continue;
    if (std::abs(joint.axis.norm() - 1.0) > kUnitTolerance)
      return refuse("its joint's axis is not of unit length", where);
    if (joint.joint == -1) continue;
    if (!in_range(joint.joint, moved.size())) return refuse("its joint does not exist", where);
    moved[static_cast<std::size_t>(joint.joint)] = true;
  }
  for (std::size_t j = 0; j < moved.size(); ++j) {
    if (!moved[j]) return refuse("moves no link", "joint '" + description.joints[j].name + "'");
  }
  return {};
}

Result<void> check_parts(const RobotDescription& description) {
  const std::size_t links = description.links.size();
  const std::string robot = "robot '" + description.name + "'";
  for (const CollisionSphere& sphere : description.spheres) {
    if (!in_range(sphere.link, links))
      return refuse("a sphere is on a link that does not exist", robot);
    const std::string where =
        "link '" + description.links[static_cast<std::size_t>(sphere.link)].name + "'";
    if (!(sphere.radius_m > 0.0) || std::isinf(sphere.radius_m))
      return refuse("a sphere's radius must be positive", where);
    if (!sphere.centre_link_m.allFinite()) return refuse("a sphere's centre is not finite", where);
  }
  for (const CollisionShape& shape : description.shapes) {
    if (!in_range(shape.link, links))
      return refuse("a shape is on a link that does not exist", robot);
  }
  for (const auto& [a, b] : description.self_collision_pairs) {
    if (!in_range(a, links) || !in_range(b, links) || a >= b)
      return refuse("a self-collision pair must name two links, the lower index first", robot);
  }
  for (const NamedPose& pose : description.poses) {
    if (pose.positions.size() != description.joints.size())
      return refuse("needs one entry per joint", "pose '" + pose.name + "'");
  }
  return {};
}

}  // namespace

Result<void> check_robot(const RobotDescription& description,
                         const std::vector<TreeJoint>& tree_joints) {
  if (description.joints.empty())
    return refuse("has no planned joint", "robot '" + description.name + "'");
  SIDESTEP_TRY(check_names(description.joints, "joint"));
  SIDESTEP_TRY(check_names(description.links, "link"));
  SIDESTEP_TRY(check_names(description.poses, "pose"));
  for (const Joint& joint : description.joints) {
    SIDESTEP_TRY(check_joint(joint));
  }
  SIDESTEP_TRY(check_tree(description, tree_joints));
  return check_parts(description);
}

}  // namespace sidestep::detail
