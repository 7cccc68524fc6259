#include "stop_on_signal.hpp"

#include <pthread.h>

#include <chrono>
#include <csignal>
#include <ctime>

namespace sidestep {
namespace {

/// Signals this soon after the first are the same wish: coreutils' timeout sends one to the process
/// and one to its group.
constexpr auto kSameWish = std::chrono::milliseconds(500);

sigset_t handled_signals() {
  sigset_t signals;
  sigemptyset(&signals);
  sigaddset(&signals, SIGINT);
  sigaddset(&signals, SIGTERM);
  return signals;
}

void wait_for_signals(const std::stop_token& done, const std::stop_source& stop) {
  const sigset_t signals = handled_signals();
  const timespec interval{0, 100'000'000};
  std::chrono::steady_clock::time_point first;
  while (!done.stop_requested()) {
    const int signal = sigtimedwait(&signals, nullptr, &interval);
    if (signal < 0) continue;
    const auto now = std::chrono::steady_clock::now();
    if (stop.request_stop()) first = now;
    if (now - first < kSameWish) continue;
    std::signal(signal, SIG_DFL);
    pthread_sigmask(SIG_UNBLOCK, &signals, nullptr);
    std::raise(signal);
  }
}

}  // namespace

StopOnSignal::StopOnSignal() {
  const sigset_t signals = handled_signals();
  pthread_sigmask(SIG_BLOCK, &signals, nullptr);
  waiter_ =
      std::jthread([stop = stop_](const std::stop_token& done) { wait_for_signals(done, stop); });
}

StopOnSignal::~StopOnSignal() = default;

}  // namespace sidestep
