#pragma once

#include <algorithm>
#include <cmath>
#include <cstdint>

#include <sidestep/core/time.hpp>

namespace sidestep::simulator {

/// Frame k is taken at k / rate.
class FrameTiming {
 public:
  explicit FrameTiming(double rate_hz) : rate_hz_(rate_hz) {}

  [[nodiscard]] Stamp stamp(std::int64_t frame) const noexcept {
    return Stamp::from_seconds(static_cast<double>(frame) / rate_hz_);
  }

  /// The last frame that is taken at or before a time; -1 for none.
  [[nodiscard]] std::int64_t last_until(Stamp time) const noexcept {
    if (time.ns < 0) return -1;
    auto frame = static_cast<std::int64_t>(std::floor(time.seconds() * rate_hz_));
    // The quotient was rounded.
    while (stamp(frame + 1) <= time) ++frame;
    while (frame >= 0 && stamp(frame) > time) --frame;
    return frame;
  }

 private:
  double rate_hz_;
};

}  // namespace sidestep::simulator
