#pragma once

#include <stop_token>
#include <thread>

namespace sidestep {

/// While it lives, the first SIGINT or SIGTERM requests a stop; one that comes half a second later
/// or more ends the process as it would without us. To be made before other threads are, which
/// inherit the blocked signals.
class StopOnSignal {
 public:
  StopOnSignal();
  ~StopOnSignal();
  StopOnSignal(const StopOnSignal&) = delete;
  StopOnSignal& operator=(const StopOnSignal&) = delete;

  [[nodiscard]] std::stop_token token() const noexcept { return stop_.get_token(); }

 private:
  std::stop_source stop_;
  std::jthread waiter_;
};

}  // namespace sidestep
