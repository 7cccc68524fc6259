#include <algorithm>
#include <array>
#include <utility>

#include <sidestep/runtime/call_plugin.hpp>
#include <sidestep/trajectory/braking.hpp>
#include <sidestep/trajectory/splice.hpp>

#include "replanner_impl.hpp"

namespace sidestep {

void Replanner::Impl::halt(Reason reason, std::string cause, bool by_executor) {
  const bool is_stopping = motion() == nullptr || std::holds_alternative<Braking>(phase);
  if (halted && halted->reason == reason && is_stopping) {
    const bool is_again =
        failed_stop && now.seconds() - failed_stop->seconds() >= settings.replan_period_s - 1e-9;
    if (is_again) (void)stop_by_executor();
    return;
  }
  const Stamp begin =
      by_executor ? now : Stamp::from_seconds(present().seconds() + settings.stop_lead_s);
  halted = Halt{reason, cause};
  const bool slows = reason == Reason::kMoving && motion() != nullptr;
  const std::string how = stop_motion(by_executor);
  Event& event =
      tell(slows ? Event::Kind::kSlowed : Event::Kind::kStopped, reason, std::move(cause) + how);
  event.takeover = begin;
  if (!slows) parts.log.warn("stopped: " + event.cause);
}

/// How the robot is stopped, as words to be appended to the cause.
std::string Replanner::Impl::stop_motion(bool by_executor) {
  if (by_executor || is_overdue()) return stop_by_executor();
  if (motion() == nullptr) return is_moving ? stop_by_executor() : "";
  auto* driving = std::get_if<Driving>(&phase);
  if (driving == nullptr) return "";
  std::string how;
  if (follow_verified_stop(*driving, how)) return how;
  return how + stop_by_executor();
}

/// The rest of the motion until braking can begin, and then a stop: along the path, or else along a
/// straight line, whichever the newest map shows clear; one in nobody's predicted way, if there is
/// one.
bool Replanner::Impl::follow_verified_stop(Driving& driving, std::string& how) {
  const Stamp begin = present();
  const double begin_s = driving.time_s(begin);
  const double brake_s = begin_s + settings.stop_lead_s;
  const Trajectory& followed = driving.trajectory;
  if (brake_s >= followed.duration_s()) {
    phase = Braking{std::move(driving)};  // it ends before
    return true;
  }
  const Trajectory lead = cut(followed, begin_s, brake_s);
  const auto along_path = brake(followed, brake_s, parts.limits);
  const auto straight = brake_straight(end_state(lead), parts.limits);
  const auto predicted = predicted_from(begin);
  std::optional<Trajectory> chosen;
  for (const auto* stop : {&along_path, &straight}) {
    if (!*stop || !full_check) continue;
    Trajectory motion = joined(lead, **stop);
    const auto verdict = full_check->check(motion, 0.0, Deadline());
    if (!verdict || !verdict->valid()) continue;
    const bool is_met = predicted && prediction_check.first_conflict(motion, 0.0, *predicted);
    if (is_met && chosen) continue;
    how = stop == &along_path ? "" : "; the robot stops beside its path";
    chosen = std::move(motion);
    if (!is_met) break;
  }
  if (!chosen) {
    how = "; no stop is clear of obstacles";
    return false;
  }
  const auto accepted =
      call_stage(parts.executor_name, [&] { return parts.executor.follow(*chosen, begin); });
  if (!accepted) {
    how = "; the executor refused the stop: " + accepted.error().describe();
    return false;
  }
  last_start = begin;
  phase = Braking{{*std::move(chosen), begin}};
  return true;
}

std::string Replanner::Impl::stop_by_executor() {
  if (auto* at_goal = std::get_if<AtGoal>(&phase)) {
    *at_goal = {};
  } else {
    phase = Resting{};
  }
  const auto stopped = call_stage(parts.executor_name, [&] { return parts.executor.stop(); });
  failed_stop = stopped ? std::nullopt : std::optional(now);
  if (stopped) return "; the executor stops by itself";
  return "; the executor's own stop failed: " + stopped.error().describe();
}

/// Whether a stop that began only a period from now, or after a search that began just before,
/// could be too late: where it would end nearer than the reserve to what is in the way, or could
/// not be shown clear.
bool Replanner::Impl::must_stop_now(const Driving& driving) const {
  const double brake_s = driving.time_s(present()) + settings.replan_period_s +
                         settings.search_s() + settings.stop_lead_s;
  const double begin_s = driving.blocked->begin_s;
  if (brake_s >= begin_s) return true;
  const auto stop = brake(driving.trajectory, brake_s, parts.limits);
  if (!stop) return true;
  if (begin_s - brake_s < settings.stop_reserve * stop->duration_s()) return true;
  const auto verdict = full_check->check(*stop, 0.0, Deadline());
  return !verdict || !verdict->valid();
}

}  // namespace sidestep
