#pragma once

#include <memory>
#include <variant>
#include <vector>

#include <Eigen/Core>

#include <sidestep/core/export.hpp>
#include <sidestep/planning/problem.hpp>

namespace sidestep {

// What the costs of costs.hpp are made of: the numbers they were made with, checked.

/// make_obstacle_cost().
struct ObstacleForm {
  std::shared_ptr<const RobotModel> robot;
  std::shared_ptr<const DistanceField> field;
  SpacePolicy space;
  double epsilon_m;
  double sigma_m;
};

/// make_floor_cost().
struct FloorForm {
  std::shared_ptr<const RobotModel> robot;
  Floor floor;
  double epsilon_m;
  double sigma_m;
};

/// make_self_collision_cost().
struct SelfCollisionForm {
  std::shared_ptr<const RobotModel> robot;
  double epsilon_m;
  double sigma_m;
};

/// make_position_limit_cost(), make_velocity_limit_cost(): the hinge of each joint's value beyond
/// [lower, upper], over sigma.
struct LimitForm {
  bool of_velocity;
  Eigen::VectorXd lower;
  Eigen::VectorXd upper;
  double sigma;
};

/// make_state_prior(), make_velocity_prior(), make_posture_cost(): (value - target) * weight of
/// each joint's position and velocity. A weight of 0 leaves a value alone.
struct TargetForm {
  Eigen::VectorXd q, q_weights;
  Eigen::VectorXd qdot, qdot_weights;
};

/// make_link_position_cost(), make_link_pose_cost(), make_link_orientation_cost(): position, beyond
/// the region about it, and rotation vector against the nearest target, times weights; a weight of
/// 0 leaves that part out.
struct LinkPoseForm {
  std::shared_ptr<const RobotModel> robot;
  int link;
  std::vector<Transform> targets;  ///< At least one.
  Eigen::Vector3d within_m;
  double position_weight;
  double rotation_weight;
};

/// make_link_axis_cost(). Axes have unit length; the two residuals are the components along
/// `across`.
struct LinkAxisForm {
  std::shared_ptr<const RobotModel> robot;
  int link;
  Eigen::Vector3d axis_link;
  Eigen::Vector3d axis_world;
  Eigen::Vector3d across[2];
  double weight;
};

using CostForm = std::variant<ObstacleForm, FloorForm, SelfCollisionForm, LimitForm, TargetForm,
                              LinkPoseForm, LinkAxisForm>;

/// Optional interface of a StateCost: its parameters, for optimisers that evaluate costs by other
/// means than evaluate(), e.g. on a GPU. All of costs.hpp implement it but those of what moves and
/// of a rolling base.
class SIDESTEP_EXPORT HasCostForm {
 public:
  virtual ~HasCostForm() = default;

  /// [any]; allocates.
  [[nodiscard]] virtual CostForm form() const = 0;
};

}  // namespace sidestep
