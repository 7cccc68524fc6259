#pragma once

#include <cstdint>
#include <functional>
#include <map>
#include <optional>
#include <string>

#include <sidestep/core/log.hpp>
#include <sidestep/core/time.hpp>

namespace sidestep::ros1_source {

/// Counts frames that are dropped, and says why, once a second at most. One thread at a time.
class FrameDrops {
 public:
  /// `time_s` tells any clock that goes on.
  FrameDrops(Log& log, std::function<double()> time_s) : log_(log), time_s_(std::move(time_s)) {}

  /// `kind` in a word or two, to count by; `reason` in a sentence without full stop.
  void add(const std::string& kind, const std::string& reason);

  [[nodiscard]] std::int64_t total() const noexcept { return total_; }
  /// "3 frames dropped: 2 tf late, 1 tf jumped"
  [[nodiscard]] std::string describe() const;

 private:
  Log& log_;
  std::function<double()> time_s_;
  std::map<std::string, std::int64_t> counts_;
  std::int64_t total_ = 0;
  std::int64_t untold_ = 0;
  std::optional<double> told_s_;
};

}  // namespace sidestep::ros1_source
