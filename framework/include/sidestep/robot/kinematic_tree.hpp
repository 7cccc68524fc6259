#pragma once

#include <array>
#include <cstdint>
#include <vector>

#include <sidestep/core/lanes.hpp>
#include <sidestep/robot/robot_model.hpp>

namespace sidestep {

/// How one link moves against its parent: T_parent_link = T_parent_joint * motion(value),
/// value = multiplier * q[joint] + offset for a moving joint (a mimic joint has a multiplier
/// other than 1 and shares its master's q); a fixed joint has no motion.
struct TreeJoint {
  enum class Motion { kFixed, kRotation, kTranslation };
  std::string name;
  Motion motion = Motion::kFixed;
  Transform T_parent_joint = Transform::Identity();
  Eigen::Vector3d axis = Eigen::Vector3d::UnitZ();  ///< Unit length, joint frame.
  int joint = -1;  ///< Index into RobotDescription::joints; -1 for a fixed value.
  double multiplier = 1.0;
  double offset = 0.0;  ///< The value itself where joint is -1.
};

/// Links that are rigidly attached to each other, moved as one by the joint of the first.
/// Its frame is that link's, turned so that the joint's axis is z.
struct TreeBody {
  int parent = -1;  ///< Index of the parent body; -1 for the world.
  TreeJoint::Motion motion = TreeJoint::Motion::kFixed;
  int joint = -1;
  double multiplier = 1.0;
  double offset = 0.0;
  Eigen::Matrix3d R_parent_joint = Eigen::Matrix3d::Identity();
  Eigen::Vector3d p_parent_joint = Eigen::Vector3d::Zero();
  /// Of each column of R_parent_joint that is an axis of the parent's frame: 1 for x to 3 for z,
  /// negative where it points the other way; else 0.
  std::array<std::int8_t, 3> axes{};
};

struct TreeSphere {
  int body = 0;
  Eigen::Vector3d p_body = Eigen::Vector3d::Zero();
};

/// Where a link is in the frame of its body.
struct TreeLink {
  int body = 0;
  Eigen::Matrix3d R_body_link = Eigen::Matrix3d::Identity();
  Eigen::Vector3d p_body_link = Eigen::Vector3d::Zero();
};

/// Tree kinematics for any robot that URDF can describe. tree_joints[i] moves link i of the
/// description against its parent; the root's entry places it in the world.
class SIDESTEP_EXPORT KinematicTree final : public RobotModel {
 public:
  /// Fails with kInvalidArgument where the parts contradict each other.
  [[nodiscard]] static Result<std::unique_ptr<KinematicTree>> create(
      RobotDescription description, std::vector<TreeJoint> tree_joints);

  [[nodiscard]] const RobotDescription& description() const noexcept override {
    return description_;
  }
  [[nodiscard]] const std::vector<TreeJoint>& tree_joints() const noexcept { return tree_joints_; }

  // The bodies that it computes with, for code that places the robot by other means (on a GPU).
  [[nodiscard]] const std::vector<TreeBody>& bodies() const noexcept { return bodies_; }
  [[nodiscard]] TreeLink link_in_body(int link) const;
  /// In the order of the description's.
  [[nodiscard]] const std::vector<TreeSphere>& spheres_on_bodies() const noexcept {
    return spheres_;
  }

  void link_poses(std::span<const double> q, std::span<Transform> T_world_link,
                  Scratch& scratch) const override;
  void sphere_centres(std::span<const double> q, std::span<Eigen::Vector3d> centres_m,
                      Scratch& scratch) const override;
  void sphere_centre_lanes(std::span<const double> q, std::span<PointLanes> centres_m,
                           Scratch& scratch) const override;
  void sphere_jacobians(std::span<const double> q, std::span<Eigen::Vector3d> centres_m,
                        std::span<Eigen::Vector3d> jacobians, Scratch& scratch) const override;
  void pull_back(std::span<const double> q, std::span<const LinkForce> forces,
                 std::span<double> joint_forces, Scratch& scratch) const override;

  /// Numbers that say where the axes of the joints are in n configurations.
  [[nodiscard]] std::size_t axes_size(std::size_t n) const noexcept;
  /// Where spheres are in single precision, in as many lanes: sphere s in configuration
  /// kFloatLanes * g + lane is lane `lane` of centres_m[g * spheres.size() + s]. Leaves the numbers
  /// above for pull_back_along(), so that bodies are placed once for both. axes: axes_size(n), on a
  /// cache line, as Scratch has it.
  void sphere_centre_lanes(std::span<const double> q, std::span<PointFloats> centres_m,
                           std::span<float> axes, Scratch& scratch) const;
  /// pull_back() in the configurations of which the axes are known, from axes in single precision.
  void pull_back_along(std::span<const float> axes, std::span<const LinkForce> forces,
                       std::span<double> joint_forces, Scratch& scratch) const;

 private:
  struct Pose {
    Eigen::Matrix3d R;
    Eigen::Vector3d p;
  };

  KinematicTree(RobotDescription description, std::vector<TreeJoint> tree_joints);
  struct Column {
    int body;  ///< That moves; -1 for none.
    int joint;
  };

  void add_link(std::size_t link);
  void add_columns();
  template <class Number, class AxesOf>
  void pull_back_with(const AxesOf& axes_of, std::span<const LinkForce> forces,
                      std::span<double> joint_forces, Scratch& scratch) const;
  void place_bodies(const double* q, std::span<Pose> bodies) const noexcept;

  RobotDescription description_;
  std::vector<TreeJoint> tree_joints_;
  std::vector<TreeBody> bodies_;     // parents before children
  std::vector<int> body_of_link_;    // per link
  std::vector<Pose> T_body_link_;    // per link
  std::vector<TreeSphere> spheres_;  // per sphere
  std::vector<int> movers_;          // per body, the bodies from it to the root that q moves
  std::vector<int> movers_begin_;    // movers_ of body b: [movers_begin_[b], movers_begin_[b + 1])
  std::vector<Column> columns_;
  AlignedArray weights_;  // per body, of each column: how far it moves the body as its joint does
};

}  // namespace sidestep
