#include <array>
#include <cmath>
#include <numbers>
#include <utility>

#include <sidestep/core/index.hpp>
#include <sidestep/trajectory/retime.hpp>
#include <sidestep/trajectory/splice.hpp>

#include "replanner_impl.hpp"

namespace sidestep {
namespace {

constexpr std::array kDistances_m{0.25, 0.5, 0.75, 1.0, 1.5};
constexpr int kDirections = 16;
constexpr int kStages = 20;       ///< Of the timing of a straight line.
constexpr double kSpare_s = 1.0;  ///< By which a robot is aside before somebody comes.
/// Where no place is clear for good, one that is so for longer by this is worth the way.
constexpr double kWorth_s = 1.0;

/// Of a straight line of the base, on which it is no faster than one of its joints may be.
MotionLimits limits_along(MotionLimits limits, const std::array<int, 2>& base,
                          const Eigen::Vector2d& direction) {
  for (auto* values : {&limits.velocity, &limits.acceleration}) {
    const double least = std::min((*values)[idx(base[0])], (*values)[idx(base[1])]);
    for (const int axis : {0, 1})
      (*values)[idx(base[idx(axis)])] = least * std::abs(direction[axis]);
  }
  return limits;
}

}  // namespace

bool Replanner::Impl::step_aside(const detail::Departure& departure) {
  const bool is_at_fault =
      halted && halted->reason != Reason::kBlocked && halted->reason != Reason::kMoving;
  const auto predicted = predicted_from(now);
  if (!predicted || is_at_fault) return false;
  const Trajectory& lead = departure.lead;
  const Motion standing{
      joined(lead, resting(lead.q(lead.size() - 1), settings.prediction_horizon_s)), now};
  const auto conflict = prediction_check.first_conflict(standing.trajectory, 0.0, *predicted);
  if (!conflict) return false;
  detail::SearchResult found;
  found.guess = "aside";
  found.plan = find_aside(departure, *predicted, *conflict);
  if (!found.plan || conflict->time_s > found.plan->trajectory.duration_s() + kSpare_s)
    return false;
  return follow(found, Reason::kAside, describe(*conflict, standing));
}

std::optional<detail::FoundPlan> Replanner::Impl::find_aside(
    const detail::Departure& departure, const PredictionOnClock& predicted,
    const PredictedConflict& standing) const {
  const RobotDescription& robot = parts.robot->description();
  const auto base = robot.planar_base();
  if (!base) return std::nullopt;
  const Trajectory& lead = departure.lead;
  Trajectory line = make_trajectory(lead.dof, 2, 1.0);
  for (const int state : {0, 1}) std::ranges::copy(lead.q(lead.size() - 1), line.q(state).begin());
  const auto place = [&](std::span<const double> q) {
    return Eigen::Vector2d(q[idx((*base)[0])], q[idx((*base)[1])]);
  };
  const Eigen::Vector2d from_m = place(line.q(0)), way_m = place(as_span(parts.goal.q)) - from_m;
  const double brake_s = lead.duration_s() + settings.replan_period_s + settings.search_s();
  std::optional<detail::FoundPlan> best;
  double clear_s = standing.time_s + kWorth_s;
  for (const double distance_m : kDistances_m) {
    for (int k = 0; k < kDirections; ++k) {
      // The goal's direction first, then to either side of it.
      const double turns = (k % 2 == 0 ? -0.5 : 0.5) * ((k + 1) / 2 * 2) / kDirections;
      const double angle = std::atan2(way_m.y(), way_m.x()) + 2.0 * std::numbers::pi * turns;
      const Eigen::Vector2d direction(std::cos(angle), std::sin(angle));
      bool is_in_limits = true;
      for (const int axis : {0, 1}) {
        const int joint = (*base)[idx(axis)];
        double& q = line.q(1)[idx(joint)];
        q = from_m[axis] + distance_m * direction[axis];
        is_in_limits &= q >= robot.joints[idx(joint)].lower && q <= robot.joints[idx(joint)].upper;
      }
      if (!is_in_limits) continue;
      const auto timed = retime(line, limits_along(parts.limits, *base, direction),
                                {.least_stages = kStages, .stop_at_goal = true});
      if (!timed) continue;
      const Trajectory motion = joined(lead, timed->trajectory);
      const Trajectory and_rest = joined(motion, resting(line.q(1), settings.prediction_horizon_s));
      const auto conflict = prediction_check.first_conflict(and_rest, 0.0, predicted);
      if (conflict && conflict->time_s <= clear_s) continue;
      if (reach.first_reach(motion, 0.0, brake_s, now)) continue;
      const auto verdict = full_check->check(motion, 0.0, Deadline());
      if (!verdict || !verdict->valid()) continue;
      best.emplace();
      best->trajectory = motion;
      best->takeover_s = lead.duration_s();
      best->is_aside = true;
      if (!conflict) return best;
      clear_s = conflict->time_s;
    }
  }
  return best;
}

void Replanner::Impl::look_for_other_goal() {
  constexpr double kAgain_s = 1.0;
  const bool is_early = asked_for_goal && now.seconds() - asked_for_goal->seconds() < kAgain_s;
  const auto is_blocked = [&](const Eigen::VectorXd& q) {
    return checks_of_robot.state_violation(field, parts.space, margin_m, as_span(q)).has_value();
  };
  if (!parts.other_goal || is_early || !is_blocked(parts.goal.q)) return;
  asked_for_goal = now;
  const auto other = parts.other_goal(field);
  if (other && !is_blocked(*other)) parts.goal.q = *other;
}

detail::Departure Replanner::Impl::departure_from_end(const Braking& stop) const {
  const double now_s = stop.time_s(now);
  detail::Departure departure;
  departure.lead = cut(stop.trajectory, now_s,
                       std::max(stop.trajectory.duration_s(), now_s + settings.takeover_s));
  return departure;
}

}  // namespace sidestep
