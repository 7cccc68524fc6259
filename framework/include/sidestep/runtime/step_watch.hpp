#pragma once

#include <condition_variable>
#include <functional>
#include <mutex>
#include <thread>

#include <sidestep/core/time.hpp>

namespace sidestep {

/// Does something about a step that does not come back, by the wall's clock, while it goes on: once
/// for each such step, in a thread of its own. begin() and end() by turns, from one thread.
class StepWatch {
 public:
  StepWatch(double longest_s, std::function<void()> on_overdue);

  void begin();
  void end();

 private:
  void watch(const std::stop_token& stop);

  double longest_s_;
  std::function<void()> on_overdue_;
  std::mutex mutex_;
  std::condition_variable_any wake_;
  bool is_stepping_ = false;
  bool is_told_ = false;  ///< Of this step.
  Stopwatch since_begin_;
  std::jthread thread_;  ///< The last: it uses the others.
};

}  // namespace sidestep
