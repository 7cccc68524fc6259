#pragma once

#include <memory>
#include <span>
#include <vector>

#include <sidestep/planning/problem.hpp>
#include <sidestep/planning/state_cost.hpp>

namespace sidestep {

/// Signed clearance of points under a space policy: field.query, then
///  - outside the field and Space::kOccupied: minus the distance to the field's box, gradient
///    pointing back inside; Space::kFree: infinity, gradient zero;
///  - unknown and Space::kOccupied: 0 at most, gradient as queried; kFree: as queried.
/// The policy is applied here and below, nowhere else; its floor, which is there for some links
/// only and so for no points, by FloorClearance and make_floor_cost() alone. All spans have n
/// elements; gradients may be empty.
void query_with_policy(const DistanceField& field, const SpacePolicy& policy,
                       std::span<const Eigen::Vector3d> points_m, std::span<double> distances_m,
                       std::span<Eigen::Vector3d> gradients,
                       std::span<FieldStatus> statuses) noexcept;

/// The points whose signed clearance is less than their limit, or not a number, by
/// field.query_below: returns how many, in order of points.
[[nodiscard]] std::size_t query_below_with_policy(const DistanceField& field,
                                                  const SpacePolicy& policy,
                                                  std::span<const PointFloats> points_m,
                                                  std::span<const double> limits_m,
                                                  std::span<FieldSample> samples) noexcept;

/// The spheres that a floor costs something, those of all links but the excepted ones and those
/// that never come down to it, ascending.
[[nodiscard]] std::vector<int> spheres_above(const Floor& floor, const RobotDescription& robot);

/// How far spheres of a robot are above the floor of a space policy.
class FloorClearance {
 public:
  FloorClearance(const SpacePolicy& space, const RobotDescription& robot);

  /// Of the lowest point of a sphere whose centre is at centre_m (world), negative in the floor;
  /// infinity where there is no floor, or none for the sphere's link. [any]; does not allocate.
  [[nodiscard]] double operator()(std::size_t sphere,
                                  const Eigen::Vector3d& centre_m) const noexcept {
    return centre_m.z() - touching_m_[sphere];
  }

 private:
  std::vector<double> touching_m_;  ///< Height of each sphere's centre as it touches the floor.
};

/// One residual per sphere: max(0, epsilon - (D - r)) / sigma (GPMP2, eq. 33).
[[nodiscard]] std::unique_ptr<StateCost> make_obstacle_cost(
    std::shared_ptr<const RobotModel> robot, std::shared_ptr<const DistanceField> field,
    SpacePolicy space, double epsilon_m, double sigma_m);

/// One residual per sphere of spheres_above(): max(0, epsilon - (z - height - r)) / sigma, z the
/// height of its centre.
[[nodiscard]] std::unique_ptr<StateCost> make_floor_cost(std::shared_ptr<const RobotModel> robot,
                                                         const Floor& floor, double epsilon_m,
                                                         double sigma_m);

/// One residual per sphere: max(0, epsilon - (D - r)) / sigma, D the distance to where something
/// that moves may be (Prediction::query) at the state's time plus `prediction_from_s`. Named
/// "moving".
[[nodiscard]] std::unique_ptr<StateCost> make_moving_obstacle_cost(
    std::shared_ptr<const RobotModel> robot, std::shared_ptr<const Prediction> prediction,
    double prediction_from_s, double epsilon_m, double sigma_m);

/// One residual per pair of links checked: the hinge of the closest pair of their spheres.
[[nodiscard]] std::unique_ptr<StateCost> make_self_collision_cost(
    std::shared_ptr<const RobotModel> robot, double epsilon_m, double sigma_m);

/// One residual per joint: the hinge beyond [lower + margin, upper - margin].
[[nodiscard]] std::unique_ptr<StateCost> make_position_limit_cost(
    std::shared_ptr<const RobotModel> robot, double margin, double sigma);

/// One residual per joint: the hinge of |qdot| beyond speed_fraction * max_velocity.
[[nodiscard]] std::unique_ptr<StateCost> make_velocity_limit_cost(
    std::shared_ptr<const RobotModel> robot, double speed_fraction, double sigma);

/// One residual: the speed of the robot's rolling base across its wheels over sigma, in m/s. A
/// robot without one has none: kInvalidArgument.
[[nodiscard]] Result<std::unique_ptr<StateCost>> make_sideways_cost(const RobotDescription& robot,
                                                                    double sigma_mps);

/// 2 d residuals: (q - target.q) / sigma, (qdot - target.qdot) / sigma. `name`: "start", "goal".
[[nodiscard]] std::unique_ptr<StateCost> make_state_prior(std::string name, RobotState target,
                                                          double sigma);

/// d residuals: (qdot - target) / sigma, in the joints' m/s or rad/s. At kGoal, with target zero: a
/// robot that comes to rest wherever other terms let it end.
[[nodiscard]] std::unique_ptr<StateCost> make_velocity_prior(std::string name, Eigen::VectorXd qdot,
                                                             double sigma);

/// d residuals: (q - preferred) / sigma of each joint (m, rad). A joint whose sigma is infinite is
/// left alone; a continuous joint is not unwound. Fails with kInvalidArgument, naming the joint,
/// for sizes other than d, a posture that is not finite, or a sigma that is not positive.
[[nodiscard]] Result<std::unique_ptr<StateCost>> make_posture_cost(const RobotDescription& robot,
                                                                   const Eigen::VectorXd& q,
                                                                   const Eigen::VectorXd& sigmas);

// Costs of where a link is, world frame. At kGoal, in place of the goal prior, they are
// end-effector goals that leave the goal configuration free (CostSettings::hold_goal); elsewhere
// they hold along the way. Named after their link, e.g. "pose_hand". All fail with kInvalidArgument
// where the robot has no such link, a sigma is not positive, or the target is not finite.

/// What a target leaves open.
struct PoseFreedom {
  /// Half the edges, along the world's axes, of a box about the target in which every position will
  /// do: residuals are how far the link is outside.
  Eigen::Vector3d within_m = Eigen::Vector3d::Zero();
  /// Other targets that will do as well: the nearest counts, by the sum of squares.
  std::vector<Transform> alternatives = {};
};

/// Three residuals: the position of the link's origin against the target, over sigma.
[[nodiscard]] Result<std::unique_ptr<StateCost>> make_link_position_cost(
    std::shared_ptr<const RobotModel> robot, const std::string& link,
    const Eigen::Vector3d& p_world_m, double sigma_m, const PoseFreedom& freedom = {});

/// Six residuals: the position, and the rotation vector log(R_target^T R) in rad over its sigma.
/// That vector's length is the angle to the target, at most pi; half a turn away it may point
/// either way, and jumps, while the cost does not.
[[nodiscard]] Result<std::unique_ptr<StateCost>> make_link_pose_cost(
    std::shared_ptr<const RobotModel> robot, const std::string& link, const Transform& T_world_link,
    double sigma_position_m, double sigma_rotation_rad, const PoseFreedom& freedom = {});

/// Three residuals: the rotation vector alone.
[[nodiscard]] Result<std::unique_ptr<StateCost>> make_link_orientation_cost(
    std::shared_ptr<const RobotModel> robot, const std::string& link,
    const Eigen::Matrix3d& R_world_link, double sigma_rad);

/// Two residuals that keep an axis of a link along an axis of the world, as a cup upright, and
/// leave the turn about it free: the components, across the world's axis, of the shortest rotation
/// between the two, over sigma; smooth up to the opposite direction. Axes need not have unit
/// length.
[[nodiscard]] Result<std::unique_ptr<StateCost>> make_link_axis_cost(
    std::shared_ptr<const RobotModel> robot, const std::string& link,
    const Eigen::Vector3d& axis_link, const Eigen::Vector3d& axis_world, double sigma_rad);

}  // namespace sidestep
