#pragma once

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <utility>
#include <vector>

#include <sidestep/core/time.hpp>

namespace sidestep::rosbag {

/// When recorded frames are due on the clock of a run that plays them: the first one when it
/// begins, the others as long after that as they were recorded, divided by `rate`.
class Playback {
 public:
  /// Stamps do not decrease.
  Playback(std::vector<Stamp> recorded, double rate)
      : recorded_(std::move(recorded)), rate_(rate) {}

  /// Counts the first time only.
  void start(Stamp now) noexcept {
    if (!begin_) begin_ = now;
  }

  [[nodiscard]] Stamp due(std::size_t frame) const noexcept {
    const auto since_first_ns = static_cast<double>(recorded_[frame].ns - recorded_.front().ns);
    return Stamp{begin_->ns + static_cast<std::int64_t>(since_first_ns / rate_)};
  }

  /// The last frame that is due; nothing where none is.
  [[nodiscard]] std::optional<std::size_t> newest_due(Stamp now) const noexcept {
    std::size_t due_count = 0;
    for (std::size_t left = recorded_.size(); left > 0;) {  // a binary search
      const std::size_t half = left / 2;
      if (due(due_count + half) <= now) {
        due_count += half + 1;
        left -= half + 1;
      } else {
        left = half;
      }
    }
    if (due_count == 0) return std::nullopt;
    return due_count - 1;
  }

 private:
  std::vector<Stamp> recorded_;
  double rate_;
  std::optional<Stamp> begin_;
};

}  // namespace sidestep::rosbag
