#include <array>
#include <cmath>
#include <set>

#include <sidestep/core/format.hpp>
#include <sidestep/core/index.hpp>

#include "policy_view.hpp"

namespace sidestep::detail {
namespace {

// What the robot is told of its state.

std::string unknown_state(const PolicyView& view) {
  const ExecutorCall* call = view.first_measurement();
  return stop_is_due(view, view.is_active() && call != nullptr && !call->succeeded,
                     "the state is not known");
}
std::string senseless_state(const PolicyView& view) {
  const ExecutorCall* call = view.first_measurement();
  const bool is_due = view.is_active() && call != nullptr && call->measured &&
                      view.is_senseless(call->measured->state);
  return stop_is_due(view, is_due, "the state makes no sense");
}
std::string old_state(const PolicyView& view) {
  const ExecutorCall* call = view.first_measurement();
  if (!view.is_active() || call == nullptr || !call->measured) return kKept;
  const double age_s = seconds_between(call->measured->stamp, view.step.now);
  return stop_is_due(view, age_s > view.setup.settings.max_state_age_s + kRounding,
                     format("the state is %.3f s old", age_s));
}
std::string off_its_way(const PolicyView& view) {
  const Executor::Measured* measured = view.state();
  if (!view.is_active() || measured == nullptr || view.before() == nullptr) return kKept;
  Eigen::VectorXd q(measured->state.q.size());
  view.before()->sample(view.before_s(measured->stamp), std::span(q.data(), idx(q.size())), {});
  const double off = largest(q - measured->state.q);
  return stop_is_due(view, off > view.setup.settings.tracking_tolerance + kRounding,
                     format("the robot is off by %.3f", off));
}
std::string clock_back(const PolicyView& view) {
  const bool is_due = view.is_clock_back() && view.memory.last->status != Status::kReached;
  return stop_is_due(view, is_due, "the clock went back");
}

// The goal.

std::string reached_elsewhere(const PolicyView& view) {
  const bool is_new = view.step.status == Status::kReached && view.is_active();
  const Executor::Measured* measured = view.state();
  if (!is_new) return kKept;
  if (measured == nullptr) return "it is reached, and nobody knows where the robot is";
  const auto is_at = [&](const Eigen::VectorXd& goal) {
    return goal.size() == measured->state.q.size() &&
           largest(goal - measured->state.q) <= view.setup.settings.goal_tolerance + kRounding;
  };
  if (is_at(view.step.goal)) return kKept;
  return view.memory.plan_end && is_at(*view.memory.plan_end) ? kKept : "the robot is elsewhere";
}
std::string reached_at_speed(const PolicyView& view) {
  const bool is_new = view.step.status == Status::kReached && view.is_active();
  const Executor::Measured* measured = view.state();
  if (!is_new || measured == nullptr || view.is_at_rest(measured->state)) return kKept;
  return "the robot still moves";
}
std::string goes_on_at_goal(const PolicyView& view) {
  const auto& last = view.memory.last;
  if (!last || last->status != Status::kReached || view.step.is_end) return kKept;
  const ExecutorCall* moved =
      view.first_call([](const ExecutorCall& call) { return call.kind == Call::kFollow; });
  if (view.step.status != Status::kReached) return "the robot is not at its goal any more";
  return moved != nullptr ? "it is sent on" : kKept;
}
std::string reached_in_silence(const PolicyView& view) {
  const bool is_new = view.step.status == Status::kReached &&
                      (!view.memory.last || view.memory.last->status != Status::kReached);
  const auto told = std::ranges::count(view.step.events, Kind::kReached, &ReplannerEvent::kind);
  if (told == (is_new ? 1 : 0)) return kKept;
  return is_new ? "nobody is told that it is reached" : "it is told that it is reached";
}

// Its map.

std::string moves_without_map(const PolicyView& view) {
  const bool has_none = view.step.map.field == nullptr && !view.step.has_new_map;
  if (!has_none || view.memory.map != nullptr || view.step.followed == nullptr) return kKept;
  return "there is no map, and the robot follows something";
}
std::string waits_for_map(const PolicyView& view) {
  const bool has_none = view.step.map.field == nullptr && !view.step.has_new_map;
  if (!has_none || !view.is_active() || view.state() == nullptr || !view.memory.first) return kKept;
  if (view.step.status == Status::kReached) return kKept;
  const double waited_s = seconds_between(*view.memory.first, view.step.now);
  const bool is_late = waited_s > view.setup.settings.max_map_age_s + kRounding;
  const bool is_told = view.memory.halted || view.first_event(&is_stop) != nullptr;
  return is_late && !is_told
             ? format("there is no map after %.2f s, which nobody is told", waited_s)
             : kKept;
}
double map_age_s(const PolicyView& view) {
  return seconds_between(view.step.map.field->info().stamp, view.step.now);
}
std::string old_map(const PolicyView& view) {
  if (!view.is_active() || !view.has_map()) return kKept;
  return stop_is_due(view, map_age_s(view) > view.setup.settings.max_map_age_s + kRounding,
                     format("the map is %.3f s old", map_age_s(view)));
}
std::string map_ahead(const PolicyView& view) {
  if (!view.is_active() || !view.has_map()) return kKept;
  return stop_is_due(view, -map_age_s(view) > view.setup.settings.max_map_age_s + kRounding,
                     format("the map is %.3f s ahead", -map_age_s(view)));
}
std::string map_back(const PolicyView& view) {
  if (!view.is_active() || !view.has_map() || view.memory.map == nullptr) return kKept;
  return stop_is_due(view, view.step.map.field->info().stamp < view.memory.newest_map,
                     "the map is older than the one before it");
}
std::string plans_in_old_map(const PolicyView& view) {
  const ReplannerEvent* plan = view.first_event(&is_plan);
  if (plan == nullptr) return kKept;
  const double age_s = seconds_between(plan->map_stamp, view.step.now);
  if (std::abs(age_s) <= view.setup.settings.max_map_age_s + kRounding) return kKept;
  return format("it is planned in a map that is %.3f s old", age_s);
}
std::string plans_in_another_map(const PolicyView& view) {
  const ReplannerEvent* plan = view.first_event(&is_plan);
  if (plan == nullptr || !view.has_map()) return kKept;
  return plan->map_stamp == view.step.map.field->info().stamp
             ? kKept
             : "it is not planned in the newest map";
}
std::string plans_in_earlier_map(const PolicyView& view) {
  const ReplannerEvent* plan = view.first_event(&is_plan);
  if (plan == nullptr || !view.memory.planned_in) return kKept;
  return plan->map_stamp < *view.memory.planned_in ? "it is planned in an earlier map than before"
                                                   : kKept;
}
std::string checks_twice(const PolicyView& view) {
  const auto& last = view.memory.last;
  if (!last || !view.has_map() || last->has_new_map) return kKept;
  const std::int64_t checks = view.step.checks - last->checks;
  const LoopMemory::Checked here{last->followed_start, view.step.map.field.get()};
  const bool is_again = checks > 1 || (checks == 1 && view.memory.checked == here);
  return is_again || checks < 0 ? "what is followed is checked again in the same map" : kKept;
}

// When it searches.

std::string searches_too_often(const PolicyView& view) {
  if (view.search() == nullptr || !view.memory.search) return kKept;
  const double since_s = seconds_between(view.memory.search->stamp, view.step.now);
  // Maps do not come at the nanosecond: four fifths of a period will do.
  if (since_s >= 0.8 * view.setup.settings.replan_period_s - kRounding) return kKept;
  return format("the last search is %.4f s ago", since_s);
}
std::string searches_same_map(const PolicyView& view) {
  if (view.search() == nullptr || !view.memory.search || !view.has_map()) return kKept;
  if (view.memory.search->field != view.step.map.field) return kKept;
  const double since_s = seconds_between(view.memory.search->stamp, view.step.now);
  if (since_s >= 5.0 * view.setup.settings.replan_period_s - kRounding) return kKept;
  return format("the same map was searched %.4f s ago", since_s);
}
std::string tries_other_guesses(const PolicyView& view) {
  const std::vector<std::string>& escalation = view.setup.settings.escalation;
  for (const ReplannerEvent& event : view.step.events) {
    std::set<std::string> seen;
    for (const std::string& guess : event.tried) {
      if (std::ranges::count(escalation, guess) == 0) return guess + " is not of the escalation";
      if (!seen.insert(guess).second) return guess + " is tried twice";
    }
    if (event.attempts != std::ssize(event.tried)) return "the attempts are not those tried";
  }
  return kKept;
}
std::string led_by_untried_guess(const PolicyView& view) {
  const ReplannerEvent* plan = view.first_event(&is_plan);
  if (plan == nullptr || plan->guess == "aside") return kKept;
  return std::ranges::count(plan->tried, plan->guess) == 1 ? kKept
                                                           : "'" + plan->guess + "' was not tried";
}
std::string stops_before_other_guesses(const PolicyView& view) {
  for (const ReplannerEvent& event : view.step.events) {
    const auto stop = std::ranges::find(event.tried, "after_stop");
    if (stop != event.tried.end() && stop + 1 != event.tried.end()) {
      return *(stop + 1) + " is tried after a stop";
    }
  }
  return kKept;
}
std::string searches_too_long(const PolicyView& view) {
  const ReplannerEvent* plan = view.first_event(&is_plan);
  const ReplannerSettings& settings = view.setup.settings;
  if (plan == nullptr || !settings.limit_wall_time) return kKept;
  if (plan->solve_ms <= 1e3 * settings.takeover_s) return kKept;
  return format("what took %.1f ms is followed", plan->solve_ms);
}

constexpr std::string_view kGoal =
    "Every joint within `goal_tolerance` of the goal and slower than `rest_speed`: reached, for "
    "good.";
constexpr std::string_view kMap =
    "None yet: wait. Older than `max_map_age_s`, as far ahead of the clock, or older than the one "
    "before it: stop.";
constexpr std::string_view kDue =
    "A replan is due `replan_period_s` after the last one began, when a new map arrives; without a "
    "new map, half a period later.";
constexpr std::string_view kGuesses = "A replan tries the first guesses of `escalation` in turn";

constexpr auto kOfMaps = std::to_array<Policy>({
    {{"stops_without_state", kPromiseOnState}, &unknown_state},
    {{"stops_with_senseless_state", "its state is unknown, too old or makes no sense"},
     &senseless_state},
    {{"stops_with_old_state", kPromiseOnState}, &old_state},
    {{"stops_off_its_way", kPromiseOnState}, &off_its_way},
    {{"stops_as_clock_goes_back", "the clock went back"}, &clock_back},
    {{"reached_at_goal", kGoal}, &reached_elsewhere},
    {{"reached_at_rest", kGoal}, &reached_at_speed},
    {{"reached_for_good", kGoal}, &goes_on_at_goal},
    {{"reached_is_told", kPromiseOnEvents}, &reached_in_silence},
    {{"waits_for_first_map", kMap}, &moves_without_map},
    {{"misses_first_map", "there is none after `max_map_age_s`"}, &waits_for_map},
    {{"stops_in_old_map", kMap}, &old_map},
    {{"stops_in_map_ahead", kMap}, &map_ahead},
    {{"stops_as_maps_go_back", kMap}, &map_back},
    {{"plans_in_fresh_map", "or it is too old, ahead of the clock, or its time jumped back"},
     &plans_in_old_map},
    {{"plans_in_newest_map", kPromiseOnValidity}, &plans_in_another_map},
    {{"plans_in_later_maps", "Maps count again once their stamps have passed the newest one seen."},
     &plans_in_earlier_map},
    {{"checks_once", "the same motion in the same map is not checked twice"}, &checks_twice},
    {{"searches_when_due", kDue}, &searches_too_often},
    {{"searches_new_maps", "A map in which a search failed is not searched again for five periods"},
     &searches_same_map},
    {{"tries_each_guess_once", kGuesses}, &tries_other_guesses},
    {{"led_by_what_was_tried", kGuesses}, &led_by_untried_guess},
    {{"stop_is_last_guess", "a stop stays the last resort"}, &stops_before_other_guesses},
    {{"follows_nothing_late", "what came too late is not followed"}, &searches_too_long},
});

}  // namespace

std::span<const Policy> policies_of_maps() { return kOfMaps; }

}  // namespace sidestep::detail
