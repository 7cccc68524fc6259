#include "measurement_noise.hpp"

#include <cmath>
#include <numbers>

namespace sidestep::simulated {
namespace {

std::uint64_t mix(std::uint64_t value) {  // SplitMix64
  value += 0x9e3779b97f4a7c15ULL;
  value = (value ^ (value >> 30)) * 0xbf58476d1ce4e5b9ULL;
  value = (value ^ (value >> 27)) * 0x94d049bb133111ebULL;
  return value ^ (value >> 31);
}

/// In (0, 1).
double uniform(std::uint64_t& state) {
  state = mix(state);
  return (static_cast<double>(state >> 11) + 0.5) * 0x1p-53;
}

}  // namespace

Eigen::VectorXd MeasurementNoise::measured(const Eigen::VectorXd& q, std::int64_t step) const {
  if (sigma_ == 0.0) return q;
  std::uint64_t state = mix(seed_ ^ mix(static_cast<std::uint64_t>(step)));
  Eigen::VectorXd noisy = q;
  for (double& value : noisy) {  // Box and Muller 1958
    const double radius = std::sqrt(-2.0 * std::log(uniform(state)));
    value += sigma_ * radius * std::cos(2.0 * std::numbers::pi * uniform(state));
  }
  return noisy;
}

}  // namespace sidestep::simulated
