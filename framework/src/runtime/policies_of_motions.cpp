#include <array>
#include <cmath>

#include <sidestep/core/format.hpp>
#include <sidestep/core/index.hpp>

#include "policy_view.hpp"

namespace sidestep::detail {
namespace {

// What it sends.

/// How far two motions are apart at a time of the second one, which was sent for `start`.
struct Apart {
  double q = 0.0, qdot = 0.0;
};
Apart apart(const PolicyView& view, const Sent& sent, double time_s) {
  const auto dof = idx(sent.trajectory.dof);
  std::vector<double> q(dof), qdot(dof), q_before(dof), qdot_before(dof);
  sent.trajectory.sample(time_s, q, qdot);
  view.before()->sample(view.before_s(sent.start) + time_s, q_before, qdot_before);
  Apart by;
  for (std::size_t j = 0; j < dof; ++j) {
    by.q = std::max(by.q, std::abs(q[j] - q_before[j]));
    by.qdot = std::max(by.qdot, std::abs(qdot[j] - qdot_before[j]));
  }
  return by;
}

/// Whether what was sent goes on from a motion that is not over.
bool goes_on(const PolicyView& view, const std::optional<Sent>& sent) {
  return sent && view.before() != nullptr && view.before()->dof == sent->trajectory.dof &&
         view.before_s(sent->start) < view.before()->duration_s();
}

std::string sends_nonsense(const PolicyView& view) {
  const int dof = view.setup.robot->description().dof();
  for (const ExecutorCall& call : view.step.calls) {
    if (call.kind != Call::kFollow) continue;
    if (call.trajectory->dof != dof) return "a trajectory is sent that is not the robot's";
    const auto sound = call.trajectory->validate();
    if (!sound) return "a broken trajectory is sent: " + sound.error().describe();
  }
  return kKept;
}
std::string sends_for_another_time(const PolicyView& view) {
  for (const ExecutorCall& call : view.step.calls) {
    if (call.kind != Call::kFollow) continue;
    const double after_s = seconds_between(view.step.now, call.start);
    const double took_s = view.setup.settings.limit_wall_time ? view.step.took_s : 0.0;
    if (after_s < -kRounding || after_s > took_s + kRounding) {
      return format("a trajectory is sent for %.4f s from now", after_s);
    }
  }
  return kKept;
}
std::string sends_several(const PolicyView& view) {
  const auto taken = std::ranges::count_if(view.step.calls, [](const ExecutorCall& call) {
    return call.kind == Call::kFollow && call.succeeded;
  });
  return taken > 1 ? "several trajectories are sent at once" : kKept;
}
std::string jumps(const PolicyView& view) {
  const auto sent = view.sent();
  if (!goes_on(view, sent)) return kKept;
  const double by = apart(view, *sent, 0.0).q;
  return by > kRounding ? format("its position jumps by %.3g", by) : kKept;
}
std::string jumps_in_velocity(const PolicyView& view) {
  const auto sent = view.sent();
  if (!goes_on(view, sent)) return kKept;
  const double by = apart(view, *sent, 0.0).qdot;
  return by > kRounding ? format("its velocity jumps by %.3g", by) : kKept;
}
std::string leaves_early(const PolicyView& view) {
  const auto sent = view.sent();
  if (!goes_on(view, sent)) return kKept;
  const double most_s =
      sent->is_stop ? view.setup.settings.stop_lead_s : view.setup.settings.takeover_s;
  const double lead_s = std::min(
      {sent->takeover_s, most_s, view.before()->duration_s() - view.before_s(sent->start)});
  for (const double share : {0.25, 0.5, 0.75, 1.0}) {
    const double by = apart(view, *sent, share * lead_s).q;
    if (by > kRounding) return format("it leaves what was followed by %.3g before that", by);
  }
  return kKept;
}
std::string takes_over_late(const PolicyView& view) {
  const auto sent = view.sent();
  if (!sent || sent->is_stop) return kKept;
  const bool may = sent->event.guess == "after_stop" || sent->event.reason == Reason::kAside;
  const double in_s = seconds_between(view.step.now, sent->event.takeover);
  if (in_s >= -kRounding && (may || in_s <= view.setup.settings.takeover_s + kRounding)) {
    return kKept;
  }
  return format("it takes over %.3f s from now", in_s);
}
std::string splices_badly(const PolicyView& view) {
  constexpr double kMost = 1e-3;
  for (const ReplannerEvent& event : view.step.events) {
    if (!(event.splice_velocity_jump <= kMost)) {
      return format("the new part begins at a velocity off by %.3g", event.splice_velocity_jump);
    }
  }
  return kKept;
}
std::string starts_elsewhere(const PolicyView& view) {
  const auto sent = view.sent();
  const Executor::Measured* measured = view.state();
  if (!sent || view.step.is_end || measured == nullptr) return kKept;
  const auto q = sent->trajectory.q(0);
  const Eigen::Map<const Eigen::VectorXd> at(q.data(), std::ssize(q));
  // What moves has gone on since it was measured.
  if (at.size() != measured->state.q.size() || !view.is_at_rest(measured->state)) return kKept;
  const double off = largest(at - measured->state.q);
  return off > view.setup.settings.tracking_tolerance + kRounding
             ? format("it starts %.3f from where the robot is", off)
             : kKept;
}
std::string sets_out_at_speed(const PolicyView& view) {
  const auto sent = view.sent();
  if (!sent || sent->is_stop || view.before() != nullptr) return kKept;
  for (const double speed : sent->trajectory.qdot(0)) {
    if (std::abs(speed) > kRounding) return format("from rest it begins at %.3g", speed);
  }
  const Executor::Measured* measured = view.state();
  return measured == nullptr || view.is_at_rest(measured->state) ? kKept : "the robot still moves";
}
std::string ends_at_speed(const PolicyView& view) {
  const auto sent = view.sent();
  if (!sent) return kKept;
  for (const double speed : sent->trajectory.qdot(sent->trajectory.size() - 1)) {
    if (std::abs(speed) > view.setup.settings.rest_speed) {
      return format("at its end it moves at %.3g", speed);
    }
  }
  return kKept;
}
/// Until when what was sent has to be valid: all of it, but where its way is known to be free for a
/// while only.
double free_until_s(const PolicyView& view, const Sent& sent) {
  const double end_s = sent.trajectory.duration_s();
  if (sent.event.cause.find("; the way is free for ") == std::string::npos) return end_s;
  // When the first violation begins is known to within the spacing of checks.
  const ReplannerSettings& settings = view.setup.settings;
  return time_before_s(view, sent.trajectory,
                       std::min(end_s, settings.takeover_s + settings.horizon_s),
                       settings.max_step_m);
}
std::string leaves_limits(const PolicyView& view) {
  const auto sent = view.sent();
  return sent ? leaves_joint_limits(view, sent->trajectory, free_until_s(view, *sent)) : kKept;
}
std::string exceeds_velocities(const PolicyView& view) {
  const auto sent = view.sent();
  return sent ? is_too_fast(view, *sent) : kKept;
}
std::string exceeds_accelerations(const PolicyView& view) {
  const auto sent = view.sent();
  return sent && !sent->is_stop ? speeds_up_too_much(view, *sent) : kKept;
}
std::string brakes_too_hard(const PolicyView& view) {
  const auto sent = view.sent();
  return sent && sent->is_stop ? speeds_up_too_much(view, *sent) : kKept;
}

// What is clear.

std::string plan_touches(const PolicyView& view) {
  const auto sent = view.sent();
  if (!sent || sent->is_stop || !view.has_map()) return kKept;
  return touches(view, sent->trajectory, 0.0, free_until_s(view, *sent));
}
std::string stop_touches(const PolicyView& view) {
  const auto sent = view.sent();
  if (!sent || !sent->is_stop || !view.has_map()) return kKept;
  return touches(view, sent->trajectory, 0.0, sent->trajectory.duration_s());
}
std::string has_no_stop(const PolicyView& view) {
  if (!view.is_active() || view.step.status == Status::kReached || !view.has_map()) return kKept;
  if (view.stands_or_stops() || !view.looks_for_stop()) return kKept;
  const Trajectory& motion = *view.step.followed;
  const double now_s = seconds_between(view.step.followed_start, view.step.now);
  return touches_until_rest(view, motion, now_s);
}
std::string may_be_reached(const PolicyView& view) {
  const ReplannerSettings& settings = view.setup.settings;
  // Who cannot turn at once is held against the replanner's own check alone.
  if (!(settings.obstacle_speed_mps > 0.0) || settings.obstacle_acceleration_mps2) return kKept;
  const bool moves = view.has_map() && view.step.map.moving && !view.step.map.moving->balls.empty();
  if (!moves || !view.is_active() || view.stands_or_stops()) return kKept;
  if (view.step.status == Status::kReached) return kKept;
  return is_reached(view, *view.step.followed,
                    seconds_between(view.step.followed_start, view.step.now));
}
std::string plan_meets_predicted(const PolicyView& view) {
  const auto sent = view.sent();
  const bool is_due = sent && !sent->is_stop && sent->event.reason != Reason::kAside;
  if (!is_due || view.step.prediction == nullptr || !view.has_map()) return kKept;
  return meets_predicted(view, *sent);
}
std::string goes_unseen(const PolicyView& view) {
  const auto sent = view.sent();
  const bool is_kept = view.setup.settings.unseen_start_m && view.setup.space.floor;
  if (!is_kept || !sent || sent->is_stop || !view.has_map() || !view.memory.q_first) return kKept;
  return leaves_seen_space(view, sent->trajectory);
}

constexpr std::string_view kContinuous =
    "position and velocity of what is sent are continuous to rounding";
constexpr std::string_view kTimed =
    "can be timed within the limits from the velocity that the robot will have";

constexpr auto kOfMotions = std::to_array<Policy>({
    {{"sends_whole_trajectories", kPromiseOnSending}, &sends_nonsense},
    {{"sends_from_now_on", kPromiseOnSending}, &sends_for_another_time},
    {{"sends_one_trajectory", kPromiseOnSending}, &sends_several},
    {{"position_is_continuous", kContinuous}, &jumps},
    {{"velocity_is_continuous", kContinuous}, &jumps_in_velocity},
    {{"keeps_what_is_followed", kPromiseOnSending}, &leaves_early},
    {{"takes_over_in_time", kPromiseOnSending}, &takes_over_late},
    {{"splices_at_its_velocity", "and with that velocity to within the tolerances of the timing"},
     &splices_badly},
    {{"starts_where_it_is", kPromiseOnState}, &starts_elsewhere},
    {{"sets_out_from_rest", "After any stop it tries anew from rest"}, &sets_out_at_speed},
    {{"ends_at_rest", kTimed}, &ends_at_speed},
    {{"keeps_joint_limits", kTimed}, &leaves_limits},
    {{"keeps_velocity_limits", kTimed}, &exceeds_velocities},
    {{"keeps_acceleration_limits",
      "Plans, their timing and setting out again keep the acceleration limit, whatever b is."},
     &exceeds_accelerations},
    {{"keeps_braking_limits", "slows down on it as fast as the robot brakes"}, &brakes_too_hard},
    {{"plan_is_clear", kPromiseOnValidity}, &plan_touches},
    {{"stop_is_clear", "if the newest map does not show that to be clear"}, &stop_touches},
    {{"has_a_stop",
      "the robot goes on only if a stop that began at the next replan would be valid, too"},
     &has_no_stop},
    {{"cannot_be_reached",
      "going on until the next one and then braking must end before anything that was seen moving, "
      "at that speed and in whatever direction, could reach any sphere of the robot"},
     &may_be_reached},
    {{"plan_keeps_from_predicted",
      "every new motion is clear of these sets by `prediction_margin_m` over continuous time"},
     &plan_meets_predicted},
    {{"plan_keeps_to_seen",
      "the centre of each of their spheres stays in voxels that a frame has seen"},
     &goes_unseen},
});

}  // namespace

std::span<const Policy> policies_of_motions() { return kOfMotions; }

}  // namespace sidestep::detail
