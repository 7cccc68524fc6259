#include "social_force.hpp"

#include <algorithm>
#include <cmath>
#include <numbers>

namespace sidestep {

Eigen::Vector2d social_force(const OrcaAgent& self, const Eigen::Vector2d& preferred_mps,
                             std::span<const OrcaAgent> others, std::span<const OrcaWall> walls) {
  constexpr double kRelaxation_s = 0.5;
  constexpr double kPeople_mps2 = 7.0, kPeopleRange_m = 0.3;  // 2.1 m^2/s^2 over 0.3 m
  constexpr double kWalls_mps2 = 50.0, kWallsRange_m = 0.2;   // 10 m^2/s^2 over 0.2 m
  constexpr double kBehind = 0.5;
  const double half_view = std::cos(100.0 / 180.0 * std::numbers::pi);
  Eigen::Vector2d force = (preferred_mps - self.velocity_mps) / kRelaxation_s;
  for (const OrcaAgent& other : others) {
    const Eigen::Vector2d away = self.position_m - other.position_m;
    const double distance_m = std::max(1e-6, away.norm());
    const double ahead = -away.dot(preferred_mps);
    const bool is_seen = ahead >= half_view * distance_m * preferred_mps.norm();
    force += (is_seen ? 1.0 : kBehind) * kPeople_mps2 *
             std::exp((self.radius_m + other.radius_m - distance_m) / kPeopleRange_m) * away /
             distance_m;
  }
  for (const OrcaWall& wall : walls) {
    const Eigen::Vector2d away = self.position_m - wall.nearest_m;
    const double distance_m = std::max(1e-6, away.norm());
    force +=
        kWalls_mps2 * std::exp((self.radius_m - distance_m) / kWallsRange_m) * away / distance_m;
  }
  return force;
}

}  // namespace sidestep
