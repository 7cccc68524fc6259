#pragma once

#include <memory>
#include <string>
#include <vector>

#include <sidestep/plugin/parameters.hpp>
#include <sidestep/robot/robot_model.hpp>

namespace sidestep {

/// An item of `spheres` of an attached object.
struct AttachedSphereEntry {
  Eigen::Vector3d centre_m = Eigen::Vector3d::Zero();
  double radius_m = 0.0;

  static Parameters<AttachedSphereEntry> parameters();
};

/// An item of `boxes` of an attached object.
struct AttachedBoxEntry {
  Eigen::Vector3d size_m = Eigen::Vector3d::Zero();
  Eigen::Vector3d position_m = Eigen::Vector3d::Zero();
  Eigen::Vector3d rpy_rad = Eigen::Vector3d::Zero();

  static Parameters<AttachedBoxEntry> parameters();
};

/// An item of `cylinders` of an attached object.
struct AttachedCylinderEntry {
  double radius_m = 0.0;
  double length_m = 0.0;
  Eigen::Vector3d position_m = Eigen::Vector3d::Zero();
  Eigen::Vector3d rpy_rad = Eigen::Vector3d::Zero();

  static Parameters<AttachedCylinderEntry> parameters();
};

/// An item of `attached` of a plan: what the robot carries.
struct AttachedEntry {
  std::string name = "object";
  std::string link;
  Eigen::Vector3d position_m = Eigen::Vector3d::Zero();
  Eigen::Vector3d rpy_rad = Eigen::Vector3d::Zero();
  std::vector<AttachedSphereEntry> spheres;
  std::vector<AttachedBoxEntry> boxes;
  std::vector<AttachedCylinderEntry> cylinders;
  double protrusion_m = 0.02;
  bool frame_only = false;
  std::vector<std::string> touch_links;

  static Parameters<AttachedEntry> parameters();
};

/// The robot with all that an item of `experiment.plans` has it carry, or the robot itself where
/// that is nothing. Appends a kConfig error for each name that is no link of the robot, each name
/// of an object that a link has already, and each object without extent that is not a frame alone;
/// passes over what its schema refuses.
[[nodiscard]] std::shared_ptr<const RobotModel> read_attached(
    const Node& plan, std::shared_ptr<const RobotModel> robot, std::vector<Error>& errors);

}  // namespace sidestep
