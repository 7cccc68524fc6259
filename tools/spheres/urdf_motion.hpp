#pragma once

#include <optional>
#include <span>
#include <string>
#include <vector>

#include <sidestep/robot/kinematic_tree.hpp>

#include "urdf_file.hpp"

namespace sidestep {

/// A URDF whose joints do what those of the same names do in a robot's profile; joints that mimic
/// others follow them as the URDF says. The URDF and the robot outlive it. [any]
class UrdfMotion {
 public:
  /// A joint's value: multiplier * q[joint] + offset.
  struct Value {
    int joint = -1;  ///< Of the robot's planned ones; -1 where it is at rest.
    double multiplier = 1.0;
    double offset = 0.0;
  };

  UrdfMotion(const urdf_robot::UrdfModel& urdf, const KinematicTree& robot);

  /// Of the joint from a link's parent; at rest for the root and fixed joints.
  [[nodiscard]] const Value& value(std::size_t link) const noexcept { return values_[link]; }
  /// Poses of the URDF's links, in its root's frame. q: the robot's.
  [[nodiscard]] std::vector<Transform> link_poses(std::span<const double> q) const;

 private:
  [[nodiscard]] Value value_of(const urdf_robot::UrdfJoint& joint) const;

  const urdf_robot::UrdfModel& urdf_;
  const KinematicTree& robot_;
  std::vector<Value> values_;  // per link
};

/// The robot's joint of this name, fixed, planned or neither; null where there is none.
[[nodiscard]] const TreeJoint* find_joint(const KinematicTree& robot, const std::string& name);

}  // namespace sidestep
