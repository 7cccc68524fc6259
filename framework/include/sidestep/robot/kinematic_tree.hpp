#pragma once

#include <vector>

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

  void link_poses(std::span<const double> q, std::span<Transform> T_world_link,
                  Scratch& scratch) const override;
  void sphere_centres(std::span<const double> q, std::span<Eigen::Vector3d> centres_m,
                      Scratch& scratch) const override;
  void sphere_jacobians(std::span<const double> q, std::span<Eigen::Vector3d> centres_m,
                        std::span<Eigen::Vector3d> jacobians, Scratch& scratch) const override;
  void pull_back(std::span<const double> q, std::span<const Eigen::Vector3d> sphere_gradients,
                 std::span<double> joint_gradients, Scratch& scratch) const override;

 private:
  KinematicTree(RobotDescription description, std::vector<TreeJoint> tree_joints);

  RobotDescription description_;
  std::vector<TreeJoint> tree_joints_;
};

}  // namespace sidestep
