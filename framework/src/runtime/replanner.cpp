#include <sidestep/runtime/replanner.hpp>

#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>

#include <sidestep/core/index.hpp>
#include <sidestep/runtime/call_plugin.hpp>
#include <sidestep/trajectory/splice.hpp>

#include "replanner_impl.hpp"

namespace sidestep {
namespace {

/// What is worth a replan, of a motion that waits among what is predicted.
constexpr double kDelayed_s = 0.3;
/// The same of one that goes round about, and how often another is looked for.
constexpr double kDetour_s = 1.0;
constexpr double kLookAround_s = 1.0;

}  // namespace

std::string_view to_string(ReplannerEvent::Kind kind) noexcept {
  using Kind = ReplannerEvent::Kind;
  switch (kind) {
    case Kind::kPlanned: return "planned";
    case Kind::kReplanned: return "replanned";
    case Kind::kReplanFailed: return "replan_failed";
    case Kind::kSlowed: return "slowed";
    case Kind::kStopped: return "stopped";
    case Kind::kRecovered: return "recovered";
    case Kind::kReached: return "reached";
  }
  return "unknown";
}

std::string_view to_string(ReplannerEvent::Reason reason) noexcept {
  using Reason = ReplannerEvent::Reason;
  switch (reason) {
    case Reason::kGoal: return "goal";
    case Reason::kBlocked: return "blocked";
    case Reason::kCost: return "cost";
    case Reason::kSooner: return "sooner";
    case Reason::kAside: return "aside";
    case Reason::kMoving: return "moving";
    case Reason::kMap: return "map";
    case Reason::kNotFollowing: return "not_following";
    case Reason::kExecutor: return "executor";
    case Reason::kPlugin: return "plugin";
    case Reason::kClock: return "clock";
    case Reason::kEnd: return "end";
  }
  return "unknown";
}

Replanner::Replanner(Parts parts, ReplannerSettings settings)
    : impl_(std::make_unique<Impl>(std::move(parts), std::move(settings))) {}
Replanner::~Replanner() = default;

Replanner::Status Replanner::step(Stamp now, std::vector<ReplannerEvent>& events) {
  impl_->now = now;
  impl_->watch.restart();
  impl_->events = &events;
  impl_->overdue_by = "the planning side";
  auto done = catch_all("replanning", [&]() -> Result<Status> { return impl_->advance(); });
  // Where a robot or a field throws, no stop can be verified.
  if (!done) impl_->halt(ReplannerEvent::Reason::kPlugin, done.error().describe(), true);
  if (impl_->is_overdue() && impl_->motion() != nullptr) {
    impl_->halt(ReplannerEvent::Reason::kPlugin,
                impl_->overdue_by + " took " + std::to_string(1e-3 * impl_->watch.elapsed_ms()) +
                    " s, too long for a step",
                true);
  }
  return impl_->status();
}

void Replanner::stop(Stamp now, const std::string& cause, std::vector<ReplannerEvent>& events) {
  impl_->now = now;
  impl_->watch.restart();
  impl_->events = &events;
  if (impl_->status() != Status::kMoving || std::holds_alternative<Impl::Braking>(impl_->phase)) {
    return;
  }
  const auto done = catch_all("stopping", [&]() -> Result<void> {
    impl_->halt(ReplannerEvent::Reason::kEnd, cause);
    return {};
  });
  if (!done)
    impl_->halt(ReplannerEvent::Reason::kEnd, cause + "; " + done.error().describe(), true);
}

const Trajectory& Replanner::followed() const noexcept {
  static const Trajectory kNone;
  const Impl::Motion* motion = impl_->motion();
  return motion != nullptr ? motion->trajectory : kNone;
}
Stamp Replanner::followed_start() const noexcept {
  const Impl::Motion* motion = impl_->motion();
  return motion != nullptr ? motion->start : impl_->last_start;
}
Replanner::Way Replanner::way() const {
  Way way;
  if (const Impl::Motion* motion = impl_->motion(); motion != nullptr) {
    way.followed = &motion->trajectory;
    way.followed_s = motion->time_s(impl_->now);
  }
  const auto* driving = std::get_if<Impl::Driving>(&impl_->phase);
  if (driving != nullptr && !driving->is_aside) {
    way.trajectory = way.followed;
    way.from_s = way.followed_s;
    if (driving->blocked) way.blocked_s = driving->blocked->begin_s;
    return way;
  }
  const Eigen::VectorXd& q = impl_->measured_state.q;
  const bool is_refused = impl_->refused != nullptr;
  const Trajectory* found = is_refused ? impl_->refused.get() : &impl_->unfinished;
  if (found->size() == 0 || q.size() != found->dof) return way;
  way.trajectory = found;
  way.from_s = nearest_state(*found, as_span(q)).time_s;
  if (is_refused) way.blocked_s = impl_->refused_free_s;
  return way;
}
const Eigen::VectorXd& Replanner::goal() const noexcept { return impl_->parts.goal.q; }
std::shared_ptr<const Prediction> Replanner::prediction() const noexcept {
  return impl_->prediction;
}
std::int64_t Replanner::checks() const noexcept { return impl_->checks; }
const std::vector<Replanner::GuessCount>& Replanner::guess_counts() const noexcept {
  return impl_->search.counts();
}

Replanner::Status Replanner::Impl::status() const {
  if (std::holds_alternative<AtGoal>(phase)) return Status::kReached;
  return motion() != nullptr || is_moving ? Status::kMoving : Status::kWaiting;
}

const Replanner::Impl::Motion* Replanner::Impl::motion() const {
  if (const auto* driving = std::get_if<Driving>(&phase)) return driving;
  if (const auto* braking = std::get_if<Braking>(&phase)) return braking;
  const auto* at_goal = std::get_if<AtGoal>(&phase);
  return at_goal != nullptr && at_goal->trajectory.size() > 0 ? at_goal : nullptr;
}

bool Replanner::Impl::is_in_time() const {
  return !settings.limit_wall_time || 1e-3 * watch.elapsed_ms() <= settings.takeover_s;
}

bool Replanner::Impl::is_overdue() const {
  return settings.limit_wall_time && 1e-3 * watch.elapsed_ms() > settings.longest_step_s();
}

Stamp Replanner::Impl::present() const {
  if (!settings.limit_wall_time) return now;
  return Stamp::from_seconds(now.seconds() + 1e-3 * watch.elapsed_ms());
}

ReplannerEvent& Replanner::Impl::tell(Event::Kind kind, Reason reason, std::string cause) {
  Event event;
  event.kind = kind;
  event.reason = reason;
  event.stamp = now;
  event.cause = std::move(cause);
  if (field) event.map_stamp = field->info().stamp;
  events->push_back(std::move(event));
  return events->back();
}

bool Replanner::Impl::is_due() const {
  if (!last_replan) return true;
  // In periods. A search begins as a map comes, for what there is to see then is newest: one that
  // is on its way is waited for, a while; longer where there is nothing new in the one before.
  constexpr double kEarly = 0.8;  // maps do not come at the nanosecond
  constexpr double kWaitForNewer = 0.5;
  constexpr double kWaitForNew = 5.0;
  constexpr double kRounding = 1e-8;  // must not cost a step
  const auto since = [&](Stamp then) {
    return (now.seconds() - then.seconds()) / settings.replan_period_s + kRounding;
  };
  if (field != nullptr && field == searched_in) return since(*last_replan) >= kWaitForNew;
  if (now == map_came) return since(*last_replan) >= kEarly;
  return since(*last_replan) >= 1.0 && since(map_came) >= kWaitForNewer;
}

Replanner::Status Replanner::Impl::advance() {
  if (std::holds_alternative<AtGoal>(phase)) return Status::kReached;
  if (last_step && now < *last_step) {
    const double back_s = last_step->seconds() - now.seconds();
    last_step = now;
    last_replan.reset();
    looked_around.reset();
    failing_told.reset();
    halt(Reason::kClock, "the clock went back by " + std::to_string(back_s) + " s", true);
    return status();
  }
  last_step = now;
  if (!first_step) first_step = now;
  const auto measured = measure();
  if (!measured) return status();
  measured_state = *measured;
  keep_to_observed(*measured);
  is_moving = !is_at_rest(*measured);
  if (failed_stop && is_moving) (void)stop_by_executor();  // it still follows what it had
  if (reaches_goal(*measured)) {
    phase = motion() != nullptr ? AtGoal{*motion()} : AtGoal{};
    tell(Event::Kind::kReached, Reason::kGoal, "the robot is at rest at its goal");
    return Status::kReached;
  }
  if (!keeps_to_plan(*measured)) return status();
  end_motion(*measured);
  if (!look_at_map()) return status();
  if (motion() != nullptr) {
    supervise();
  } else if (!is_moving && is_due()) {
    depart_from_rest(*measured);
  }
  return status();
}

/// Follows what is valid, replaces what is not, and stops in time where that does not succeed.
void Replanner::Impl::supervise() {
  if (const auto* braking = std::get_if<Braking>(&phase)) {
    // A way that opens while the robot brakes for want of one is taken at once.
    const Reason reason = halted->reason;
    if ((reason != Reason::kBlocked && reason != Reason::kMoving) || !is_due()) return;
    const std::string cause = halted->cause;
    const detail::Departure at_rest = departure_from_end(*braking);
    if (!replan(departure_from(*braking), reason, cause)) (void)step_aside(at_rest);
    return;
  }
  auto& driving = std::get<Driving>(phase);
  if (slows_down(driving)) return;
  if (!driving.is_checked) check(driving);
  if (driving.blocked) return on_blocked(driving);
  if (driving.is_aside) return come_back(driving);
  if (driving.delay_s > kDelayed_s && is_due()) return hasten(driving, kDelayed_s);
  if (now == map_came && is_due() && goes_round_about(driving)) {
    looked_around = now;
    return hasten(driving, kDetour_s);
  }
  if (settings.cost_tolerance > 0.0 && now == map_came && is_due()) improve(driving);
}

/// A stop that begins no earlier than must be is looked for ahead of need, between two maps, and
/// held against what moves in each: to find one takes longer than all else in most steps.
bool Replanner::Impl::slows_down(Driving& driving) {
  // A later step has the same chance only once this one is over, with the search that may follow.
  constexpr double kStep_s = 0.02;
  constexpr double kAhead_s = 0.03;
  constexpr double kRenewed_s = 0.01;
  if (!reach.sees_anything()) return false;
  const double now_s = driving.time_s(now);
  const double brake_s =
      driving.time_s(present()) + settings.stop_lead_s + kStep_s + settings.search_s();
  auto& contingency = driving.contingency;
  const double spare_s = contingency ? contingency->brake_s - brake_s : -1.0;
  if (spare_s < 0.0 || (spare_s < kRenewed_s && now != map_came)) {
    contingency = reach.contingency(driving.trajectory, now_s, brake_s + kAhead_s);
    driving.is_unreached = false;
  }
  if (contingency && !driving.is_unreached) {
    const Stamp begin = Stamp::from_seconds(driving.start.seconds() + contingency->begin_s);
    driving.is_unreached = !reach.first_reach(*contingency, begin, now);
  }
  if (contingency && driving.is_unreached) return false;
  const auto cause = reach.first_reach(driving.trajectory, now_s, brake_s, now);
  if (!cause) return false;
  halt(Reason::kMoving, *cause);
  return true;
}

void Replanner::Impl::on_blocked(Driving& driving) {
  // What is far off is not worth all of the time: it may go by itself.
  Blocked& blocked = *driving.blocked;
  const bool is_far = blocked.begin_s - driving.time_s(now) > settings.horizon_s;
  constexpr double kPatience = 5.0;
  const bool is_patient =
      is_far && failed_at &&
      now.seconds() - failed_at->seconds() < kPatience * settings.replan_period_s;
  if (is_due() && !is_patient) {
    last_replan = now;
    const bool is_in_time = blocked.begin_s > driving.time_s(now) + settings.takeover_s;
    const std::string cause = blocked.cause;
    if (is_in_time && replan(departure_from(driving), Reason::kBlocked, cause)) return;
    if (halted) return;
    blocked.may_wait_until.reset();
  }
  if (blocked.may_wait_until && now < *blocked.may_wait_until) return;
  if (must_stop_now(driving)) return halt(Reason::kBlocked, blocked.cause);
  blocked.may_wait_until = Stamp::from_seconds(now.seconds() + settings.replan_period_s);
}

/// Replaces what is valid but has become costlier, by what is cheaper by more than the hysteresis.
void Replanner::Impl::improve(const Driving& driving) {
  detail::Departure departure = departure_from(driving);
  const auto cost = search.cost_of_rest(field, departure);
  const auto cost_then = search.cost_of_rest(driving.planned_in, departure);
  if (!cost || !cost_then || *cost <= (1.0 + settings.cost_tolerance) * *cost_then) return;
  const std::string cause = "the cost of what is followed rose from " + std::to_string(*cost_then) +
                            " to " + std::to_string(*cost);
  (void)replan(std::move(departure), Reason::kCost, cause, (1.0 - settings.hysteresis) * *cost);
}

/// What it goes around may have left: the optimiser's next guess begins where the last one ended.
bool Replanner::Impl::goes_round_about(const Driving& driving) const {
  const Stamp looked = std::max(looked_around.value_or(last_start), last_start);
  if (now.seconds() - looked.seconds() < kLookAround_s) return false;
  const double now_s = driving.time_s(now);
  const double straight_s = detail::least_rest_s(driving.trajectory, now_s, parts.limits);
  return driving.trajectory.duration_s() - now_s - straight_s >= kDetour_s;
}

void Replanner::Impl::hasten(const Driving& driving, double by_s) {
  (void)replan(departure_from(driving), Reason::kSooner, "the way may be free sooner", {},
               driving.trajectory.duration_s() - driving.time_s(now) - by_s);
}

bool Replanner::Impl::replan(detail::Departure departure, Reason reason, const std::string& cause,
                             std::optional<double> to_beat, std::optional<double> to_end_before_s) {
  last_replan = now;
  searched_in = field;
  double least_free_s = settings.takeover_s + settings.horizon_s;
  std::optional<detail::BlockedMotion> blocked;
  const auto* driving = std::get_if<Driving>(&phase);
  if (to_beat || to_end_before_s) {
    least_free_s = std::numeric_limits<double>::infinity();  // what is followed is free all the way
  } else if (driving && driving->blocked && !driving->is_aside) {
    const double begin_s = std::max(driving->blocked->begin_s, driving->time_s(now));
    blocked.emplace(driving->trajectory, begin_s, begin_s - driving->time_s(now));
  }
  detail::SearchResult found =
      search.run({field, *full_check, reach, prediction_check, predicted_from(now),
                  std::move(departure), now, to_beat, to_end_before_s, least_free_s, blocked});
  if (found.plan && !is_in_time()) {
    found.plan.reset();
    found.failure =
        "it came after " + std::to_string(1e-3 * watch.elapsed_ms()) + " s, too late to take over";
  }
  if (found.plan) return follow(found, reason, cause);
  const bool is_good =
      reason == Reason::kCost || reason == Reason::kSooner || reason == Reason::kAside;
  if (found.fault.empty() && is_good) return false;  // what is followed is good
  constexpr double kAgain_s = 10.0;
  const bool is_told =
      failing_told && found.fault.empty() && now.seconds() - failing_told->seconds() < kAgain_s;
  failed_at = now;
  if (found.refused != nullptr) {
    refused = found.refused;
    refused_free_s = found.refused_free_s;
  }
  const bool is_driving = std::holds_alternative<Driving>(phase);
  if (is_told && !is_driving) return false;
  failing_told = is_driving ? std::nullopt : std::optional(now);
  Event& event = tell(Event::Kind::kReplanFailed, found.fault.empty() ? reason : Reason::kPlugin,
                      found.fault.empty() ? cause + "; no plan of " + parts.optimiser_name +
                                                " will do: " + found.failure
                                          : found.fault);
  event.solve_ms = found.solve_ms;
  event.attempts = static_cast<int>(found.tried.size());
  event.tried = found.tried;
  event.refused = found.refused;
  if (!found.fault.empty()) halt(Reason::kPlugin, found.fault);
  return false;
}

bool Replanner::Impl::follow(const detail::SearchResult& found, Reason reason,
                             const std::string& cause) {
  const detail::FoundPlan& plan = *found.plan;
  const auto accepted =
      call_stage(parts.executor_name, [&] { return parts.executor.follow(plan.trajectory, now); });
  if (!accepted) {
    const std::string refusal = "the executor refused a trajectory: " + accepted.error().describe();
    Event& event = tell(Event::Kind::kReplanFailed, Reason::kExecutor, refusal);
    event.solve_ms = found.solve_ms;
    event.attempts = static_cast<int>(found.tried.size());
    event.tried = found.tried;
    if (accepted.error().code == ErrorCode::kPlugin) halt(Reason::kExecutor, refusal);
    // The next one begins where the robot is measured, should that be elsewhere.
    if (auto* resting = std::get_if<Resting>(&phase)) resting->at.reset();
    return false;
  }
  if (is_overdue()) overdue_by = parts.executor_name;
  const bool was_driving = std::holds_alternative<Driving>(phase);
  const bool was_slowed = halted && halted->reason == Reason::kMoving && motion() != nullptr;
  const bool is_clear = !std::isfinite(plan.free_until_s);
  last_start = now;
  const bool is_new = !plan.is_aside && !plan.is_rest;
  phase = Driving{
      {plan.trajectory, now}, field, is_clear, is_clear, {}, {}, false, plan.delay_s, plan.is_aside,
      is_new && !plan.at_once};
  if (is_new) {
    unfinished = plan.at_once.value_or(plan.trajectory);
    refused.reset();
  }
  is_moving = true;
  free_goal.reset();
  failing_told.reset();
  if (plan.frees_goal) free_goal = end_state(unfinished).q;
  if (halted) {
    if (!was_slowed) tell(Event::Kind::kRecovered, halted->reason, halted->cause);
    halted.reset();
    failed_stop.reset();
  }
  Event& event = tell(was_driving || was_slowed ? Event::Kind::kReplanned : Event::Kind::kPlanned,
                      reason, cause);
  event.solve_ms = found.solve_ms;
  event.guess = found.guess;
  event.tried = found.tried;
  event.attempts = static_cast<int>(found.tried.size());
  event.cost = plan.cost;
  event.splice_velocity_jump = plan.splice_velocity_jump;
  event.unknown_share = plan.unknown_share;
  if (std::isfinite(plan.free_until_s)) {
    event.cause += "; the way is free for " + std::to_string(plan.free_until_s) + " s";
  }
  event.takeover = Stamp::from_seconds(now.seconds() + plan.takeover_s);
  event.refused = found.refused;
  return true;
}

}  // namespace sidestep
