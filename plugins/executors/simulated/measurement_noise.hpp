#pragma once

#include <cstdint>

#include <Eigen/Core>

namespace sidestep::simulated {

/// Normal noise on joint positions. What is added at a step of the simulation depends on the seed
/// and that step alone, whenever and however often it is asked for.
class MeasurementNoise {
 public:
  MeasurementNoise(double sigma, std::uint64_t seed) : sigma_(sigma), seed_(seed) {}

  [[nodiscard]] Eigen::VectorXd measured(const Eigen::VectorXd& q, std::int64_t step) const;

 private:
  double sigma_;
  std::uint64_t seed_;
};

}  // namespace sidestep::simulated
