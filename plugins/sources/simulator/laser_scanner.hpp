#pragma once

#include <cstdint>
#include <vector>

#include <sidestep/geometry/ray_caster.hpp>
#include <sidestep/sensing/frame.hpp>

#include "depth_sensor.hpp"
#include "simulator.hpp"

namespace sidestep::simulator {

/// A planar laser scanner: beams in the plane z = 0 of its frame (x forward, z up), from right to
/// left. All beams of a scan are taken at once.
class LaserScanner {
 public:
  LaserScanner(const LaserOptions& options, const Range& range, std::uint64_t seed);

  /// One point a beam; NaN where nothing came back. The errors depend on the seed, the frame's
  /// number and the beam alone.
  void scan(const RayCaster& caster, const Transform& T_world_laser, std::int64_t frame,
            std::vector<Eigen::Vector3f>& points_m);

  /// Of a beam of that length.
  [[nodiscard]] Eigen::Vector3f point_m(std::size_t beam, double length_m) const {
    return (length_m * directions_[beam]).cast<float>();
  }

 private:
  LaserOptions options_;
  Range range_;
  std::uint64_t seed_;
  std::vector<Eigen::Vector3d> directions_, directions_world_;
  std::vector<double> distances_m_;
};

}  // namespace sidestep::simulator
