#include <algorithm>
#include <cmath>

#include <sidestep/core/index.hpp>
#include <sidestep/trajectory/splice.hpp>

#include "replanner_impl.hpp"

namespace sidestep {

detail::Departure Replanner::Impl::departure_from(const Motion& motion) const {
  detail::Departure departure;
  const double now_s = motion.time_s(now);
  departure.from_s = now_s + settings.takeover_s;
  departure.lead = cut(motion.trajectory, now_s, departure.from_s);
  departure.followed = &motion.trajectory;
  find_unfinished(departure);
  const auto speeds = departure.lead.qdot(departure.lead.size() - 1);
  departure.is_moving = std::ranges::any_of(speeds, [](double v) { return v != 0.0; });
  return departure;
}

detail::Departure Replanner::Impl::departure_from_end(const Braking& stop) const {
  const double now_s = stop.time_s(now);
  const double end_s = std::max(stop.trajectory.duration_s(), now_s + settings.takeover_s);
  detail::Departure departure;
  departure.lead = cut(stop.trajectory, now_s, end_s);
  return departure;
}

/// Where the lead ends on the last way that was found to the goal: slower motions, and a stop along
/// it, have not left it.
void Replanner::Impl::find_unfinished(detail::Departure& departure) const {
  if (unfinished.size() == 0) return;
  const auto* driving = std::get_if<Driving>(&phase);
  if (driving != nullptr && driving->is_unfinished) {
    departure.unfinished = &unfinished;
    departure.unfinished_from_s = departure.from_s;
    return;
  }
  constexpr double kOnPath = 0.05;  // m, rad
  const auto q = departure.lead.q(departure.lead.size() - 1);
  double least = kOnPath;
  for (int state = 0; state < unfinished.size(); ++state) {
    double off = 0.0;
    for (std::size_t j = 0; j < q.size(); ++j) {
      off = std::max(off, std::abs(unfinished.q(state)[j] - q[j]));
    }
    if (off >= least) continue;
    least = off;
    departure.unfinished = &unfinished;
    departure.unfinished_from_s = unfinished.times_s[idx(state)];
  }
  if (departure.unfinished != nullptr || parts.predictor == nullptr) return;
  // States of a motion that its planner timed are far apart.
  const NearestState nearest = nearest_state(unfinished, q);
  if (nearest.off >= kOnPath) return;
  departure.unfinished = &unfinished;
  departure.unfinished_from_s = nearest.time_s;
}

void Replanner::Impl::depart_from_rest(const RobotState& measured) {
  const auto standing = resting({measured.q.data(), static_cast<std::size_t>(measured.q.size())},
                                settings.takeover_s + settings.replan_period_s);
  if (const auto cause = reach.first_reach(standing, 0.0, standing.duration_s(), now)) {
    last_replan = now;
    if (!halted) halt(Reason::kMoving, *cause);
    return;
  }
  // Where the last motion ended is where the executor still holds the robot.
  Eigen::VectorXd q = measured.q;
  const auto& at = std::get<Resting>(phase).at;
  if (at && (*at - q).cwiseAbs().maxCoeff() <= settings.tracking_tolerance) q = *at;
  constexpr double kBeyond = 0.01;  // m, rad: what a measurement may be off
  const std::vector<Joint>& joints = parts.robot->description().joints;
  for (std::size_t j = 0; j < joints.size(); ++j) {
    double& value = q[static_cast<Eigen::Index>(j)];
    const double inside = std::clamp(value, joints[j].lower, joints[j].upper);
    if (std::abs(value - inside) <= kBeyond) value = inside;
  }
  // An obstacle that came up to a standing robot, or a map that wavers, must not hold it for good.
  use_margin_at(q);
  detail::Departure departure;
  departure.lead = resting({q.data(), joints.size()}, settings.takeover_s);
  find_unfinished(departure);
  const Reason reason = halted ? halted->reason : Reason::kGoal;
  std::string cause = halted ? halted->cause : "the robot is not at its goal";
  if (parts.space.leaving != nullptr) {
    cause += "; it stands in what the map has for an obstacle, and leaves it";
  } else if (margin_m < settings.margin_m) {
    cause += "; it stands within the margin, and keeps " + std::to_string(margin_m) + " m";
  }
  const detail::Departure at_rest = departure;
  if (replan(std::move(departure), reason, cause)) return;
  if (!step_aside(at_rest)) look_for_other_goal();
}

void Replanner::Impl::look_for_other_goal() {
  constexpr double kAgain_s = 1.0;
  const bool is_early = asked_for_goal && now.seconds() - asked_for_goal->seconds() < kAgain_s;
  SpacePolicy space = parts.space;
  space.leaving.reset();  // a goal is nothing to come out of
  const auto is_blocked = [&](const Eigen::VectorXd& q) {
    return checks_of_robot.state_violation(field, space, margin_m, as_span(q)).has_value();
  };
  if (!parts.other_goal || is_early || !is_blocked(parts.goal.q)) return;
  asked_for_goal = now;
  const auto other = parts.other_goal(field);
  if (other && !is_blocked(*other)) parts.goal.q = *other;
}

}  // namespace sidestep
