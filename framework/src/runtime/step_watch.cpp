#include <sidestep/runtime/step_watch.hpp>

#include <chrono>
#include <utility>

namespace sidestep {

StepWatch::StepWatch(double longest_s, std::function<void()> on_overdue)
    : longest_s_(longest_s),
      on_overdue_(std::move(on_overdue)),
      thread_([this](const std::stop_token& stop) { watch(stop); }) {}

void StepWatch::begin() {
  const std::lock_guard lock(mutex_);
  is_stepping_ = true;
  is_told_ = false;
  since_begin_.restart();
}

void StepWatch::end() {
  const std::lock_guard lock(mutex_);
  is_stepping_ = false;
}

/// Looks now and then: waking at every step would cost the steps more than it is worth.
void StepWatch::watch(const std::stop_token& stop) {
  const std::chrono::duration<double> period(0.1 * longest_s_);
  std::unique_lock lock(mutex_);
  while (!stop.stop_requested()) {
    wake_.wait_for(lock, stop, period, [] { return false; });
    if (!is_stepping_ || is_told_ || 1e-3 * since_begin_.elapsed_ms() <= longest_s_) continue;
    is_told_ = true;
    lock.unlock();
    on_overdue_();
    lock.lock();
  }
}

}  // namespace sidestep
