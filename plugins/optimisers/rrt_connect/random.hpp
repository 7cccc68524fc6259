#pragma once

#include <cstdint>

namespace sidestep::rrt_connect {

/// SplitMix64 (Steele, Lea and Flood, OOPSLA 2014): samples are drawn by the million, and most are
/// thrown away.
class Random {
 public:
  explicit Random(std::uint64_t seed) : state_(seed) {}

  /// At least 0 and less than 1.
  [[nodiscard]] double unit() noexcept {
    std::uint64_t bits = state_ += 0x9e3779b97f4a7c15u;
    bits = (bits ^ (bits >> 30)) * 0xbf58476d1ce4e5b9u;
    bits = (bits ^ (bits >> 27)) * 0x94d049bb133111ebu;
    return static_cast<double>((bits ^ (bits >> 31)) >> 11) * 0x1p-53;
  }

 private:
  std::uint64_t state_;
};

}  // namespace sidestep::rrt_connect
