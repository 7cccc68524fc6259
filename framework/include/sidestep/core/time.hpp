#pragma once

#include <algorithm>
#include <chrono>
#include <compare>
#include <cstdint>
#include <optional>
#include <stop_token>

#include <sidestep/core/export.hpp>

namespace sidestep {

/// An instant on the clock of the run (sensor time), in nanoseconds from that clock's zero.
struct Stamp {
  std::int64_t ns = 0;

  [[nodiscard]] static constexpr Stamp from_seconds(double seconds) noexcept {
    return Stamp{static_cast<std::int64_t>(seconds * 1e9 + (seconds < 0 ? -0.5 : 0.5))};
  }
  [[nodiscard]] constexpr double seconds() const noexcept { return static_cast<double>(ns) * 1e-9; }
  friend constexpr auto operator<=>(const Stamp&, const Stamp&) = default;
};

/// Tells the time of the run: wall time, recorded time or simulated time. [any] thread.
class SIDESTEP_EXPORT Clock {
 public:
  virtual ~Clock() = default;
  [[nodiscard]] virtual Stamp now() const noexcept = 0;
};

/// When work must be handed back, whether finished or not: a point on the steady clock, a
/// request to stop, either, or neither. Cheap to copy; expired() costs about 30 ns. [any].
class Deadline {
 public:
  using SteadyClock = std::chrono::steady_clock;

  /// Never expires.
  Deadline() = default;
  explicit Deadline(std::stop_token stop) : stop_(std::move(stop)) {}
  explicit Deadline(SteadyClock::time_point at, std::stop_token stop = {})
      : at_(at), stop_(std::move(stop)) {}

  /// `seconds` from now; more than a century counts as one, NaN as past.
  [[nodiscard]] static Deadline after_s(double seconds, std::stop_token stop = {}) {
    constexpr double kCentury_s = 3.2e9;  // What the clock's nanoseconds can hold, thrice.
    seconds = seconds > -kCentury_s ? std::min(seconds, kCentury_s) : -kCentury_s;
    return Deadline(SteadyClock::now() + std::chrono::duration_cast<SteadyClock::duration>(
                                             std::chrono::duration<double>(seconds)),
                    std::move(stop));
  }

  /// This deadline, or `seconds` from now if that is sooner; the stop request is kept.
  [[nodiscard]] Deadline capped_s(double seconds) const {
    Deadline capped = after_s(seconds, stop_);
    if (at_ && *at_ < *capped.at_) capped.at_ = at_;
    return capped;
  }

  [[nodiscard]] bool stop_requested() const noexcept { return stop_.stop_requested(); }
  [[nodiscard]] bool expired() const noexcept {
    return stop_.stop_requested() || (at_ && SteadyClock::now() >= *at_);
  }
  /// Seconds left, infinity if there is no limit, never negative.
  [[nodiscard]] double remaining_s() const noexcept;

 private:
  std::optional<SteadyClock::time_point> at_;
  std::stop_token stop_;
};

/// Measures elapsed wall time from its construction. [any]
class Stopwatch {
 public:
  [[nodiscard]] double elapsed_ms() const noexcept {
    return std::chrono::duration<double, std::milli>(std::chrono::steady_clock::now() - start_)
        .count();
  }
  void restart() noexcept { start_ = std::chrono::steady_clock::now(); }

 private:
  std::chrono::steady_clock::time_point start_ = std::chrono::steady_clock::now();
};

}  // namespace sidestep
