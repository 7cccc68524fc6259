#include "laser_scanner.hpp"

#include <cmath>
#include <limits>

#include <sidestep/core/index.hpp>

#include "pixel_random.hpp"

namespace sidestep::simulator {

LaserScanner::LaserScanner(const LaserOptions& options, const Range& range, std::uint64_t seed)
    : options_(options), range_(range), seed_(seed) {
  const double step_rad = (options.to_rad - options.from_rad) / std::max(1, options.beams - 1);
  for (int beam = 0; beam < options.beams; ++beam) {
    const double angle_rad = options.from_rad + beam * step_rad;
    directions_.emplace_back(std::cos(angle_rad), std::sin(angle_rad), 0.0);
  }
  directions_world_.resize(directions_.size());
  distances_m_.resize(directions_.size());
}

void LaserScanner::scan(const RayCaster& caster, const Transform& T_world_laser, std::int64_t frame,
                        std::vector<Eigen::Vector3f>& points_m) {
  for (std::size_t beam = 0; beam < directions_.size(); ++beam) {
    directions_world_[beam] = T_world_laser.linear() * directions_[beam];
  }
  caster.cast_distances(T_world_laser.translation(), directions_world_, distances_m_);
  const std::uint64_t frame_seed = mix(seed_ ^ mix(static_cast<std::uint64_t>(frame)));
  points_m.assign(directions_.size(),
                  Eigen::Vector3f::Constant(std::numeric_limits<float>::quiet_NaN()));
  for (std::size_t beam = 0; beam < directions_.size(); ++beam) {
    PixelRandom random(frame_seed, beam);
    const bool is_lost = random.uniform() < options_.dropout;
    const double distance_m = distances_m_[beam] + options_.sigma_m * random.normals().first;
    if (is_lost || !(distance_m >= range_.min_m && distance_m <= range_.max_m)) continue;
    points_m[beam] = point_m(beam, distance_m);
  }
}

}  // namespace sidestep::simulator
