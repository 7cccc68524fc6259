#include <algorithm>
#include <utility>

#include <sidestep/runtime/loop_policies.hpp>

namespace sidestep {

/// What throws is noted as well.
template <class Ask>
auto NotedExecutor::noted(ExecutorCall& call, Ask ask) {
  const auto note = [&] {
    const std::lock_guard lock(mutex_);
    calls_.push_back(std::move(call));
  };
  try {
    auto answer = ask();
    call.succeeded = answer.has_value();
    note();
    return answer;
  } catch (...) {
    note();
    throw;
  }
}

Result<Executor::Measured> NotedExecutor::current() {
  ExecutorCall call{.kind = ExecutorCall::Kind::kCurrent};
  return noted(call, [&] {
    auto measured = executor_.current();
    if (measured) call.measured = *measured;
    return measured;
  });
}

Result<void> NotedExecutor::follow(const Trajectory& trajectory, Stamp start) {
  ExecutorCall call{.kind = ExecutorCall::Kind::kFollow,
                    .trajectory = std::make_shared<const Trajectory>(trajectory),
                    .start = start};
  return noted(call, [&] { return executor_.follow(trajectory, start); });
}

Result<void> NotedExecutor::stop() {
  ExecutorCall call{.kind = ExecutorCall::Kind::kStop};
  return noted(call, [&] { return executor_.stop(); });
}

std::vector<ExecutorCall> NotedExecutor::take_calls() {
  const std::lock_guard lock(mutex_);
  return std::exchange(calls_, {});
}

Replanner::Status JudgedLoop::step(Replanner& replanner, Stamp now,
                                   std::vector<ReplannerEvent>& events) {
  if (!policies_) return replanner.step(now, events);
  const std::size_t first = events.size();
  begin(now);
  step_.status = replanner.step(now, events);
  end(replanner, std::span(events).subspan(first));
  return step_.status;
}

void JudgedLoop::stop(Replanner& replanner, Stamp now, const std::string& cause,
                      std::vector<ReplannerEvent>& events) {
  if (!policies_) return replanner.stop(now, cause, events);
  const std::size_t first = events.size();
  begin(now);
  step_.is_end = true;
  replanner.stop(now, cause, events);
  end(replanner, std::span(events).subspan(first));
}

void JudgedLoop::begin(Stamp now) {
  step_ = {.now = now,
           .status = step_.status,
           .followed = std::move(step_.followed),
           .followed_start = step_.followed_start,
           .map = slot_.snapshot()};
  watch_.restart();
}

void JudgedLoop::end(const Replanner& replanner, std::span<const ReplannerEvent> events) {
  step_.took_s = 1e-3 * watch_.elapsed_ms();
  step_.events.assign(events.begin(), events.end());
  step_.calls = executor_.take_calls();
  const Trajectory& followed = replanner.followed();
  const bool is_same = step_.followed != nullptr &&
                       step_.followed_start == replanner.followed_start() &&
                       step_.followed->positions == followed.positions &&
                       step_.followed->times_s == followed.times_s;
  if (followed.size() == 0) {
    step_.followed = nullptr;
  } else if (!is_same) {
    step_.followed = std::make_shared<const Trajectory>(followed);
  }
  step_.followed_start = replanner.followed_start();
  step_.goal = replanner.goal();
  step_.checks = replanner.checks();
  step_.prediction = replanner.prediction();
  step_.has_new_map = slot_.pin() != step_.map.field;
  for (PolicyBreach& breach : policies_->judge(step_)) {
    const auto told = std::ranges::count(breaches_, breach.policy, &PolicyBreach::policy);
    if (told < kMost) breaches_.push_back(std::move(breach));
  }
}

}  // namespace sidestep
