#include <sidestep/geometry/orca.hpp>

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <optional>
#include <utility>
#include <vector>

namespace sidestep {
namespace {

/// Below this two lines count as parallel, and an offset as none.
constexpr double kParallel = 1e-9;

/// Velocities v with normal . v >= offset_mps; the normal has unit length.
struct HalfPlane {
  Eigen::Vector2d normal;
  double offset_mps = 0.0;

  [[nodiscard]] double violation_mps(const Eigen::Vector2d& velocity_mps) const {
    return offset_mps - normal.dot(velocity_mps);
  }
};

/// A quarter turn to the left.
Eigen::Vector2d left_of(const Eigen::Vector2d& v) { return {-v.y(), v.x()}; }

/// The unit vector along `v`, or `otherwise` where it has no direction.
Eigen::Vector2d direction_of(const Eigen::Vector2d& v, const Eigen::Vector2d& otherwise) {
  const double length = v.norm();
  return length > kParallel ? Eigen::Vector2d(v / length) : otherwise;
}

/// The boundary of a velocity obstacle where it is nearest to a relative velocity: the least
/// change of that velocity that ends there, and the outward normal there.
struct Escape {
  Eigen::Vector2d change_mps;
  Eigen::Vector2d normal;
};

/// Out of the disc of the relative velocities that lead to contact at `time_s` exactly.
Escape leave_disc(const Eigen::Vector2d& offset_m, const Eigen::Vector2d& velocity_mps,
                  double radius_m, double time_s) {
  const Eigen::Vector2d from_centre = velocity_mps - offset_m / time_s;
  const Eigen::Vector2d away = direction_of(-offset_m, Eigen::Vector2d::UnitX());
  const Eigen::Vector2d normal = direction_of(from_centre, away);
  return {(radius_m / time_s - from_centre.norm()) * normal, normal};
}

/// Out of the velocity obstacle of a disc of `radius_m` at `offset_m`, for the time horizon: a
/// cone from the origin around the disc, truncated by the disc that is met at the horizon. Discs
/// that overlap come apart within a step.
Escape leave_obstacle(const Eigen::Vector2d& offset_m, const Eigen::Vector2d& velocity_mps,
                      double radius_m, const OrcaSettings& settings) {
  const double distance_m = offset_m.norm();
  if (distance_m <= radius_m) {
    return leave_disc(offset_m, velocity_mps, radius_m, settings.step_s);
  }
  // The legs touch the disc where its normal, by the axis, is -radius / distance: nearer to the
  // origin than that, the disc itself is the boundary.
  const Eigen::Vector2d from_centre = velocity_mps - offset_m / settings.horizon_s;
  if (from_centre.dot(offset_m) < -radius_m * from_centre.norm()) {
    return leave_disc(offset_m, velocity_mps, radius_m, settings.horizon_s);
  }
  const Eigen::Vector2d axis = offset_m / distance_m;
  const double along = -radius_m / distance_m;
  const double across = std::sqrt(1.0 - along * along);
  const double side = left_of(axis).dot(from_centre) > 0.0 ? 1.0 : -1.0;
  const Eigen::Vector2d normal = along * axis + side * across * left_of(axis);
  return {-velocity_mps.dot(normal) * normal, normal};
}

HalfPlane half_plane_of(const OrcaAgent& self, const OrcaAgent& other,
                        const OrcaSettings& settings) {
  const Escape escape =
      leave_obstacle(other.position_m - self.position_m, self.velocity_mps - other.velocity_mps,
                     self.radius_m + other.radius_m, settings);
  // Each of the two does half of the change.
  return {escape.normal, escape.normal.dot(self.velocity_mps + 0.5 * escape.change_mps)};
}

/// The agent's disc stays on its side of the line through the nearest point for the wall's
/// horizon, or comes back to it within a step.
HalfPlane half_plane_of(const OrcaAgent& self, const OrcaWall& wall, const OrcaSettings& settings) {
  const Eigen::Vector2d away = self.position_m - wall.nearest_m;
  const double spare_m = away.norm() - self.radius_m;
  const double time_s = spare_m > 0.0 ? settings.wall_horizon_s : settings.step_s;
  return {direction_of(away, Eigen::Vector2d::UnitX()), -spare_m / time_s};
}

/// What is wanted of a velocity: to be near to a point, or far along a direction.
struct Objective {
  Eigen::Vector2d vector;
  bool is_direction = false;
};

/// The best point of a half plane's line within the disc of the greatest speed and the half planes
/// before it; none where there is no such point.
std::optional<Eigen::Vector2d> best_on_line(std::span<const HalfPlane> planes, std::size_t line,
                                            double max_speed_mps, const Objective& objective) {
  const HalfPlane& plane = planes[line];
  const double square = max_speed_mps * max_speed_mps - plane.offset_mps * plane.offset_mps;
  if (square < 0.0) return {};
  const Eigen::Vector2d foot = plane.offset_mps * plane.normal;
  const Eigen::Vector2d along = left_of(plane.normal);
  double upper = std::sqrt(square);
  double lower = -upper;
  for (const HalfPlane& other : planes.first(line)) {
    const double slope = other.normal.dot(along);
    const double missing = other.violation_mps(foot);
    if (std::abs(slope) <= kParallel) {
      if (missing > kParallel) return {};
    } else if (slope > 0.0) {
      lower = std::max(lower, missing / slope);
    } else {
      upper = std::min(upper, missing / slope);
    }
    if (lower > upper) return {};
  }
  const double wanted = objective.vector.dot(along);
  if (objective.is_direction) return foot + (wanted > 0.0 ? upper : lower) * along;
  return foot + std::clamp(wanted, lower, upper) * along;
}

/// A solution of the 2-D programme, or the last one before the half plane that leaves none.
struct Solution {
  Eigen::Vector2d velocity_mps;
  std::optional<std::size_t> infeasible;
};

/// The best velocity of the disc of the greatest speed that satisfies all half planes, one after
/// the other (de Berg et al., "Computational Geometry", chapter 4).
Solution solve_plane(std::span<const HalfPlane> planes, double max_speed_mps,
                     const Objective& objective) {
  Eigen::Vector2d best = objective.vector;
  if (objective.is_direction || best.norm() > max_speed_mps) {
    best = max_speed_mps * direction_of(best, Eigen::Vector2d::Zero());
  }
  for (std::size_t i = 0; i < planes.size(); ++i) {
    if (planes[i].violation_mps(best) <= 0.0) continue;
    const auto point = best_on_line(planes, i, max_speed_mps, objective);
    if (!point) return {best, i};
    best = *point;
  }
  return {best, {}};
}

/// The velocity that breaks half planes by the least maximum, and the first `hard` ones not at all
/// where that is possible. A 3-D linear programme in velocity and violation, solved on one plane's
/// facet after the other, each a 2-D one.
Eigen::Vector2d least_violation(std::span<const HalfPlane> planes, std::size_t hard,
                                double max_speed_mps, const Solution& begun) {
  if (*begun.infeasible < hard) hard = 0;
  Eigen::Vector2d best = begun.velocity_mps;
  double violation_mps = 0.0;
  for (std::size_t i = *begun.infeasible; i < planes.size(); ++i) {
    if (planes[i].violation_mps(best) <= violation_mps) continue;
    // On this facet no earlier half plane is broken by more than this one.
    std::vector<HalfPlane> facet(planes.begin(),
                                 planes.begin() + static_cast<std::ptrdiff_t>(hard));
    for (const HalfPlane& other : planes.subspan(hard, i - hard)) {
      const Eigen::Vector2d normal = other.normal - planes[i].normal;
      const double length = normal.norm();
      if (length <= kParallel) continue;
      facet.push_back({normal / length, (other.offset_mps - planes[i].offset_mps) / length});
    }
    const Solution solution = solve_plane(facet, max_speed_mps, {planes[i].normal, true});
    if (!solution.infeasible) best = solution.velocity_mps;
    violation_mps = planes[i].violation_mps(best);
  }
  return best;
}

/// Agents within the distance, the nearest first, no more than count; equals in their order.
std::vector<const OrcaAgent*> neighbours_of(const OrcaAgent& self,
                                            std::span<const OrcaAgent> others,
                                            const OrcaSettings& settings) {
  std::vector<std::pair<double, const OrcaAgent*>> near;
  for (const OrcaAgent& other : others) {
    const double distance_m = (other.position_m - self.position_m).norm();
    if (distance_m < settings.neighbour_distance_m) near.emplace_back(distance_m, &other);
  }
  std::ranges::stable_sort(near, {}, &std::pair<double, const OrcaAgent*>::first);
  std::vector<const OrcaAgent*> nearest;
  for (const auto& [distance_m, other] : near) {
    if (static_cast<int>(nearest.size()) == settings.neighbours) break;
    nearest.push_back(other);
  }
  return nearest;
}

}  // namespace

Eigen::Vector2d orca_velocity(const OrcaAgent& self, const Eigen::Vector2d& preferred_mps,
                              double max_speed_mps, std::span<const OrcaAgent> others,
                              std::span<const OrcaWall> walls, const OrcaSettings& settings) {
  std::vector<HalfPlane> planes;
  for (const OrcaWall& wall : walls) planes.push_back(half_plane_of(self, wall, settings));
  for (const OrcaAgent* other : neighbours_of(self, others, settings)) {
    planes.push_back(half_plane_of(self, *other, settings));
  }
  const Solution solution = solve_plane(planes, max_speed_mps, {preferred_mps, false});
  if (!solution.infeasible) return solution.velocity_mps;
  return least_violation(planes, walls.size(), max_speed_mps, solution);
}

}  // namespace sidestep
