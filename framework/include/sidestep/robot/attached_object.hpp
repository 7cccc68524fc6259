#pragma once

#include <memory>
#include <string>
#include <vector>

#include <sidestep/robot/kinematic_tree.hpp>

namespace sidestep {

/// Something that a robot holds, fixed to one of its links.
struct AttachedObject {
  /// A sphere in the object's frame.
  struct ObjectSphere {
    Eigen::Vector3d centre_m = Eigen::Vector3d::Zero();
    double radius_m = 0.0;
  };
  /// A shape in the object's frame.
  struct ObjectShape {
    Shape shape;
    Transform T_object_shape = Transform::Identity();
  };

  std::string name;  ///< Of the link that it becomes.
  std::string link;  ///< That holds it.
  Transform T_link_object = Transform::Identity();
  std::vector<ObjectSphere> spheres;  ///< What planning sees of it.
  std::vector<ObjectShape> shapes;    ///< What independent checks see of it.
  /// Links that may touch it, such as the fingers around it. The link that holds it, and those
  /// rigidly attached to that one, always may.
  std::vector<std::string> touch_links;
};

/// The robot with an object in its hand: one more link, last, fixed to `link`, with the object's
/// spheres and shapes, checked for self-collision against every link that may not touch it. Joints,
/// and the indices of all that was there, stay. Costs, checks and planners that are given the
/// returned model treat the object as a part of the robot; several objects are attached one by one.
///
/// Fails with kInvalidArgument where the robot is not a KinematicTree (all robots read from URDF
/// are), has no such link or touch link, has a link of the object's name, or the object makes no
/// sense.
[[nodiscard]] SIDESTEP_EXPORT Result<std::unique_ptr<KinematicTree>> attach_object(
    const RobotModel& robot, const AttachedObject& object);

}  // namespace sidestep
