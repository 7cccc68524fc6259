#include <sidestep/planning/problem.hpp>

#include <algorithm>
#include <cmath>
#include <numbers>
#include <random>
#include <string>

#include <sidestep/core/format.hpp>
#include <sidestep/core/index.hpp>
#include <sidestep/core/seed.hpp>
#include <sidestep/planning/costs.hpp>
#include <sidestep/planning/initial_guess.hpp>
#include <sidestep/planning/optimiser.hpp>

namespace sidestep {
namespace {

std::string text(double value) { return format("%.6g", value); }

Result<void> check_numbers(const Problem& problem) {
  if (problem.support_states < 3) {
    return invalid("a problem needs at least 3 support states, not " +
                   std::to_string(problem.support_states));
  }
  if (!(problem.dt_s > 0.0) || !std::isfinite(problem.dt_s)) {
    return invalid("the time between support states is " + text(problem.dt_s) +
                   " s, but must be positive");
  }
  if (problem.interpolated_checks < 0) {
    return invalid("the number of interpolated checks is negative");
  }
  if (!(problem.speed_fraction > 0.0 && problem.speed_fraction <= 1.0)) {
    return invalid("the speed fraction is " + text(problem.speed_fraction) +
                   ", but must lie in (0, 1]");
  }
  if (!(problem.collision_margin_m >= 0.0) || !std::isfinite(problem.collision_margin_m)) {
    return invalid("the collision margin is " + text(problem.collision_margin_m) +
                   " m, but must not be negative");
  }
  if (!std::isfinite(problem.prediction_from_s)) {
    return invalid("the time at which the prediction is read is not a finite number");
  }
  if (!(problem.prediction_margin_m >= 0.0) || !std::isfinite(problem.prediction_margin_m)) {
    return invalid("the margin from what is predicted is " + text(problem.prediction_margin_m) +
                   " m, but must not be negative");
  }
  if (problem.space.floor && !std::isfinite(problem.space.floor->height_m)) {
    return invalid("the height of the floor is not a finite number");
  }
  for (const CostTerm& term : problem.terms) {
    if (!term.cost) return invalid("a cost term of the problem is missing");
  }
  return {};
}

Result<void> check_joint(const Joint& joint, double qc) {
  if (!(qc > 0.0) || !std::isfinite(qc)) {
    return invalid("qc of joint " + joint.name + " is " + text(qc) + ", but must be positive");
  }
  if (!(joint.lower <= joint.upper)) {
    return invalid("joint " + joint.name + " has its lower limit above its upper one");
  }
  if (!(joint.max_velocity > 0.0)) {
    return invalid("joint " + joint.name + " has a velocity limit of " + text(joint.max_velocity) +
                   ", but it must be positive");
  }
  return {};
}

Result<void> check_state(const RobotDescription& robot, const RobotState& state,
                         const std::string& which) {
  if (state.q.size() != robot.dof() || state.qdot.size() != robot.dof()) {
    return invalid("the " + which + " has " + std::to_string(state.q.size()) + " positions and " +
                   std::to_string(state.qdot.size()) + " velocities, but " + robot.name + " has " +
                   std::to_string(robot.dof()) + " joints");
  }
  for (int j = 0; j < robot.dof(); ++j) {
    const Joint& joint = robot.joints[idx(j)];
    const double q = state.q[j];
    const double qdot = state.qdot[j];
    if (!std::isfinite(q) || !std::isfinite(qdot)) {
      return invalid("joint " + joint.name + " of the " + which + " is not a finite number");
    }
    if (q < joint.lower - kLimitTolerance || q > joint.upper + kLimitTolerance) {
      return invalid("joint " + joint.name + " of the " + which + " is at " + text(q) +
                     ", outside its limits [" + text(joint.lower) + ", " + text(joint.upper) + "]");
    }
    if (std::abs(qdot) > joint.max_velocity + kLimitTolerance) {
      return invalid("joint " + joint.name + " of the " + which + " moves at " + text(qdot) +
                     ", beyond its velocity limit of " + text(joint.max_velocity));
    }
  }
  return {};
}

/// Nothing where nothing is predicted: problems among what stands are not to pay for it.
std::optional<CostTerm> moving_term(const Problem& problem, const CostSettings& settings) {
  if (!problem.prediction || problem.prediction->sets().empty()) return std::nullopt;
  if (settings.epsilon_moving_m <= 0.0) return std::nullopt;
  const double begins_m = std::max(settings.epsilon_moving_m, problem.prediction_margin_m);
  return CostTerm{
      make_moving_obstacle_cost(problem.robot, problem.prediction, problem.prediction_from_s,
                                begins_m, settings.sigma_obstacle),
      Placement::kSupportAndInterpolated};
}

constexpr int kWaves = 3;
constexpr double kLargestBend = 0.4;  // m, rad

/// How far a joint is bent in the first attempt that bends.
double bend_scale(const Joint& joint) {
  return std::min(0.15 * (joint.upper - joint.lower), kLargestBend);
}

}  // namespace

Result<void> Problem::validate() const {
  if (!robot) return invalid("the problem has no robot");
  const RobotDescription& description = robot->description();
  SIDESTEP_TRY(check_numbers(*this));
  if (qc.size() != description.dof()) {
    return invalid("qc has " + std::to_string(qc.size()) + " values, but " + description.name +
                   " has " + std::to_string(description.dof()) + " joints");
  }
  for (int j = 0; j < description.dof(); ++j) {
    const Joint& joint = description.joints[idx(j)];
    SIDESTEP_TRY(check_joint(joint, qc[j]));
  }
  SIDESTEP_TRY(check_state(description, start, "start"));
  return check_state(description, goal, "goal");
}

void add_moving_term(const CostSettings& settings, Problem& problem) {
  if (auto moving = moving_term(problem, settings)) problem.terms.push_back(*std::move(moving));
}

std::vector<CostTerm> standard_terms(const Problem& problem, const CostSettings& settings) {
  std::vector<CostTerm> terms;
  const auto add = [&](std::unique_ptr<StateCost> cost, Placement placement) {
    terms.push_back({std::move(cost), placement});
  };
  const auto everywhere = Placement::kSupportAndInterpolated;
  add(make_state_prior("start", problem.start, settings.sigma_endpoint), Placement::kStart);
  add(settings.hold_goal
          ? make_state_prior("goal", problem.goal, settings.sigma_endpoint)
          : make_velocity_prior("goal_velocity", problem.goal.qdot, settings.sigma_endpoint),
      Placement::kGoal);
  const double begins_m = std::max(settings.epsilon_m, problem.collision_margin_m);
  if (problem.field) {
    add(make_obstacle_cost(problem.robot, problem.field, problem.space, begins_m,
                           settings.sigma_obstacle),
        everywhere);
  }
  const std::optional<Floor>& floor = problem.space.floor;
  if (floor && !spheres_above(*floor, problem.robot->description()).empty()) {
    add(make_floor_cost(problem.robot, *floor, begins_m, settings.sigma_obstacle), everywhere);
  }
  if (auto moving = moving_term(problem, settings)) terms.push_back(*std::move(moving));
  if (settings.sigma_self_collision > 0.0 &&
      !problem.robot->description().self_collision_pairs.empty()) {
    add(make_self_collision_cost(problem.robot, settings.self_collision_epsilon_m,
                                 settings.sigma_self_collision),
        settings.self_collision_placement);
  }
  if (settings.sigma_position_limit > 0.0) {
    add(make_position_limit_cost(problem.robot, settings.position_limit_margin,
                                 settings.sigma_position_limit),
        everywhere);
  }
  if (settings.sigma_velocity_limit > 0.0) {
    add(make_velocity_limit_cost(problem.robot, problem.speed_fraction,
                                 settings.sigma_velocity_limit),
        everywhere);
  }
  if (const RobotDescription& robot = problem.robot->description();
      robot.rolling && settings.sigma_sideways_mps > 0.0) {
    add(make_sideways_cost(robot, settings.sigma_sideways_mps).value(), everywhere);
  }
  return terms;
}

Trajectory straight_line(const Problem& problem) {
  return straight_line(problem.start, problem.goal, problem.support_states, problem.dt_s);
}

Trajectory initial_guess(const Problem& problem, int attempt, std::uint64_t seed) {
  Trajectory guess = straight_line(problem);
  if (attempt == 0) return guess;

  std::mt19937_64 random(derive_seed(seed, "initial_guess/" + std::to_string(attempt)));
  std::normal_distribution<double> normal;
  const std::vector<Joint>& joints = problem.robot->description().joints;
  for (std::size_t j = 0; j < joints.size(); ++j) {
    double amplitudes[kWaves];
    for (int k = 0; k < kWaves; ++k) {
      amplitudes[k] = normal(random) * bend_scale(joints[j]) * std::sqrt(attempt) / (k + 1);
    }
    for (int i = 1; i + 1 < guess.size(); ++i) {
      const double phase = std::numbers::pi * i / (guess.size() - 1);
      double& q = guess.q(i)[j];
      for (int k = 0; k < kWaves; ++k) q += amplitudes[k] * std::sin((k + 1) * phase);
      q = std::clamp(q, joints[j].lower, joints[j].upper);
    }
    // Velocities that fit the bent positions, wherever the limits cut them.
    for (int i = 1; i + 1 < guess.size(); ++i) {
      guess.qdot(i)[j] = (guess.q(i + 1)[j] - guess.q(i - 1)[j]) / (2.0 * problem.dt_s);
    }
  }
  return guess;
}

std::string_view to_string(SolveStatus status) noexcept {
  switch (status) {
    case SolveStatus::kConverged: return "converged";
    case SolveStatus::kIterationLimit: return "iteration_limit";
    case SolveStatus::kDeadline: return "deadline";
    case SolveStatus::kNoPath: return "no_path";
    case SolveStatus::kFailed: return "failed";
  }
  return "failed";
}

Result<void> check_initial(const Problem& problem, const Trajectory& initial) {
  SIDESTEP_TRY(initial.validate());
  const int dof = problem.robot->description().dof();
  if (initial.dof == dof && initial.size() == problem.support_states) return {};
  return invalid("the initial trajectory has " + std::to_string(initial.size()) + " states of " +
                 std::to_string(initial.dof) + " joints, but the problem " +
                 std::to_string(problem.support_states) + " of " + std::to_string(dof));
}

std::string iteration_limit_reason(int iterations, double last_decrease, double cost) {
  return "stopped after " + std::to_string(iterations) +
         " iterations, when the last accepted one still lowered the cost by " +
         format("%.2g %%", 100.0 * last_decrease / (cost + last_decrease));
}

}  // namespace sidestep
