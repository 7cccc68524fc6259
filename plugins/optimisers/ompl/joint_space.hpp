#pragma once

#include <span>
#include <string>
#include <vector>

#include <Eigen/Core>

#include <sidestep/core/error.hpp>
#include <sidestep/core/node.hpp>
#include <sidestep/planning/problem.hpp>

namespace sidestep::ompl_optimiser {

/// How far apart configurations are: the Euclidean norm of each joint's way times its weight, in s.
struct JointMetric {
  /// `time`: a joint weighs the time that a unit of it takes at full speed. `motion`: how far the
  /// fastest sphere's centre moves with a unit of it, at the start or at the goal, divided by the
  /// highest speed at which any joint can move one.
  std::string name = "time";
  Node weights;  ///< {joint: s per m or rad}, in place of what the metric says; or null.
};

/// Fails with kInvalidArgument for a weight of a joint that the robot has not.
[[nodiscard]] Result<void> check_weights(const JointMetric& metric, const RobotDescription& robot);

/// The space that is searched: each joint's position times its weight, so that distances are
/// (Euclidean) times, and the bounds within which samples fall.
///
/// Bounds are the joints' limits. A prismatic joint without limits (a base) is bounded by where
/// the robot's spheres still lie inside the field; a joint that turns without limits, by one and
/// a half half-turns beyond start and goal. It is a real line, so that trajectories never jump.
/// Without `any_turn` a goal one turn away is one turn away. With it the robot may end a whole
/// number of turns from the goal in such joints: in the nearest equivalent of its angle or the
/// next one the other way round, and the bounds are one turn either way.
class JointSpace {
 public:
  JointSpace(const Problem& problem, const JointMetric& metric, bool any_turn);

  /// Where the robot may end, the nearest first: at least one configuration of dof() values.
  [[nodiscard]] const std::vector<Eigen::VectorXd>& goals() const noexcept { return goals_; }

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
  std::vector<double> weight_;  // s per unit
  std::vector<double> lower_;   // scaled
  std::vector<double> upper_;
};

}  // namespace sidestep::ompl_optimiser
