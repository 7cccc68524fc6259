#include "obstacle_functional.hpp"

#include <algorithm>
#include <limits>

namespace sidestep {

ClearanceCost clearance_cost(double clearance_m, double epsilon_m) noexcept {
  if (clearance_m >= epsilon_m) return {0.0, 0.0};
  if (clearance_m < 0.0) return {0.5 * epsilon_m - clearance_m, -1.0};
  const double within_m = clearance_m - epsilon_m;  // keeps NaN
  return {0.5 * within_m * within_m / epsilon_m, within_m / epsilon_m};
}

ObstacleFunctional::ObstacleFunctional(const Problem& problem, double epsilon_m)
    : problem_(&problem),
      epsilon_m_(std::max(epsilon_m, problem.collision_margin_m)),
      floor_(problem.space, problem.robot->description()),
      spheres_(problem.robot->description().spheres.size()) {}

double ObstacleFunctional::add_gradient(const WaypointStates& states, double weight,
                                        Waypoints& gradient) {
  if (spheres_ == 0 || (!problem_->field && !problem_->space.floor)) return 0.0;
  find_costs(states);
  const double cost = push_centres();
  pull_back(states, weight, gradient);
  return cost;
}

void ObstacleFunctional::find_costs(const WaypointStates& states) {
  const StateBatch all = states.everywhere();
  const std::size_t points = spheres_ * static_cast<std::size_t>(all.count);
  centres_m_.resize(points);
  clearance_m_.assign(points, std::numeric_limits<double>::infinity());
  gradients_.assign(points, Eigen::Vector3d::Zero());
  statuses_.resize(points);
  problem_->robot->sphere_centres(all.q, centres_m_, scratch_);
  if (problem_->field) {
    query_with_policy(*problem_->field, problem_->space, centres_m_, clearance_m_, gradients_,
                      statuses_);
  }
  const auto& described = problem_->robot->description().spheres;
  for (std::size_t p = 0; p < points; ++p) {
    clearance_m_[p] -= described[p % spheres_].radius_m;
    const double above_m = floor_(p % spheres_, centres_m_[p]);
    if (above_m >= clearance_m_[p]) continue;
    clearance_m_[p] = above_m;
    gradients_[p] = Eigen::Vector3d::UnitZ();
  }
}

/// F, and its derivative by every centre.
double ObstacleFunctional::push_centres() {
  pushes_.assign(centres_m_.size(), Eigen::Vector3d::Zero());
  double sum = 0.0;
  for (std::size_t p = spheres_; p + spheres_ < centres_m_.size(); ++p) {
    const auto [cost, slope] = clearance_cost(clearance_m_[p], epsilon_m_);
    if (cost == 0.0) continue;
    const Eigen::Vector3d way_m = 0.5 * (centres_m_[p + spheres_] - centres_m_[p - spheres_]);
    const double length_m = way_m.norm();
    sum += cost * length_m;
    if (length_m <= 0.0) continue;
    pushes_[p] += slope * length_m * gradients_[p];
    const Eigen::Vector3d apart = 0.5 * cost / length_m * way_m;
    pushes_[p + spheres_] += apart;
    pushes_[p - spheres_] -= apart;
  }
  return sum;
}

void ObstacleFunctional::pull_back(const WaypointStates& states, double weight,
                                   Waypoints& gradient) {
  const auto& described = problem_->robot->description().spheres;
  forces_.clear();
  for (std::size_t p = 0; p < pushes_.size(); ++p) {
    if (pushes_[p].isZero(0.0)) continue;
    forces_.push_back({static_cast<int>(p / spheres_), described[p % spheres_].link, pushes_[p],
                       centres_m_[p].cross(pushes_[p])});
  }
  const auto d = static_cast<std::size_t>(states.dof());
  joint_forces_.resize(forces_.size() * d);
  problem_->robot->pull_back(states.everywhere().q, forces_, joint_forces_, scratch_);
  by_q_.setZero(states.dof(), states.states());
  by_qdot_.setZero(states.dof(), states.states());
  for (std::size_t k = 0; k < forces_.size(); ++k) {
    by_q_.col(forces_[k].row) +=
        weight * Eigen::Map<const Eigen::VectorXd>(&joint_forces_[k * d], states.dof());
  }
  states.pull_back(by_q_, by_qdot_, gradient);
}

}  // namespace sidestep
