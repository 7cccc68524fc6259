#pragma once

#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include <sidestep/core/node.hpp>
#include <sidestep/geometry/shape.hpp>
#include <sidestep/geometry/transform.hpp>

namespace sidestep::urdf_robot {

/// A collision geometry as the URDF gives it; a mesh is not read yet.
struct UrdfShape {
  Shape shape;
  std::string mesh_uri;  ///< Empty for a primitive.
  Eigen::Vector3d mesh_scale = Eigen::Vector3d::Ones();
  Transform T_link_shape = Transform::Identity();
  SourceMark mark;  ///< Of its <collision>.
};

struct UrdfLimits {
  double lower = 0.0;
  double upper = 0.0;
  double velocity = 0.0;
};

struct UrdfMimic {
  std::string joint;
  double multiplier = 1.0;
  double offset = 0.0;
};

struct UrdfJoint {
  enum class Type { kFixed, kRevolute, kContinuous, kPrismatic };
  std::string name;
  Type type = Type::kFixed;
  Transform T_parent_joint = Transform::Identity();
  Eigen::Vector3d axis = Eigen::Vector3d::UnitX();
  std::optional<UrdfLimits> limits;  ///< As far as the URDF has them.
  std::optional<UrdfMimic> mimic;
  SourceMark mark;
};

struct UrdfLink {
  std::string name;
  int parent = -1;                 ///< Index of the parent link; -1 for the root.
  std::optional<UrdfJoint> joint;  ///< From the parent; nothing for the root.
  std::vector<UrdfShape> shapes;
  bool has_visual = false;  ///< Which is not looked at.
  SourceMark mark;
};

/// A URDF's kinematics and collision shapes. Plain data.
struct UrdfModel {
  std::string name;
  std::filesystem::path file;
  std::vector<UrdfLink> links;  ///< Parents before children; the first is the root.

  [[nodiscard]] const UrdfJoint* find_joint(const std::string& joint_name) const noexcept;
  [[nodiscard]] std::optional<int> link_index(const std::string& link_name) const noexcept;
  [[nodiscard]] std::vector<std::string> joint_names() const;
  [[nodiscard]] std::vector<std::string> link_names() const;
};

/// Reads a URDF file: every link, joint, collision, geometry and limit whole, or not at all.
/// Visuals, inertias, transmissions, sensors and simulator tags are passed over. Appends to
/// `errors` what is wrong with it, with file:line:col, and returns nothing then.
[[nodiscard]] std::optional<UrdfModel> read_urdf(const std::filesystem::path& file,
                                                 std::vector<Error>& errors);

/// All mistakes as one error, a line each if there are several. `errors` is not empty.
[[nodiscard]] Error all_of(std::vector<Error> errors, const std::string& what);

}  // namespace sidestep::urdf_robot
