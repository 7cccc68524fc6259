#pragma once

#include <memory>

#include <sidestep/planning/problem.hpp>
#include <sidestep/planning/state_cost.hpp>

namespace sidestep {

/// Signed clearance of points under a space policy: field.query, then
///  - outside the field and Space::kOccupied: minus the distance to the field's box, gradient
///    pointing back inside; Space::kFree: infinity, gradient zero;
///  - unknown and Space::kOccupied: 0 at most, gradient as queried; kFree: as queried.
/// The policy is applied here and below, nowhere else. All spans have n elements; gradients may be
/// empty.
void query_with_policy(const DistanceField& field, const SpacePolicy& policy,
                       std::span<const Eigen::Vector3d> points_m, std::span<double> distances_m,
                       std::span<Eigen::Vector3d> gradients,
                       std::span<FieldStatus> statuses) noexcept;

/// The points whose signed clearance is less than their limit, or not a number, by
/// field.query_below: returns how many, in order of points.
[[nodiscard]] std::size_t query_below_with_policy(const DistanceField& field,
                                                  const SpacePolicy& policy,
                                                  std::span<const PointLanes> points_m,
                                                  std::span<const double> limits_m,
                                                  std::span<FieldSample> samples) noexcept;

/// One residual per sphere: max(0, epsilon - (D - r)) / sigma (GPMP2, eq. 33).
[[nodiscard]] std::unique_ptr<StateCost> make_obstacle_cost(
    std::shared_ptr<const RobotModel> robot, std::shared_ptr<const DistanceField> field,
    SpacePolicy space, double epsilon_m, double sigma_m);

/// One residual per pair of links checked: the hinge of the closest pair of their spheres.
[[nodiscard]] std::unique_ptr<StateCost> make_self_collision_cost(
    std::shared_ptr<const RobotModel> robot, double epsilon_m, double sigma_m);

/// One residual per joint: the hinge beyond [lower + margin, upper - margin].
[[nodiscard]] std::unique_ptr<StateCost> make_position_limit_cost(
    std::shared_ptr<const RobotModel> robot, double margin, double sigma);

/// One residual per joint: the hinge of |qdot| beyond speed_fraction * max_velocity.
[[nodiscard]] std::unique_ptr<StateCost> make_velocity_limit_cost(
    std::shared_ptr<const RobotModel> robot, double speed_fraction, double sigma);

/// 2 d residuals: (q - target.q) / sigma, (qdot - target.qdot) / sigma. `name`: "start", "goal".
[[nodiscard]] std::unique_ptr<StateCost> make_state_prior(std::string name, RobotState target,
                                                          double sigma);

}  // namespace sidestep
