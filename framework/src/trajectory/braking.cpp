#include <sidestep/trajectory/braking.hpp>

#include <algorithm>
#include <array>
#include <cmath>
#include <string>

#include <sidestep/core/index.hpp>
#include <sidestep/trajectory/retime.hpp>
#include <sidestep/trajectory/splice.hpp>

#include "path_stages.hpp"
#include "rolling_way.hpp"

namespace sidestep {
namespace {

constexpr double kRest_s = 1e-3;  ///< Duration of a motion that stays put.
/// Of a stop this short, in m or rad, a straight line is as good as the path.
constexpr double kShortStop = 1e-6;
constexpr int kStages = 100;
constexpr double kKeptFree = 1e-6;  ///< Share of the limits, as for any retiming.
/// A joint may be this much faster than at first while the others brake.
constexpr double kFaster = 1e-5;
/// How much longer than by braking hardest the way is made, one after the other, until the path's
/// turns and the stages of another cut let the robot stop on it.
constexpr std::array kReaches{1.0005, 1.003, 1.01, 1.03, 1.1, 1.3, 2.0};

RobotState state_at(const Trajectory& trajectory, double time_s) {
  RobotState state{Eigen::VectorXd(trajectory.dof), Eigen::VectorXd(trajectory.dof)};
  trajectory.sample(time_s, as_span(state.q), as_span(state.qdot));
  return state;
}

/// When a trajectory comes to rest for the first time after `from_s`: at a corner of a path, or at
/// its end.
double first_rest_s(const Trajectory& trajectory, double from_s) {
  for (int i = 0; i < trajectory.size(); ++i) {
    const double time_s = trajectory.times_s[idx(i)];
    if (time_s <= from_s) continue;
    if (std::ranges::all_of(trajectory.qdot(i), [](double v) { return v == 0.0; })) return time_s;
  }
  return trajectory.duration_s();
}

/// How far into a path it stands still when braked hardest, in seconds of its own; nothing where it
/// cannot be braked so, or ends before.
std::optional<double> way_of_braking_s(const Trajectory& path, double speed,
                                       const MotionLimits& limits) {
  const detail::PathStages stages(path, kStages);
  if (stages.size() == 0) return std::nullopt;
  detail::SpeedProfile profile(stages, limits, !limits.braking.empty());
  const auto rest = profile.braking_end(speed * speed, 1.0 - kKeptFree);
  if (!rest) return std::nullopt;
  const double from_s = stages.begin_s(rest->stage);
  const double to_s =
      rest->stage + 1 < stages.size() ? stages.begin_s(rest->stage + 1) : path.duration_s();
  return from_s + rest->share * (to_s - from_s);
}

Result<void> check(const Trajectory& trajectory, double from_s, const MotionLimits& limits) {
  SIDESTEP_TRY(trajectory.validate());
  if (!std::isfinite(from_s)) return invalid("the time to brake from is not a finite number");
  const auto dof = idx(trajectory.dof);
  for (const auto* each : {&limits.velocity, &limits.acceleration, &limits.while_stopping()}) {
    if (each->size() == dof) continue;
    return invalid("there are limits of " + std::to_string(each->size()) +
                   " joints for a trajectory of " + std::to_string(dof));
  }
  return {};
}

/// The motion to rest on the first `way_s` of the path from `from_s` on.
Result<Trajectory> stop_within(const Trajectory& trajectory, double from_s, double way_s,
                               const MotionLimits& limits) {
  auto stop =
      SIDESTEP_TRY(retime(cut(trajectory, from_s, from_s + way_s), limits,
                          {.least_stages = kStages, .stop_at_goal = true, .is_stop = true}));
  trajectory.sample(from_s, stop.trajectory.q(0), stop.trajectory.qdot(0));
  return std::move(stop.trajectory);
}

/// All joints slow down evenly; the base's heading and way, rather than its x and y.
Trajectory brake_on_arc(const RobotState& state, const RollingBase& base, double duration_s) {
  constexpr double kTurnOfPiece_rad = 0.02;
  const double turn = 0.5 * std::abs(state.qdot[base.yaw]) * duration_s;
  const int pieces = std::max(1, static_cast<int>(std::ceil(2.0 * turn / kTurnOfPiece_rad)));
  Trajectory out =
      make_trajectory(static_cast<int>(state.q.size()), pieces + 1, duration_s / pieces);
  const double ahead = base_speed(base, as_span(state.q), as_span(state.qdot)).ahead_mps;
  for (int i = 0; i <= pieces; ++i) {
    const double share = static_cast<double>(i) / pieces, left = 1.0 - share;
    for (Eigen::Index j = 0; j < state.q.size(); ++j) {
      out.q(i)[idx(j)] = state.q[j] + state.qdot[j] * duration_s * share * (1.0 - 0.5 * share);
      out.qdot(i)[idx(j)] = state.qdot[j] * left;
    }
    const double heading = out.q(i)[idx(base.yaw)];
    out.qdot(i)[idx(base.x)] = left * ahead * std::cos(heading);
    out.qdot(i)[idx(base.y)] = left * ahead * std::sin(heading);
  }
  roll_freely(base, out);
  return out;
}

}  // namespace

Result<Trajectory> brake(const Trajectory& trajectory, double from_s, const MotionLimits& limits) {
  SIDESTEP_TRY(check(trajectory, from_s, limits));
  if (limits.rolling) {
    const RollingBase base = *limits.rolling;
    Trajectory stop = detail::without_way(
        SIDESTEP_TRY(brake(detail::with_way(trajectory, base), from_s, detail::with_way(limits))));
    if (!roll(base, stop)) return invalid("the base does not roll on the trajectory");
    return stop;
  }
  const double from = std::clamp(from_s, 0.0, trajectory.duration_s());
  const double left_s = first_rest_s(trajectory, from) - from;
  const RobotState state = state_at(trajectory, from);
  auto straight = SIDESTEP_TRY(brake_straight(state, limits));
  const double straight_way = state.qdot.cwiseAbs().maxCoeff() * straight.duration_s();
  if (straight_way < kShortStop) return straight;

  MotionLimits while_braking = limits;
  for (std::size_t j = 0; j < limits.velocity.size(); ++j) {
    const double speed = std::abs(state.qdot[j]);
    while_braking.velocity[j] = std::max(limits.velocity[j], speed * (1.0 + kFaster));
  }
  for (double window_s = straight.duration_s();; window_s *= 2.0) {
    const bool is_all = window_s >= left_s;
    const double most_s = std::min(window_s, left_s);
    if (most_s <= 2.0 * kShortStop) break;
    const auto way_s =
        way_of_braking_s(cut(trajectory, from, from + most_s), state.qdot.norm(), while_braking);
    if (!way_s && !is_all) continue;
    for (const double reach : kReaches) {
      const double reach_s = way_s ? std::min(*way_s * reach, left_s) : left_s;
      auto stop = stop_within(trajectory, from, reach_s, while_braking);
      if (stop || reach_s >= left_s) return stop;
    }
    // Slowed down as hard as it may be already, so that rounding is too much: it ends with the way.
    const bool is_ending = left_s <= kReaches.back() * straight.duration_s();
    if (is_all && is_ending) return stop_within(trajectory, from, left_s, while_braking);
    if (is_all) break;
  }
  return invalid("the trajectory ends before the robot can stop on its path",
                 "let trajectories end at rest");
}

Result<Trajectory> brake_straight(const RobotState& state, const MotionLimits& limits) {
  const auto dof = idx(state.q.size());
  const std::vector<double>& braking = limits.while_stopping();
  if (dof == 0 || state.qdot.size() != state.q.size() || braking.size() != dof) {
    return invalid("a state of " + std::to_string(state.q.size()) + " positions and " +
                   std::to_string(state.qdot.size()) +
                   " velocities cannot be braked by limits of " + std::to_string(braking.size()) +
                   " joints");
  }
  if (!state.q.allFinite() || !state.qdot.allFinite()) {
    return invalid("a state that is not finite cannot be braked");
  }
  double duration_s = 0.0;
  for (std::size_t j = 0; j < dof; ++j) {
    const bool is_ahead = limits.rolling && j == idx(limits.rolling->x);
    const double speed =
        is_ahead ? base_speed(*limits.rolling, as_span(state.q), as_span(state.qdot)).length()
                 : std::abs(state.qdot[j]);
    if (speed == 0.0) continue;
    if (!(braking[j] > 0.0)) {
      return invalid(limits.joint_name(j) + " moves, but its limit of acceleration is zero");
    }
    duration_s = std::max(duration_s, speed / (braking[j] * (1.0 - kKeptFree)));
  }
  if (limits.rolling) return brake_on_arc(state, *limits.rolling, std::max(duration_s, kRest_s));
  Trajectory out = resting(as_span(state.q), std::max(duration_s, kRest_s));
  for (std::size_t j = 0; j < dof; ++j) {
    const double velocity = state.qdot[j];
    out.qdot(0)[j] = velocity;
    out.q(1)[j] += 0.5 * velocity * out.duration_s();
  }
  return out;
}

}  // namespace sidestep
