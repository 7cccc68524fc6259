#pragma once

#include <span>
#include <vector>

#include <sidestep/planning/problem.hpp>

namespace sidestep::ompl_optimiser {

/// The space that is searched: each joint's position divided by its velocity limit, so that
/// distances are (Euclidean) times, and the bounds within which samples fall.
///
/// Bounds are the joints' limits. A prismatic joint without limits (a base) is bounded by where
/// the robot's spheres still lie inside the field; a joint that turns without limits, by one and
/// a half half-turns beyond start and goal. It is a real line, never wrapped: a goal one turn
/// away is one turn away.
class JointSpace {
 public:
  explicit JointSpace(const Problem& problem);

  [[nodiscard]] std::size_t dof() const noexcept { return speed_.size(); }
  [[nodiscard]] double lower(std::size_t joint) const noexcept { return lower_[joint]; }
  [[nodiscard]] double upper(std::size_t joint) const noexcept { return upper_[joint]; }

  void to_joints(std::span<const double> u, std::span<double> q) const noexcept {
    for (std::size_t j = 0; j < speed_.size(); ++j) q[j] = u[j] * speed_[j];
  }
  void from_joints(std::span<const double> q, std::span<double> u) const noexcept {
    for (std::size_t j = 0; j < speed_.size(); ++j) u[j] = q[j] / speed_[j];
  }

 private:
  std::vector<double> speed_;
  std::vector<double> lower_;  // scaled
  std::vector<double> upper_;
};

}  // namespace sidestep::ompl_optimiser
