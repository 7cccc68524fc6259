#include "view_feed.hpp"

#include <exception>

#include <sidestep/core/low_priority.hpp>

namespace sidestep {

ViewFeed::ViewFeed(std::vector<ViewSink*> sinks, Log& log, const ViewRates& rates)
    : maker_(std::move(sinks), rates),
      log_(log),
      period_(std::chrono::duration_cast<std::chrono::nanoseconds>(
          std::chrono::duration<double>(1.0 / rates.state_hz))),
      thread_([this](const std::stop_token& stop) { work(stop); }) {}

ViewFeed::~ViewFeed() { finish(); }

void ViewFeed::finish() {
  if (!thread_.joinable()) return;
  thread_.request_stop();
  thread_.join();
}

bool ViewFeed::make_once() {
  try {
    if (maker_.is_wanted()) maker_.make(std::chrono::steady_clock::now(), inbox_.take());
    return true;
  } catch (const std::exception& exception) {
    log_.warn(std::string("the viewer shows no more: ") + exception.what());
    return false;
  }
}

void ViewFeed::work(const std::stop_token& stop) {
  lower_thread_priority();
  auto next = std::chrono::steady_clock::now();
  std::unique_lock lock(mutex_);
  while (true) {
    const bool is_last = stop.stop_requested();  // What was told before is still made.
    if (!make_once() || is_last) return;
    next = std::max(next + period_, std::chrono::steady_clock::now());
    wake_.wait_until(lock, stop, next, [] { return false; });
  }
}

}  // namespace sidestep
