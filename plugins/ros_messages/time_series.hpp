#pragma once

#include <algorithm>
#include <cstdint>
#include <deque>
#include <utility>

#include <tl/expected.hpp>

#include <sidestep/core/time.hpp>

namespace sidestep::ros_messages {

/// Why there is no value at a time.
enum class LookupFault : std::uint8_t {
  kUnknown,       ///< There is nothing of that name at all.
  kNotConnected,  ///< Both frames are there, without a path between them.
  kTooEarly,      ///< What is known begins later.
  kTooLate,       ///< What is known ends earlier; for a live stream, it may still come.
  kGap,           ///< The values around that time are too far apart to go between.
  kReparented,    ///< A frame changed its parent around that time.
};

/// Values at times, in whatever order they come. One thread at a time.
template <class Value>
class TimeSeries {
 public:
  struct Sample {
    Stamp stamp;
    Value value;
  };
  /// The samples at or around a time; both are the same one where it has that very stamp.
  struct Bracket {
    const Sample* before;
    const Sample* after;
    double share;  ///< How far the time is on the way from `before` to `after`, in [0, 1).
  };

  /// False, and nothing is changed, where there is a value of that stamp.
  bool add(Stamp stamp, Value value) {
    auto at = samples_.end();  // Most come in order.
    if (!samples_.empty() && samples_.back().stamp >= stamp) {
      at = std::ranges::lower_bound(samples_, stamp, {}, &Sample::stamp);
      if (at->stamp == stamp) return false;
    }
    samples_.insert(at, Sample{stamp, std::move(value)});
    return true;
  }

  /// Fails with kUnknown, kTooEarly, kTooLate, or with kGap where the two samples around `stamp`
  /// are more than `max_gap_s` apart.
  [[nodiscard]] tl::expected<Bracket, LookupFault> around(Stamp stamp, double max_gap_s) const {
    if (samples_.empty()) return tl::make_unexpected(LookupFault::kUnknown);
    const auto after = std::ranges::lower_bound(samples_, stamp, {}, &Sample::stamp);
    if (after == samples_.end()) return tl::make_unexpected(LookupFault::kTooLate);
    if (after->stamp == stamp) return Bracket{&*after, &*after, 0.0};
    if (after == samples_.begin()) return tl::make_unexpected(LookupFault::kTooEarly);
    const auto before = std::prev(after);
    const double gap_s = static_cast<double>(after->stamp.ns - before->stamp.ns) * 1e-9;
    if (gap_s > max_gap_s) return tl::make_unexpected(LookupFault::kGap);
    const double share = static_cast<double>(stamp.ns - before->stamp.ns) * 1e-9 / gap_s;
    return Bracket{&*before, &*after, share};
  }

  /// Forgets what no lookup at `stamp` or later needs.
  void forget_before(Stamp stamp) {
    while (samples_.size() > 1 && samples_[1].stamp <= stamp) samples_.pop_front();
  }

  [[nodiscard]] const std::deque<Sample>& samples() const noexcept { return samples_; }

 private:
  std::deque<Sample> samples_;
};

}  // namespace sidestep::ros_messages
