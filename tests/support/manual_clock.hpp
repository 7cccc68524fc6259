#pragma once

#include <atomic>

#include <sidestep/core/time.hpp>

namespace sidestep::testing_support {

/// Stands where it was last set. [any]
class ManualClock final : public Clock {
 public:
  [[nodiscard]] Stamp now() const noexcept override { return {ns_.load()}; }
  void set(Stamp stamp) noexcept { ns_ = stamp.ns; }
  void set_s(double seconds) noexcept { set(Stamp::from_seconds(seconds)); }

 private:
  std::atomic<std::int64_t> ns_ = 0;
};

}  // namespace sidestep::testing_support
