#include <array>
#include <cmath>

#include <sidestep/core/format.hpp>
#include <sidestep/core/index.hpp>

#include "policy_view.hpp"

namespace sidestep::detail {
namespace {

// Stops.

std::string fault_goes_on(const PolicyView& view) {
  const ReplannerEvent* fault = view.first_event([](const ReplannerEvent& event) {
    return event.kind == Kind::kReplanFailed && event.reason == Reason::kPlugin;
  });
  return stop_is_due(view, fault != nullptr, "a plugin is at fault");
}
std::string goes_on_unrecovered(const PolicyView& view) {
  const auto& halted = view.memory.halted;
  const ReplannerEvent* plan = view.first_event(&is_plan);
  if (plan == nullptr || !halted || halted->kind != Kind::kStopped) return kKept;
  const ReplannerEvent* recovered =
      view.first_event([](const ReplannerEvent& event) { return event.kind == Kind::kRecovered; });
  return recovered != nullptr && recovered < plan ? kKept : "it goes on, and has not recovered";
}
std::string recovers_for_nothing(const PolicyView& view) {
  for (std::size_t i = 0; i < view.step.events.size(); ++i) {
    if (view.step.events[i].kind != Kind::kRecovered) continue;
    const bool is_followed = i + 1 < view.step.events.size() && is_plan(view.step.events[i + 1]);
    if (!is_followed) return "it recovers, and nothing is planned";
  }
  return kKept;
}
std::string recovers_from_else(const PolicyView& view) {
  const ReplannerEvent* recovered =
      view.first_event([](const ReplannerEvent& event) { return event.kind == Kind::kRecovered; });
  if (recovered == nullptr) return kKept;
  const auto& halted = view.memory.halted;
  const ReplannerEvent* stop = view.first_event(&is_stop);
  const Reason reason = stop != nullptr && stop < recovered ? stop->reason
                        : halted                            ? halted->reason
                                                            : Reason::kGoal;
  return reason == recovered->reason ? kKept : "it recovers from another cause than it stopped for";
}
std::string slowed_without_end(const PolicyView& view) {
  const auto& halted = view.memory.halted;
  const bool is_over = halted && halted->kind == Kind::kSlowed && view.memory.is_stopping &&
                       view.step.followed == nullptr;
  if (!is_over || view.step.status == Status::kReached) return kKept;
  return view.first_event(&is_stop) != nullptr ? kKept
                                               : "it stands after it slowed, and says nothing";
}
std::string stops_twice(const PolicyView& view) {
  const auto& halted = view.memory.halted;
  const ReplannerEvent* stop = view.first_event(&is_stop);
  if (stop == nullptr || !halted || halted->kind != Kind::kStopped) return kKept;
  const ReplannerEvent* plan = view.first_event(&is_plan);
  const bool is_again = stop->kind == Kind::kStopped && stop->reason == halted->reason;
  return is_again && (plan == nullptr || stop < plan) ? "it stops again for the same reason"
                                                      : kKept;
}
std::string stops_for_no_cause(const PolicyView& view) {
  for (const ReplannerEvent& event : view.step.events) {
    const bool needs_one = is_stop(event) || event.kind == Kind::kReplanFailed;
    if (needs_one && event.cause.empty()) return "nobody is told why";
  }
  return kKept;
}
std::string stops_for_odd_reason(const PolicyView& view) {
  constexpr std::array kOfStops = {Reason::kBlocked, Reason::kMoving,       Reason::kMap,
                                   Reason::kPlugin,  Reason::kNotFollowing, Reason::kExecutor,
                                   Reason::kClock,   Reason::kEnd};
  for (const ReplannerEvent& event : view.step.events) {
    const bool is_odd = (is_stop(event) && std::ranges::count(kOfStops, event.reason) == 0) ||
                        (event.kind == Kind::kSlowed && event.reason != Reason::kMoving);
    if (is_odd) return "no stop has the reason " + std::string(to_string(event.reason));
  }
  return kKept;
}
std::string ends_by_itself(const PolicyView& view) {
  const ReplannerEvent* end =
      view.first_event([](const ReplannerEvent& event) { return event.reason == Reason::kEnd; });
  return end != nullptr && !view.step.is_end ? "it ends by itself" : kKept;
}
std::string stop_begins_late(const PolicyView& view) {
  const ReplannerEvent* stop = view.first_event(&is_stop);
  if (stop == nullptr || stop->takeover == Stamp{}) return kKept;
  const ReplannerSettings& settings = view.setup.settings;
  const double in_s = seconds_between(view.step.now, stop->takeover);
  const double most_s = settings.stop_lead_s + (settings.limit_wall_time ? view.step.took_s : 0.0);
  return in_s >= -kRounding && in_s <= most_s + kRounding ? kKept
                                                          : format("it begins in %.3f s", in_s);
}
const ExecutorCall* own_stop(const PolicyView& view) {
  return view.first_call([](const ExecutorCall& call) { return call.kind == Call::kStop; });
}
std::string stops_in_silence(const PolicyView& view) {
  if (own_stop(view) == nullptr || view.memory.has_failed_stop) return kKept;
  return view.first_event(&is_stop) != nullptr ? kKept : "the executor stops, and nobody is told";
}
std::string stops_by_executor(const PolicyView& view) {
  constexpr std::array kVerified = {Reason::kBlocked, Reason::kMoving, Reason::kMap, Reason::kEnd};
  const ReplannerEvent* stop = view.first_event(&is_stop);
  if (own_stop(view) == nullptr || stop == nullptr || view.before() == nullptr) return kKept;
  const bool is_overdue = view.setup.settings.limit_wall_time &&
                          view.step.took_s > view.setup.settings.longest_step_s();
  if (std::ranges::count(kVerified, stop->reason) == 0 || is_overdue) return kKept;
  if (view.memory.has_failed_stop) return kKept;
  for (const char* why : {"no stop is clear of obstacles", "the executor refused the stop"}) {
    if (stop->cause.find(why) != std::string::npos) return kKept;
  }
  return "the executor's own stop is called, and not as a last resort";
}
std::string forgets_failed_stop(const PolicyView& view) {
  const Executor::Measured* measured = view.state();
  if (!view.is_active() || !view.memory.has_failed_stop || measured == nullptr) return kKept;
  if (view.is_at_rest(measured->state) || own_stop(view) != nullptr) return kKept;
  return "its stop has failed, and it is not asked again";
}
std::string refused_in_silence(const PolicyView& view) {
  const ExecutorCall* refused = view.first_call(
      [](const ExecutorCall& call) { return call.kind == Call::kFollow && !call.succeeded; });
  const ReplannerEvent* told = view.first_event(
      [](const ReplannerEvent& event) { return event.cause.find("refused") != std::string::npos; });
  return refused != nullptr && told == nullptr ? "a refusal is not told" : kKept;
}
std::string overdue(const PolicyView& view) {
  constexpr double kGrace_s = 0.05;  // the step is measured from outside here
  const ReplannerSettings& settings = view.setup.settings;
  const bool is_due = settings.limit_wall_time && view.before() != nullptr &&
                      view.step.took_s > settings.longest_step_s() + kGrace_s;
  if (!is_due || view.step.is_end) return kKept;
  return stop_is_due(view, true, format("the step took %.3f s", view.step.took_s));
}

// What it tells.

std::string moves_in_silence(const PolicyView& view) {
  const ExecutorCall* taken = view.first_call(
      [](const ExecutorCall& call) { return call.kind == Call::kFollow && call.succeeded; });
  const bool is_told =
      view.first_event(&is_plan) != nullptr || view.first_event(&is_stop) != nullptr;
  return taken != nullptr && !is_told ? "a motion is sent, and nobody is told" : kKept;
}
std::string tells_what_is_not_sent(const PolicyView& view) {
  const ExecutorCall* taken = view.first_call(
      [](const ExecutorCall& call) { return call.kind == Call::kFollow && call.succeeded; });
  return view.first_event(&is_plan) != nullptr && taken == nullptr
             ? "a plan is told that is not sent"
             : kKept;
}
std::string failure_changes_motion(const PolicyView& view) {
  const auto& last = view.memory.last;
  const bool is_failure = view.first_event([](const ReplannerEvent& event) {
    return event.kind == Kind::kReplanFailed;
  }) != nullptr;
  if (!is_failure || !last || view.first_event(&is_plan) || view.first_event(&is_stop))
    return kKept;
  const bool is_over =
      view.before() != nullptr && view.before_s(view.step.now) >= view.before()->duration_s();
  const bool is_same = view.step.followed_start == last->followed_start &&
                       (view.step.followed == nullptr) == (last->followed == nullptr);
  return is_same || is_over ? kKept : "what is followed changes though no plan was found";
}
std::string follows_what_was_not_sent(const PolicyView& view) {
  const auto sent = view.sent();
  if (!sent || own_stop(view) != nullptr || view.step.status == Status::kReached) return kKept;
  const Trajectory* followed = view.step.followed.get();
  const bool is_same = followed != nullptr && view.step.followed_start == sent->start &&
                       followed->times_s == sent->trajectory.times_s &&
                       followed->positions == sent->trajectory.positions;
  return is_same ? kKept : "it says that it follows what it has not sent";
}
std::string follows_after_stop(const PolicyView& view) {
  const bool is_last = !view.step.calls.empty() && view.step.calls.back().kind == Call::kStop;
  return is_last && view.step.followed != nullptr ? "the executor stops, and it follows something"
                                                  : kKept;
}
std::string waits_in_motion(const PolicyView& view) {
  const Executor::Measured* measured = view.state();
  if (!view.is_active() || view.step.status != Status::kWaiting || measured == nullptr)
    return kKept;
  if (view.step.followed != nullptr) return "it says that it waits, and follows something";
  return view.is_at_rest(measured->state) ? kKept : "it says that it waits, and moves";
}
std::string moves_at_rest(const PolicyView& view) {
  const Executor::Measured* measured = view.state();
  if (!view.is_active() || view.step.status != Status::kMoving || measured == nullptr) return kKept;
  if (view.step.followed != nullptr || !view.is_at_rest(measured->state)) return kKept;
  return "it says that it moves, and rests";
}
std::string tells_of_other_times(const PolicyView& view) {
  for (const ReplannerEvent& event : view.step.events) {
    if (event.stamp != view.step.now) return "an event has the stamp of another step";
  }
  return kKept;
}
std::string tells_no_numbers(const PolicyView& view) {
  for (const ReplannerEvent& e : view.step.events) {
    for (const double number : {e.solve_ms, e.cost, e.splice_velocity_jump, e.unknown_share}) {
      if (!std::isfinite(number)) return "a number of an event is none";
    }
    if (e.unknown_share < 0.0 || e.unknown_share > 1.0) return "a share is not between 0 and 1";
    if (e.solve_ms < 0.0 || e.attempts < 0) return "an event has a negative number";
  }
  return kKept;
}
std::string plans_for_odd_reason(const PolicyView& view) {
  constexpr std::array kOfPlans = {Reason::kGoal, Reason::kBlocked, Reason::kCost, Reason::kSooner,
                                   Reason::kAside};
  const ReplannerEvent* plan = view.first_event(&is_plan);
  if (plan == nullptr || std::ranges::count(kOfPlans, plan->reason) > 0) return kKept;
  const auto& halted = view.memory.halted;
  const bool is_of_stop = halted && halted->reason == plan->reason;
  return is_of_stop ? kKept : "no plan has the reason " + std::string(to_string(plan->reason));
}

constexpr std::string_view kRecovery =
    "The first plan that is followed again is preceded by the event `recovered` with the cause of "
    "the stop.";
constexpr std::string_view kStopEvents =
    "Every stop says once what led to it, in one of these words, and why.";
constexpr std::string_view kLastResort =
    "Only if neither is, or the executor refuses, is its own `stop()` called; the event says which "
    "it was.";

constexpr auto kOfStopping = std::to_array<Policy>({
    {{"stops_for_faults", "an optimiser threw, failed, exceeded its deadline"}, &fault_goes_on},
    {{"recovers_before_it_goes_on", kRecovery}, &goes_on_unrecovered},
    {{"recovers_with_a_plan", kRecovery}, &recovers_for_nothing},
    {{"recovers_from_its_cause", kRecovery}, &recovers_from_else},
    {{"slowed_then_stopped", "the event is `slowed`, and `stopped` once it is at rest"},
     &slowed_without_end},
    {{"stops_once", kStopEvents}, &stops_twice},
    {{"stops_for_a_cause", kStopEvents}, &stops_for_no_cause},
    {{"stops_for_a_known_reason", kStopEvents}, &stops_for_odd_reason},
    {{"owner_ends_it", "whoever owns the loop wants no more of it"}, &ends_by_itself},
    {{"stop_begins_in_time",
      "A verified stop follows the path until `stop_lead_s` from now and then slows down"},
     &stop_begins_late},
    {{"own_stop_is_told", kLastResort}, &stops_in_silence},
    {{"own_stop_is_last_resort", kLastResort}, &stops_by_executor},
    {{"repeats_failed_stop",
      "One whose own `stop()` failed is asked again as long as the robot moves."},
     &forgets_failed_stop},
    {{"refusal_is_told",
      "An executor that refuses a trajectory goes on with what it had; the event names it"},
     &refused_in_silence},
    {{"stops_after_long_step", "The step that comes back at last finds itself late and stops, too"},
     &overdue},
    {{"motions_are_told", kPromiseOnEvents}, &moves_in_silence},
    {{"told_plans_are_sent", kPromiseOnEvents}, &tells_what_is_not_sent},
    {{"failure_keeps_motion", "An executor that refuses a trajectory goes on with what it had"},
     &failure_changes_motion},
    {{"follows_what_it_sent", kPromiseOnSending}, &follows_what_was_not_sent},
    {{"follows_nothing_after_own_stop", kLastResort}, &follows_after_stop},
    {{"waits_at_rest", kPromiseOnEvents}, &waits_in_motion},
    {{"moves_when_it_says", kPromiseOnEvents}, &moves_at_rest},
    {{"events_are_of_their_step", kPromiseOnEvents}, &tells_of_other_times},
    {{"events_have_numbers", kPromiseOnEvents}, &tells_no_numbers},
    {{"plans_for_a_known_reason", kPromiseOnEvents}, &plans_for_odd_reason},
});

}  // namespace

std::span<const Policy> policies_of_stops() { return kOfStopping; }

}  // namespace sidestep::detail
