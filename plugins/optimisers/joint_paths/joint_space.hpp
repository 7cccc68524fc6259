#pragma once

#include <span>
#include <vector>

#include <Eigen/Core>

#include <sidestep/planning/problem.hpp>

#include "steering.hpp"

namespace sidestep::joint_paths {

/// How far a unit of each joint moves the sphere's centre that it moves farthest, at the start or
/// at the goal, in m; at least `least_m`, which is for joints that move none, as the last of a
/// wrist. Allocates.
[[nodiscard]] std::vector<double> motion_weights(const Problem& problem, double least_m);

/// The space that is searched: each joint's position times its weight, where distances are
/// Euclidean, and the bounds within which samples fall.
///
/// Bounds are the joints' limits. A prismatic joint without limits (a base) is bounded by where
/// the robot's spheres still lie inside the field; a joint that turns without limits, by one and
/// a half half-turns beyond start and goals. It is a real line, so that trajectories never jump.
/// Without `any_turn` a goal one turn away is one turn away. With it the robot may end a whole
/// number of turns from the goal in such joints: in the nearest equivalent of its angle or the
/// next one the other way round, and the bounds are one turn either way.
class JointSpace {
 public:
  /// `goals`: where the robot may end, at least one. `weights`: of each joint, greater than 0.
  JointSpace(const Problem& problem, std::span<const Eigen::VectorXd> goals,
             std::vector<double> weights, bool any_turn);

  /// Where the robot may end, in the order given: at least one configuration of dof() values.
  [[nodiscard]] const std::vector<Eigen::VectorXd>& goals() const noexcept { return goals_; }

  /// How the robot moves in it.
  [[nodiscard]] const Steering& steering() const noexcept { return steering_; }

  [[nodiscard]] std::size_t dof() const noexcept { return weight_.size(); }
  [[nodiscard]] double lower(std::size_t joint) const noexcept { return lower_[joint]; }
  [[nodiscard]] double upper(std::size_t joint) const noexcept { return upper_[joint]; }

  void to_joints(std::span<const double> u, std::span<double> q) const noexcept {
    for (std::size_t j = 0; j < weight_.size(); ++j) q[j] = u[j] / weight_[j];
  }
  void from_joints(std::span<const double> q, std::span<double> u) const noexcept {
    for (std::size_t j = 0; j < weight_.size(); ++j) u[j] = q[j] * weight_[j];
  }

 private:
  std::vector<Eigen::VectorXd> goals_;
  std::vector<double> weight_;  // per unit
  Steering steering_;
  std::vector<double> lower_;  // scaled
  std::vector<double> upper_;
};

}  // namespace sidestep::joint_paths
