#pragma once

#include <atomic>
#include <chrono>

#include <sidestep/core/time.hpp>

namespace sidestep {

/// The clock of an episode, from zero: moved by hand, or running with the wall's once started.
/// [any]
class EpisodeClock final : public Clock {
 public:
  [[nodiscard]] Stamp now() const noexcept override {
    const std::int64_t start_ns = start_ns_;
    return start_ns == 0 ? Stamp{ns_} : Stamp{wall_ns() - start_ns};
  }
  void set(Stamp stamp) noexcept { ns_ = stamp.ns; }
  /// From where it is; it may run already.
  void start() noexcept {
    if (start_ns_ == 0) start_ns_ = wall_ns() - ns_;
  }

 private:
  [[nodiscard]] static std::int64_t wall_ns() noexcept {
    return std::chrono::duration_cast<std::chrono::nanoseconds>(
               std::chrono::steady_clock::now().time_since_epoch())
        .count();
  }
  std::atomic<std::int64_t> ns_ = 0;
  std::atomic<std::int64_t> start_ns_ = 0;  ///< 0: not started.
};

}  // namespace sidestep
