#include "joint_space.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>

namespace sidestep::ompl_optimiser {
namespace {

constexpr double kTurnBeyond_rad = 1.5 * std::numbers::pi;

struct Range {
  double lower;
  double upper;
};

/// Where a joint that shifts the robot along d (per unit) leaves at least one sphere's centre
/// inside the field, all other joints as at the start.
Range inside_field(const Problem& problem, std::size_t joint) {
  const RobotDescription& robot = problem.robot->description();
  const std::size_t dof = robot.joints.size();
  const std::size_t spheres = robot.spheres.size();
  const GridSpec& grid = problem.field->info().grid;
  std::vector<Eigen::Vector3d> centres(spheres);
  std::vector<Eigen::Vector3d> jacobians(spheres * dof);
  Scratch scratch;
  problem.robot->sphere_jacobians({problem.start.q.data(), dof}, centres, jacobians, scratch);
  const double reach_m = (grid.upper_m() - grid.origin_m).norm();
  const double now = problem.start.q[static_cast<Eigen::Index>(joint)];
  Range range{std::numeric_limits<double>::infinity(), -std::numeric_limits<double>::infinity()};
  for (std::size_t s = 0; s < spheres; ++s) {
    const Eigen::Vector3d d = jacobians[s * dof + joint];
    Range of_sphere{now - reach_m, now + reach_m};
    for (int axis = 0; axis < 3; ++axis) {
      if (std::abs(d[axis]) < 1e-6) continue;
      const double a = now + (grid.origin_m[axis] - centres[s][axis]) / d[axis];
      const double b = now + (grid.upper_m()[axis] - centres[s][axis]) / d[axis];
      of_sphere.lower = std::max(of_sphere.lower, std::min(a, b));
      of_sphere.upper = std::min(of_sphere.upper, std::max(a, b));
    }
    range.lower = std::min(range.lower, of_sphere.lower);
    range.upper = std::max(range.upper, of_sphere.upper);
  }
  return spheres == 0 ? Range{now - reach_m, now + reach_m} : range;
}

Range bounds_of(const Problem& problem, std::size_t joint) {
  const Joint& limits = problem.robot->description().joints[joint];
  const double start = problem.start.q[static_cast<Eigen::Index>(joint)];
  const double goal = problem.goal.q[static_cast<Eigen::Index>(joint)];
  Range range{limits.lower, limits.upper};
  if (limits.type == Joint::Type::kPrismatic) {
    if (!std::isfinite(limits.upper - limits.lower) || limits.upper - limits.lower > 5.0) {
      const Range inside = inside_field(problem, joint);
      range = {std::max(range.lower, inside.lower), std::min(range.upper, inside.upper)};
    }
  } else {
    range.lower = std::max(range.lower, std::min(start, goal) - kTurnBeyond_rad);
    range.upper = std::min(range.upper, std::max(start, goal) + kTurnBeyond_rad);
  }
  return {std::min({range.lower, start, goal}), std::max({range.upper, start, goal})};
}

}  // namespace

JointSpace::JointSpace(const Problem& problem) {
  const std::vector<Joint>& joints = problem.robot->description().joints;
  for (std::size_t j = 0; j < joints.size(); ++j) {
    const Range range = bounds_of(problem, j);
    speed_.push_back(joints[j].max_velocity);
    lower_.push_back(range.lower / speed_[j]);
    upper_.push_back(range.upper / speed_[j]);
  }
}

}  // namespace sidestep::ompl_optimiser
