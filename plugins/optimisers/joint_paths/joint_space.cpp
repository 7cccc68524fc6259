#include "joint_space.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>
#include <utility>

namespace sidestep::joint_paths {
namespace {

constexpr double kTurn_rad = 2.0 * std::numbers::pi;
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

bool turns_freely(const Joint& joint) {
  return joint.type != Joint::Type::kPrismatic && !std::isfinite(joint.lower) &&
         !std::isfinite(joint.upper);
}

/// Two equivalents of each joint that turns freely: the nearest to the start and the next the other
/// way round, in all combinations, fewest of the latter first.
std::vector<Eigen::VectorXd> turned(const Problem& problem, const Eigen::VectorXd& goal) {
  const std::vector<Joint>& joints = problem.robot->description().joints;
  std::vector<Eigen::VectorXd> goals{goal};
  for (std::size_t j = 0; j < joints.size(); ++j) {
    if (!turns_freely(joints[j])) continue;
    const auto at = static_cast<Eigen::Index>(j);
    const double start = problem.start.q[at];
    const double turn_rad = std::remainder(goal[at] - start, kTurn_rad);
    const std::size_t count = goals.size();
    for (std::size_t i = 0; i < count; ++i) {
      goals[i][at] = start + turn_rad;
      goals.push_back(goals[i]);
      goals.back()[at] -= std::copysign(kTurn_rad, turn_rad);
    }
  }
  return goals;
}

Range bounds_of(const Problem& problem, std::span<const Eigen::VectorXd> goals, std::size_t joint,
                bool any_turn) {
  const Joint& limits = problem.robot->description().joints[joint];
  const auto at = static_cast<Eigen::Index>(joint);
  const double start = problem.start.q[at];
  if (any_turn && turns_freely(limits)) return {start - kTurn_rad, start + kTurn_rad};
  Range ends{start, start};
  for (const Eigen::VectorXd& goal : goals) {
    ends = {std::min(ends.lower, goal[at]), std::max(ends.upper, goal[at])};
  }
  Range range{limits.lower, limits.upper};
  if (limits.type == Joint::Type::kPrismatic) {
    if (!std::isfinite(limits.upper - limits.lower) || limits.upper - limits.lower > 5.0) {
      const Range inside = inside_field(problem, joint);
      range = {std::max(range.lower, inside.lower), std::min(range.upper, inside.upper)};
    }
  } else {
    range.lower = std::max(range.lower, ends.lower - kTurnBeyond_rad);
    range.upper = std::min(range.upper, ends.upper + kTurnBeyond_rad);
  }
  return {std::min(range.lower, ends.lower), std::max(range.upper, ends.upper)};
}

}  // namespace

std::vector<double> motion_weights(const Problem& problem, double least_m) {
  const RobotDescription& robot = problem.robot->description();
  const std::size_t dof = robot.joints.size();
  const std::size_t spheres = robot.spheres.size();
  std::vector<Eigen::Vector3d> centres(spheres);
  std::vector<Eigen::Vector3d> jacobians(spheres * dof);
  std::vector<double> ways(dof, least_m);
  Scratch scratch;
  for (const RobotState* state : {&problem.start, &problem.goal}) {
    problem.robot->sphere_jacobians({state->q.data(), dof}, centres, jacobians, scratch);
    for (std::size_t i = 0; i < jacobians.size(); ++i) {
      ways[i % dof] = std::max(ways[i % dof], jacobians[i].norm());
    }
  }
  return ways;
}

JointSpace::JointSpace(const Problem& problem, std::span<const Eigen::VectorXd> goals,
                       std::vector<double> weights, bool any_turn)
    : goals_(goals.begin(), goals.end()),
      weight_(std::move(weights)),
      steering_(problem.robot->description(), weight_) {
  if (any_turn) {
    goals_.clear();
    for (const Eigen::VectorXd& goal : goals) {
      for (Eigen::VectorXd& end : turned(problem, goal)) goals_.push_back(std::move(end));
    }
  }
  for (std::size_t j = 0; j < weight_.size(); ++j) {
    const Range range = bounds_of(problem, goals, j, any_turn);
    lower_.push_back(range.lower * weight_[j]);
    upper_.push_back(range.upper * weight_[j]);
  }
}

}  // namespace sidestep::joint_paths
