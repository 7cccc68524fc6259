#include <algorithm>

#include "conversions.hpp"

namespace sidestep::ros_messages {
namespace {

constexpr std::int64_t kSecond_ns = 1'000'000'000;

/// Of a geometry_msgs Transform's or Pose's parts.
template <class Position, class Orientation>
std::optional<RigidPose> pose_from(const Position& p, const Orientation& q) {
  return rigid_pose({p.x, p.y, p.z}, {q.w, q.x, q.y, q.z});
}

}  // namespace

Stamp to_stamp(const ::ros::Time& time) noexcept {
  return Stamp{static_cast<std::int64_t>(time.sec) * kSecond_ns + time.nsec};
}

::ros::Time to_ros_time(Stamp stamp) {
  constexpr std::int64_t kLargest_ns = 0xffffffffLL * kSecond_ns;
  const std::int64_t ns = std::clamp<std::int64_t>(stamp.ns, 0, kLargest_ns);
  return {static_cast<std::uint32_t>(ns / kSecond_ns), static_cast<std::uint32_t>(ns % kSecond_ns)};
}

std::optional<RigidPose> pose_of(const TransformStamped& message) {
  return pose_from(message.transform.translation, message.transform.rotation);
}

std::optional<RigidPose> pose_of(const PoseStamped& message) {
  return pose_from(message.pose.position, message.pose.orientation);
}

std::optional<RigidPose> pose_of(const Odometry& message) {
  return pose_from(message.pose.pose.position, message.pose.pose.orientation);
}

int add_transforms(const TfMessage& message, bool is_static, TfTree& tree) {
  int unusable = 0;
  for (const TransformStamped& transform : message.transforms) {
    const auto pose = pose_of(transform);
    const std::string& parent = transform.header.frame_id;
    const bool is_added =
        pose && (is_static ? tree.add_static(parent, transform.child_frame_id, *pose)
                           : tree.add(parent, transform.child_frame_id,
                                      to_stamp(transform.header.stamp), *pose));
    unusable += is_added ? 0 : 1;
  }
  return unusable;
}

int add_joint_states(const JointState& message, JointHistory& history) {
  const Stamp stamp = to_stamp(message.header.stamp);
  int unusable = 0;
  for (std::size_t i = 0; i < message.name.size(); ++i) {
    const bool is_added =
        i < message.position.size() && history.add(message.name[i], stamp, message.position[i]);
    unusable += is_added ? 0 : 1;
  }
  return unusable;
}

TransformStamped to_transform(const RigidPose& T_parent_child, Stamp stamp,
                              const std::string& parent, const std::string& child) {
  TransformStamped message;
  message.header.stamp = to_ros_time(stamp);
  message.header.frame_id = parent;
  message.child_frame_id = child;
  message.transform.translation.x = T_parent_child.translation_m.x();
  message.transform.translation.y = T_parent_child.translation_m.y();
  message.transform.translation.z = T_parent_child.translation_m.z();
  message.transform.rotation.x = T_parent_child.rotation.x();
  message.transform.rotation.y = T_parent_child.rotation.y();
  message.transform.rotation.z = T_parent_child.rotation.z();
  message.transform.rotation.w = T_parent_child.rotation.w();
  return message;
}

JointState to_joint_state(std::span<const Joint> joints, std::span<const double> positions,
                          Stamp stamp) {
  JointState message;
  message.header.stamp = to_ros_time(stamp);
  for (const Joint& joint : joints) message.name.push_back(joint.name);
  message.position.assign(positions.begin(), positions.end());
  return message;
}

}  // namespace sidestep::ros_messages
