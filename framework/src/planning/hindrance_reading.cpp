#include "hindrance_reading.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <map>

#include <sidestep/core/index.hpp>
#include <sidestep/planning/costs.hpp>
#include <sidestep/planning/goal.hpp>

#include "violation_ledger.hpp"

namespace sidestep {
namespace {

constexpr double kLeastGradient = 1e-6;

}  // namespace

HindranceReading::HindranceReading(const Problem& problem, const CostTerm& term)
    : problem_(problem),
      robot_(problem.robot->description()),
      meaning_(meaning_of(problem, *term.cost)),
      is_at_goal_(term.placement == Placement::kGoal) {
  if (meaning_ == Meaning::kNamed) {
    named_ = residual_groups(*term.cost);
    for (const ResidualGroup& group : named_) groups_.push_back(group.rows);
    return;
  }
  if (meaning_ == Meaning::kFloor) above_floor_ = spheres_above(*problem.space.floor, robot_);
  const auto link_of = [&](std::size_t sphere) {
    return static_cast<std::size_t>(robot_.spheres[sphere].link);
  };
  std::map<std::size_t, std::vector<std::size_t>> groups;
  const auto dof = static_cast<std::size_t>(robot_.dof());
  for (std::size_t row = 0; row < static_cast<std::size_t>(term.cost->residual_count()); ++row) {
    std::size_t key = row;
    if (meaning_ == Meaning::kObstacle) key = link_of(row);
    if (meaning_ == Meaning::kFloor) key = link_of(static_cast<std::size_t>(above_floor_[row]));
    if (meaning_ == Meaning::kStart || meaning_ == Meaning::kGoal) key = row % dof;
    groups[key].push_back(row);
  }
  for (auto& [key, rows] : groups) groups_.push_back(std::move(rows));
}

HindranceReading::Meaning HindranceReading::meaning_of(const Problem& problem,
                                                       const StateCost& cost) {
  const RobotDescription& robot = problem.robot->description();
  const auto is = [&](std::string_view name, std::size_t residuals) {
    return cost.name() == name && static_cast<std::size_t>(cost.residual_count()) == residuals;
  };
  if (problem.field && is("obstacle", robot.spheres.size())) return Meaning::kObstacle;
  const std::optional<Floor>& floor = problem.space.floor;
  if (floor && is("floor", spheres_above(*floor, robot).size())) return Meaning::kFloor;
  if (is("self_collision", robot.self_collision_pairs.size())) return Meaning::kSelfCollision;
  if (is("position_limit", robot.joints.size())) return Meaning::kPositionLimit;
  if (is("velocity_limit", robot.joints.size())) return Meaning::kVelocityLimit;
  const auto fits = [&](const RobotState& state) {
    return state.q.size() == robot.dof() && state.qdot.size() == robot.dof();
  };
  if (fits(problem.start) && is("start", 2 * robot.joints.size())) return Meaning::kStart;
  if (fits(problem.goal) && is("goal", 2 * robot.joints.size())) return Meaning::kGoal;
  if (fits(problem.goal) && is("goal_velocity", robot.joints.size())) return Meaning::kGoalVelocity;
  return Meaning::kNamed;
}

void HindranceReading::tell(const StateRows& rows, std::size_t state, std::size_t row,
                            std::span<const double> residuals, Hindrance& out) const {
  const std::size_t at = state * static_cast<std::size_t>(rows.dof) + row;
  switch (meaning_) {
    case Meaning::kObstacle: return tell_obstacle(rows.q_of(state), row, out);
    case Meaning::kFloor:
      return tell_floor(rows.q_of(state), static_cast<std::size_t>(above_floor_[row]), out);
    case Meaning::kSelfCollision: return tell_self_collision(rows.q_of(state), row, out);
    case Meaning::kPositionLimit: return tell_position(rows.q[at], row, out);
    case Meaning::kVelocityLimit: return tell_velocity(rows.qdot[at], row, out);
    case Meaning::kStart:
    case Meaning::kGoal:
    case Meaning::kGoalVelocity: return tell_endpoint(rows, state, row, out);
    case Meaning::kNamed: return tell_named(row, residuals, out);
  }
}

void HindranceReading::tell_named(std::size_t row, std::span<const double> residuals,
                                  Hindrance& out) const {
  const auto group = std::ranges::find_if(named_, [&](const ResidualGroup& candidate) {
    return std::ranges::find(candidate.rows, row) != candidate.rows.end();
  });
  const auto component = std::ranges::find(group->rows, row) - group->rows.begin();
  const ResidualName& name = group->names[idx(component)];
  const double length = group->length(residuals);
  out.kind = is_at_goal_ ? Hindrance::Kind::kEndpoint : Hindrance::Kind::kOther;
  out.subject = name.quantity + (name.component.empty() ? "" : " " + name.component);
  out.other = name.target;
  out.amount = name.sigma * (name.component.empty() ? length : std::abs(residuals[row]));
  out.unit = name.unit;
  out.broken = is_at_goal_ && !(length <= kGoalToleranceSigmas);
}

void HindranceReading::tell_obstacle(std::span<const double> q, std::size_t sphere,
                                     Hindrance& out) const {
  Scratch scratch;
  std::vector<Eigen::Vector3d> centres_m(robot_.spheres.size());
  problem_.robot->sphere_centres(q, centres_m, scratch);
  const Eigen::Vector3d centre_m = centres_m[sphere];
  double distance_m = 0.0;
  Eigen::Vector3d gradient;
  FieldStatus status = FieldStatus::kKnown;
  query_with_policy(*problem_.field, problem_.space, {&centre_m, 1}, {&distance_m, 1},
                    {&gradient, 1}, {&status, 1});
  out.kind = Hindrance::Kind::kCollision;
  out.subject = robot_.links[idx(robot_.spheres[sphere].link)].name;
  out.amount = robot_.spheres[sphere].radius_m - distance_m;
  out.unit = "m";
  out.broken = !(out.amount <= 0.0);
  out.other = obstacle_name(status, problem_.space);
  // Where unknown space begins, the field does not tell.
  if (status == FieldStatus::kUnknown && out.other != kObstacle) return;
  const double steepness = gradient.norm();
  if (std::isfinite(distance_m) && steepness > kLeastGradient) {
    out.obstacle_m = centre_m - distance_m / steepness * gradient;
  }
}

void HindranceReading::tell_floor(std::span<const double> q, std::size_t sphere,
                                  Hindrance& out) const {
  Scratch scratch;
  std::vector<Eigen::Vector3d> centres_m(robot_.spheres.size());
  problem_.robot->sphere_centres(q, centres_m, scratch);
  const Eigen::Vector3d centre_m = centres_m[sphere];
  out.kind = Hindrance::Kind::kCollision;
  out.subject = robot_.links[idx(robot_.spheres[sphere].link)].name;
  out.other = kFloorName;
  out.amount = -FloorClearance(problem_.space, robot_)(sphere, centre_m);
  out.unit = "m";
  out.broken = !(out.amount <= 0.0);
  out.obstacle_m = {centre_m.x(), centre_m.y(), problem_.space.floor->height_m};
}

void HindranceReading::tell_self_collision(std::span<const double> q, std::size_t pair,
                                           Hindrance& out) const {
  Scratch scratch;
  std::vector<Eigen::Vector3d> centres_m(robot_.spheres.size());
  problem_.robot->sphere_centres(q, centres_m, scratch);
  const auto [first, second] = robot_.self_collision_pairs[pair];
  double closest_m = std::numeric_limits<double>::infinity();
  for (std::size_t a = 0; a < centres_m.size(); ++a) {
    for (std::size_t b = 0; b < centres_m.size(); ++b) {
      if (robot_.spheres[a].link != first || robot_.spheres[b].link != second) continue;
      const double radii_m = robot_.spheres[a].radius_m + robot_.spheres[b].radius_m;
      closest_m = std::min(closest_m, (centres_m[a] - centres_m[b]).norm() - radii_m);
    }
  }
  out.kind = Hindrance::Kind::kSelfCollision;
  out.subject = robot_.links[idx(second)].name;
  out.other = robot_.links[idx(first)].name;
  out.amount = -closest_m;
  out.unit = "m";
  out.broken = !(out.amount <= 0.0);
}

void HindranceReading::tell_position(double q, std::size_t joint, Hindrance& out) const {
  const Joint& of = robot_.joints[joint];
  const bool is_low = of.lower - q > q - of.upper;
  out.kind = Hindrance::Kind::kLimit;
  out.subject = of.name;
  out.other =
      limit_name(of, is_low ? "lower limit" : "upper limit", is_low ? of.lower : of.upper, "");
  out.amount = is_low ? of.lower - q : q - of.upper;
  out.unit = of.unit();
  out.broken = !(out.amount <= kLimitTolerance);
}

void HindranceReading::tell_velocity(double qdot, std::size_t joint, Hindrance& out) const {
  const Joint& of = robot_.joints[joint];
  const double allowed = problem_.speed_fraction * of.max_velocity;
  out.kind = Hindrance::Kind::kLimit;
  out.subject = of.name;
  out.other = limit_name(of, "velocity limit", allowed, "/s");
  out.amount = std::abs(qdot) - allowed;
  out.unit = of.unit() + std::string("/s");
  out.broken = !(out.amount <= kLimitTolerance);
}

void HindranceReading::tell_endpoint(const StateRows& rows, std::size_t state, std::size_t row,
                                     Hindrance& out) const {
  const auto dof = static_cast<std::size_t>(rows.dof);
  const std::size_t joint = row % dof, at = state * dof + joint;
  const RobotState& wanted = meaning_ == Meaning::kStart ? problem_.start : problem_.goal;
  const bool velocity = row >= dof || meaning_ == Meaning::kGoalVelocity;
  const double has = velocity ? rows.qdot[at] : rows.q[at];
  const auto index = static_cast<Eigen::Index>(joint);
  out.kind = Hindrance::Kind::kEndpoint;
  out.subject = robot_.joints[joint].name;
  out.other = meaning_ == Meaning::kStart ? "the start" : "the goal";
  out.amount = std::abs(has - (velocity ? wanted.qdot[index] : wanted.q[index]));
  out.unit = robot_.joints[joint].unit() + std::string(velocity ? "/s" : "");
  out.broken = !(out.amount <= kGoalTolerance);
}

}  // namespace sidestep
