#include "search.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <memory>
#include <numbers>
#include <utility>

#include <ompl/base/MotionValidator.h>
#include <ompl/base/spaces/RealVectorStateSpace.h>
#include <Eigen/Core>

namespace sidestep::ompl_optimiser {
namespace {

constexpr double kTurn_rad = 2.0 * std::numbers::pi;
constexpr double kTurnBeyond_rad = 1.5 * std::numbers::pi;
constexpr double kLeastLever_m = 0.02;  // per rad

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

/// The goal, or with `any_turn` two equivalents of each joint that turns freely: the nearest to the
/// start and the next the other way round, in all combinations, fewest of the latter first.
std::vector<Eigen::VectorXd> goals_of(const Problem& problem, bool any_turn) {
  const std::vector<Joint>& joints = problem.robot->description().joints;
  std::vector<Eigen::VectorXd> goals{problem.goal.q};
  for (std::size_t j = 0; any_turn && j < joints.size(); ++j) {
    if (!turns_freely(joints[j])) continue;
    const auto at = static_cast<Eigen::Index>(j);
    const double start = problem.start.q[at];
    const double turn_rad = std::remainder(problem.goal.q[at] - start, kTurn_rad);
    const std::size_t count = goals.size();
    for (std::size_t i = 0; i < count; ++i) {
      goals[i][at] = start + turn_rad;
      goals.push_back(goals[i]);
      goals.back()[at] -= std::copysign(kTurn_rad, turn_rad);
    }
  }
  return goals;
}

Range bounds_of(const Problem& problem, std::size_t joint, bool any_turn) {
  const Joint& limits = problem.robot->description().joints[joint];
  const double start = problem.start.q[static_cast<Eigen::Index>(joint)];
  const double goal = problem.goal.q[static_cast<Eigen::Index>(joint)];
  if (any_turn && turns_freely(limits)) return {start - kTurn_rad, start + kTurn_rad};
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

/// How far a unit of each joint moves the sphere that it moves farthest, at the start or the goal.
std::vector<double> ways_per_unit(const Problem& problem) {
  const RobotDescription& robot = problem.robot->description();
  const std::size_t dof = robot.joints.size();
  const std::size_t spheres = robot.spheres.size();
  std::vector<Eigen::Vector3d> centres(spheres);
  std::vector<Eigen::Vector3d> jacobians(spheres * dof);
  std::vector<double> ways(dof, 0.0);
  Scratch scratch;
  for (const RobotState* state : {&problem.start, &problem.goal}) {
    problem.robot->sphere_jacobians({state->q.data(), dof}, centres, jacobians, scratch);
    for (std::size_t i = 0; i < jacobians.size(); ++i) {
      ways[i % dof] = std::max(ways[i % dof], jacobians[i].norm());
    }
  }
  return ways;
}

/// Weights of `motion`. A joint that moves no centre, as the last of a wrist, weighs what it takes
/// to move one by kLeastLever_m a radian.
std::vector<double> motion_weights(const Problem& problem) {
  const std::vector<Joint>& joints = problem.robot->description().joints;
  std::vector<double> weights = ways_per_unit(problem);
  double fastest = 0.0;
  for (std::size_t j = 0; j < joints.size(); ++j) {
    weights[j] = std::max(weights[j], kLeastLever_m);
    fastest = std::max(fastest, weights[j] * joints[j].max_velocity);
  }
  for (double& weight : weights) weight /= fastest;
  return weights;
}

std::vector<double> weights_of(const Problem& problem, const JointMetric& metric) {
  const std::vector<Joint>& joints = problem.robot->description().joints;
  std::vector<double> weights;
  if (metric.name == "motion") {
    weights = motion_weights(problem);
  } else {
    for (const Joint& joint : joints) weights.push_back(1.0 / joint.max_velocity);
  }
  for (std::size_t j = 0; metric.weights.is_map() && j < joints.size(); ++j) {
    if (const Node* given = metric.weights.find(joints[j].name)) {
      weights[j] = given->as_double().value();
    }
  }
  return weights;
}

}  // namespace

Result<void> check_weights(const JointMetric& metric, const RobotDescription& robot) {
  if (!metric.weights.is_map()) return {};
  std::vector<std::string> names;
  for (const Joint& joint : robot.joints) names.push_back(joint.name);
  for (const Node::Entry& entry : metric.weights.entries()) {
    if (std::ranges::find(names, entry.key) != names.end()) continue;
    return fail(ErrorCode::kInvalidArgument,
                "weights names the joint '" + entry.key + "', which " + robot.name + " has not", {},
                did_you_mean(entry.key, names));
  }
  return {};
}

JointSpace::JointSpace(const Problem& problem, const JointMetric& metric, bool any_turn)
    : goals_(goals_of(problem, any_turn)), weight_(weights_of(problem, metric)) {
  for (std::size_t j = 0; j < weight_.size(); ++j) {
    const Range range = bounds_of(problem, j, any_turn);
    lower_.push_back(range.lower * weight_[j]);
    upper_.push_back(range.upper * weight_[j]);
  }
}

namespace ob = ::ompl::base;

Search::Search(JointSpace space, Checker& checker, const Deadline& deadline)
    : space_(std::move(space)),
      checker_(checker),
      deadline_(deadline),
      q_from_(space_.dof()),
      q_to_(space_.dof()) {}

bool Search::is_clear(const ob::State* state) {
  const std::scoped_lock lock(mutex_);
  to_joints(state, q_from_);
  return checker_.is_clear(q_from_);
}

bool Search::is_clear(const ob::State* from, const ob::State* to, double resolution_m) {
  if (deadline_.expired()) return false;  // nothing more is to be found
  const std::scoped_lock lock(mutex_);
  to_joints(from, q_from_);
  to_joints(to, q_to_);
  return checker_.is_clear(q_from_, q_to_, resolution_m);
}

void Search::to_joints(const ob::State* state, std::span<double> q) const {
  const double* u = state->as<ob::RealVectorStateSpace::StateType>()->values;
  space_.to_joints({u, space_.dof()}, q);
}

void Search::from_joints(std::span<const double> q, ob::State* state) const {
  double* u = state->as<ob::RealVectorStateSpace::StateType>()->values;
  space_.from_joints(q, {u, space_.dof()});
}

namespace {

constexpr int kLastValidHalvings = 6;

/// A vector space without projections, if possible: making them takes longer than many a search.
class JointStates final : public ob::RealVectorStateSpace {
 public:
  JointStates(unsigned dof, bool is_projected)
      : ob::RealVectorStateSpace(dof), is_projected_(is_projected) {}
  void registerProjections() override {
    if (is_projected_) ob::RealVectorStateSpace::registerProjections();
  }
  /// The same number as the base's, without waiting for each joint's sum.
  double distance(const ob::State* a, const ob::State* b) const override {
    const auto count = static_cast<Eigen::Index>(dimension_);
    const Eigen::Map<const Eigen::VectorXd> from(a->as<StateType>()->values, count);
    const Eigen::Map<const Eigen::VectorXd> to(b->as<StateType>()->values, count);
    return (to - from).norm();
  }

 private:
  bool is_projected_;
};

class ClearStates final : public ob::StateValidityChecker {
 public:
  ClearStates(ob::SpaceInformation* information, Search& search, bool is_left_to_motions)
      : ob::StateValidityChecker(information),
        search_(search),
        is_left_to_motions_(is_left_to_motions) {}
  using ob::StateValidityChecker::isValid;
  bool isValid(const ob::State* state) const override {
    return si_->satisfiesBounds(state) && (is_left_to_motions_ || search_.is_clear(state));
  }

 private:
  Search& search_;
  bool is_left_to_motions_;
};

class ClearMotions final : public ob::MotionValidator {
 public:
  ClearMotions(ob::SpaceInformation* information, Search& search, double resolution_m)
      : ob::MotionValidator(information), search_(search), resolution_m_(resolution_m) {}

  bool checkMotion(const ob::State* from, const ob::State* to) const override {
    const bool is_clear = si_->satisfiesBounds(to) && search_.is_clear(from, to, resolution_m_);
    ++(is_clear ? valid_ : invalid_);
    return is_clear;
  }

  bool checkMotion(const ob::State* from, const ob::State* to,
                   std::pair<ob::State*, double>& last_valid) const override {
    if (checkMotion(from, to)) return true;
    ob::State* part = si_->allocState();
    double clear = 0.0;
    double step = 0.5;
    for (int i = 0; i < kLastValidHalvings; ++i, step *= 0.5) {
      si_->getStateSpace()->interpolate(from, to, clear + step, part);
      if (si_->satisfiesBounds(part) && search_.is_clear(from, part, resolution_m_)) clear += step;
    }
    si_->freeState(part);
    last_valid.second = clear;
    if (last_valid.first != nullptr) {
      si_->getStateSpace()->interpolate(from, to, clear, last_valid.first);
    }
    return false;
  }

 private:
  Search& search_;
  double resolution_m_;
};

}  // namespace

ob::SpaceInformationPtr make_information(Search& search, const SearchSettings& settings) {
  const JointSpace& joints = search.space();
  auto space =
      std::make_shared<JointStates>(static_cast<unsigned>(joints.dof()), settings.is_projected);
  ob::RealVectorBounds bounds(static_cast<unsigned>(joints.dof()));
  for (std::size_t j = 0; j < joints.dof(); ++j) {
    // A joint whose range is a point still needs a little width for OMPL.
    bounds.setLow(static_cast<unsigned>(j), joints.lower(j));
    bounds.setHigh(static_cast<unsigned>(j), std::max(joints.upper(j), joints.lower(j) + 1e-9));
  }
  space->setBounds(bounds);
  auto information = std::make_shared<ob::SpaceInformation>(space);
  information->setStateValidityChecker(
      std::make_shared<ClearStates>(information.get(), search, settings.checks_motions_to_states));
  information->setMotionValidator(
      std::make_shared<ClearMotions>(information.get(), search, settings.resolution_m));
  information->setup();
  return information;
}

}  // namespace sidestep::ompl_optimiser
