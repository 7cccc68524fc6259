#include <sidestep/runtime/loop_policies.hpp>

#include <array>
#include <cmath>

#include "policy_view.hpp"

namespace sidestep {
namespace detail {

bool PolicyView::is_clock_back() const {
  return memory.last && !step.is_end && step.now < memory.last->now;
}
bool PolicyView::is_active() const {
  const bool was_reached = memory.last && memory.last->status == Status::kReached;
  return !step.is_end && !was_reached && !is_clock_back();
}
const ExecutorCall* PolicyView::first_measurement() const {
  return first_call([](const ExecutorCall& call) { return call.kind == Call::kCurrent; });
}
bool PolicyView::is_senseless(const RobotState& state) const {
  const Eigen::Index dof = setup.robot->description().dof();
  const bool has_speeds = state.qdot.size() == 0 || state.qdot.size() == dof;
  return state.q.size() != dof || !has_speeds || !state.q.allFinite() || !state.qdot.allFinite();
}
const Executor::Measured* PolicyView::state() const {
  const ExecutorCall* call = first_measurement();
  if (call == nullptr || !call->measured || is_senseless(call->measured->state)) return nullptr;
  const double age_s = seconds_between(call->measured->stamp, step.now);
  return age_s > setup.settings.max_state_age_s ? nullptr : &*call->measured;
}
bool PolicyView::is_at_rest(const RobotState& state) const {
  return largest(state.qdot) < setup.settings.rest_speed;
}
const Trajectory* PolicyView::before() const {
  return memory.last ? memory.last->followed.get() : nullptr;
}
double PolicyView::before_s(Stamp stamp) const {
  return seconds_between(memory.last->followed_start, stamp);
}
bool PolicyView::is_stopping_after() const {
  if (step.followed == nullptr) return false;
  bool is_stopping = memory.is_stopping;
  for (const ReplannerEvent& event : step.events) {
    if (is_plan(event)) is_stopping = false;
    if (is_stop(event)) is_stopping = true;
  }
  return is_stopping;
}
bool PolicyView::stands_or_stops() const { return step.followed == nullptr || is_stopping_after(); }
const ReplannerEvent* PolicyView::search() const {
  if (is_clock_back()) return nullptr;
  return first_event([](const ReplannerEvent& event) {
    return is_plan(event) || event.kind == ReplannerEvent::Kind::kReplanFailed;
  });
}
bool PolicyView::looks_for_stop() const {
  constexpr double kAgain_s = 0.04;
  const auto& last = memory.last;
  return !last || !memory.looked_for_stop || step.map.field != last->map.field ||
         step.followed_start != last->followed_start ||
         seconds_between(*memory.looked_for_stop, step.now) >= kAgain_s;
}
std::optional<Sent> PolicyView::sent() const {
  const ExecutorCall* taken = first_call(
      [](const ExecutorCall& call) { return call.kind == Call::kFollow && call.succeeded; });
  if (taken == nullptr || taken->trajectory->size() < 2) return std::nullopt;
  const ReplannerEvent* plan = first_event(&is_plan);
  const ReplannerEvent* event = plan != nullptr ? plan : first_event(&is_stop);
  if (event == nullptr) return std::nullopt;
  Sent sent{*taken->trajectory, taken->start, *event, plan == nullptr};
  sent.takeover_s = sent.is_stop ? setup.settings.stop_lead_s
                                 : std::max(0.0, seconds_between(taken->start, event->takeover));
  return sent;
}

}  // namespace detail

namespace {

constexpr std::array kGroups = {&detail::policies_of_maps, &detail::policies_of_motions,
                                &detail::policies_of_stops};

}  // namespace

struct LoopPolicies::Impl {
  detail::LoopSetup setup;
  detail::LoopMemory memory;

  void remember(const detail::PolicyView& view);
};

LoopPolicies::LoopPolicies(std::shared_ptr<const RobotModel> robot, MotionLimits limits,
                           SpacePolicy space, ReplannerSettings settings) {
  std::vector<bool> fixed = fixed_spheres(*robot);
  impl_ = std::make_unique<Impl>(Impl{{std::move(robot), std::move(limits), std::move(space),
                                       std::move(settings), std::move(fixed)},
                                      {}});
}
LoopPolicies::LoopPolicies(LoopPolicies&&) noexcept = default;
LoopPolicies::~LoopPolicies() = default;

std::vector<LoopPolicy> LoopPolicies::all() {
  std::vector<LoopPolicy> policies;
  for (const auto group : kGroups) policies.insert(policies.end(), group().begin(), group().end());
  return policies;
}

std::vector<PolicyBreach> LoopPolicies::judge(const LoopStep& step) {
  const detail::PolicyView view{impl_->setup, impl_->memory, step};
  std::vector<PolicyBreach> breaches;
  for (const auto group : kGroups) {
    for (const detail::Policy& policy : group()) {
      std::string what = policy.broken(view);
      if (!what.empty()) breaches.push_back({policy.name, step.now, std::move(what)});
    }
  }
  impl_->remember(view);
  return breaches;
}

void LoopPolicies::Impl::remember(const detail::PolicyView& view) {
  const LoopStep& step = view.step;
  const auto sent = view.sent();
  const auto* measured = view.state();
  if (!memory.first) memory.first = step.now;
  if (!memory.q_first && measured != nullptr) memory.q_first = measured->state.q;
  if (sent && view.has_map()) {
    const double clearance_m = detail::clearance_at_start_m(view, sent->trajectory, 0.0);
    memory.has_left |= clearance_m < setup.settings.margin_m;
  }
  if (view.has_map() && view.looks_for_stop()) memory.looked_for_stop = step.now;
  if (view.is_clock_back()) memory.search.reset();
  if (view.search() != nullptr) memory.search = {step.now, step.map.field};
  const bool is_checked = memory.last && step.checks > memory.last->checks;
  if (is_checked) memory.checked = {memory.last->followed_start, step.map.field.get()};
  memory.is_stopping = view.is_stopping_after();
  for (const ReplannerEvent& event : step.events) {
    if (detail::is_stop(event)) memory.halted = event;
    if (detail::is_plan(event)) {
      memory.halted.reset();
      memory.planned_in = event.map_stamp;
    }
  }
  if (sent && !sent->is_stop) {
    const auto q = sent->trajectory.q(sent->trajectory.size() - 1);
    memory.plan_end = Eigen::Map<const Eigen::VectorXd>(q.data(), std::ssize(q));
  }
  for (const ExecutorCall& call : step.calls) {
    if (call.kind == ExecutorCall::Kind::kStop) memory.has_failed_stop = !call.succeeded;
    if (call.kind == ExecutorCall::Kind::kFollow && call.succeeded) memory.has_failed_stop = false;
  }
  if (view.is_active() && measured != nullptr && view.has_map()) {
    const Stamp stamp = step.map.field->info().stamp;
    const double age_s = step.now.seconds() - stamp.seconds();
    const bool is_later = memory.map == nullptr || !(stamp < memory.newest_map);
    if (std::abs(age_s) <= setup.settings.max_map_age_s && is_later) {
      memory.map = step.map.field;
      memory.newest_map = stamp;
    }
  }
  memory.last = step;
}

}  // namespace sidestep
