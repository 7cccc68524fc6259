#pragma once

#include <cmath>
#include <cstdint>
#include <numbers>
#include <utility>

namespace sidestep::simulator {

[[nodiscard]] inline std::uint64_t mix(std::uint64_t value) {  // SplitMix64
  value += 0x9e3779b97f4a7c15ULL;
  value = (value ^ (value >> 30)) * 0xbf58476d1ce4e5b9ULL;
  value = (value ^ (value >> 27)) * 0x94d049bb133111ebULL;
  return value ^ (value >> 31);
}

/// The random numbers of one pixel, or of one beam, of one frame.
class PixelRandom {
 public:
  PixelRandom(std::uint64_t frame_seed, std::uint64_t pixel) : state_(mix(frame_seed ^ pixel)) {}

  /// In (0, 1).
  double uniform() {
    state_ = mix(state_);
    return (static_cast<double>(state_ >> 11) + 0.5) * 0x1p-53;
  }
  /// Two independent standard normal numbers (Box and Muller 1958).
  std::pair<double, double> normals() {
    const double radius = std::sqrt(-2.0 * std::log(uniform()));
    const double angle = 2.0 * std::numbers::pi * uniform();
    return {radius * std::cos(angle), radius * std::sin(angle)};
  }

 private:
  std::uint64_t state_;
};

}  // namespace sidestep::simulator
