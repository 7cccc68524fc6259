#pragma once

#include <atomic>
#include <cstdint>

#include <sidestep/core/time.hpp>

namespace sidestep::conformance {

/// Stands but where it is moved by hand. [any]
class ManualClock final : public Clock {
 public:
  explicit ManualClock(Stamp now = {}) : ns_(now.ns) {}

  [[nodiscard]] Stamp now() const noexcept override { return {ns_.load()}; }
  void set(Stamp stamp) noexcept { ns_ = stamp.ns; }
  void set_s(double seconds) noexcept { set(Stamp::from_seconds(seconds)); }
  void advance_s(double seconds) noexcept { ns_ += Stamp::from_seconds(seconds).ns; }

 private:
  std::atomic<std::int64_t> ns_;
};

}  // namespace sidestep::conformance
