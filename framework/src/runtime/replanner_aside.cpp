#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>

#include <sidestep/core/index.hpp>
#include <sidestep/trajectory/retime.hpp>
#include <sidestep/trajectory/splice.hpp>

#include "replanner_impl.hpp"

namespace sidestep {
namespace {

/// Distances of the candidates from where the base stands.
constexpr std::array kDistances_m{0.25, 0.5, 0.75, 1.0, 1.5};
constexpr int kDirections = 16;
constexpr int kStages = 20;       ///< Of the timing of a straight line.
constexpr double kSpare_s = 1.0;  ///< Between the end of the motion and the predicted contact.
/// A candidate that is not clear for good has to be clear for longer than the robot is where it
/// stands.
constexpr double kWorth_s = 1.0;

/// Unit vectors along which the base can move from `q`: all around, the one towards the goal first,
/// then on either side of it; ahead and back, if it rolls.
std::vector<Eigen::Vector2d> directions_from(const Eigen::Vector2d& way_m,
                                             std::span<const double> q,
                                             const std::optional<RollingBase>& rolling) {
  if (rolling) {
    const double yaw = q[idx(rolling->yaw)];
    const Eigen::Vector2d ahead(std::cos(yaw), std::sin(yaw));
    if (ahead.dot(way_m) < 0.0) return {-ahead, ahead};
    return {ahead, -ahead};
  }
  std::vector<Eigen::Vector2d> directions(kDirections);
  for (int k = 0; k < kDirections; ++k) {
    const int turn = (k % 2 == 0 ? -1 : 1) * ((k + 1) / 2);
    const double angle =
        std::atan2(way_m.y(), way_m.x()) + 2.0 * std::numbers::pi * turn / kDirections;
    directions[idx(k)] = {std::cos(angle), std::sin(angle)};
  }
  return directions;
}

/// Limits under which the base is no faster along a line than the slower of its two joints.
MotionLimits limits_along(MotionLimits limits, const std::array<int, 2>& base,
                          const Eigen::Vector2d& direction) {
  if (limits.rolling) return limits;  // its speed along its wheels is limited anyway
  for (auto* values : {&limits.velocity, &limits.acceleration}) {
    const double least = std::min((*values)[idx(base[0])], (*values)[idx(base[1])]);
    for (const int axis : {0, 1}) {
      (*values)[idx(base[idx(axis)])] = least * std::abs(direction[axis]);
    }
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
  const auto q = lead.q(lead.size() - 1);
  const Motion standing{joined(lead, resting(q, settings.prediction_horizon_s)), now};
  const auto conflict = prediction_check.first_conflict(standing.trajectory, 0.0, *predicted);
  if (!conflict) return false;
  detail::SearchResult found;
  found.guess = "aside";
  found.plan = find_aside(departure, *predicted, *conflict);
  if (!found.plan || !is_in_time()) return false;
  if (conflict->time_s > found.plan->trajectory.duration_s() + kSpare_s) return false;
  return follow(found, Reason::kAside, describe(*conflict, standing));
}

std::optional<detail::FoundPlan> Replanner::Impl::find_aside(
    const detail::Departure& departure, const PredictionOnClock& predicted,
    const PredictedConflict& standing) const {
  const auto base = parts.robot->description().planar_base();
  if (!base) return std::nullopt;
  const Trajectory& lead = departure.lead;
  const auto q = lead.q(lead.size() - 1);
  const auto place = [&](std::span<const double> at) {
    return Eigen::Vector2d(at[idx((*base)[0])], at[idx((*base)[1])]);
  };
  const auto directions = directions_from(place(as_span(parts.goal.q)) - place(q), q,
                                          parts.robot->description().rolling);
  const double brake_s = lead.duration_s() + settings.replan_period_s + settings.search_s();
  std::optional<detail::FoundPlan> best;
  double clear_s = standing.time_s + kWorth_s;
  for (const double distance_m : kDistances_m) {
    for (const Eigen::Vector2d& direction : directions) {
      if (!is_in_time()) return best;
      const auto way = base_motion(q, *base, distance_m, direction);
      if (!way) continue;
      const Trajectory motion = joined(lead, *way);
      const Trajectory and_rest =
          joined(motion, resting(motion.q(motion.size() - 1), settings.prediction_horizon_s));
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

std::optional<Trajectory> Replanner::Impl::base_motion(std::span<const double> q,
                                                       const std::array<int, 2>& base,
                                                       double distance_m,
                                                       const Eigen::Vector2d& direction) const {
  Trajectory line = make_trajectory(static_cast<int>(q.size()), 2, 1.0);
  for (const int state : {0, 1}) std::ranges::copy(q, line.q(state).begin());
  for (const int axis : {0, 1}) {
    const int joint = base[idx(axis)];
    const Joint& its = parts.robot->description().joints[idx(joint)];
    double& end = line.q(1)[idx(joint)];
    end += distance_m * direction[axis];
    if (end < its.lower || end > its.upper) return std::nullopt;
  }
  auto timed = retime(line, limits_along(parts.limits, base, direction),
                      {.least_stages = kStages, .stop_at_goal = true});
  if (!timed) return std::nullopt;
  return std::move(timed->trajectory);
}

void Replanner::Impl::come_back(const Driving& driving) {
  if (is_due()) (void)replan(departure_from(driving), Reason::kAside, "the robot is aside");
}

}  // namespace sidestep
