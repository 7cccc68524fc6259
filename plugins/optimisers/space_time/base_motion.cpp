#include "base_motion.hpp"

#include <algorithm>
#include <cmath>
#include <optional>

namespace sidestep::detail {
namespace {

using Eigen::Vector2d;

/// From a state onto the straight line to the goal at `speed_mps`, and to rest; nothing where the
/// goal is passed before.
std::optional<Closing> close_at(const BaseState& from, const Vector2d& goal_m, double speed_mps,
                                const BaseLimits& limits) {
  const double a_mps2 = limits.acceleration_mps2;
  Vector2d turned_m = from.p_m;
  Vector2d cruise_mps = Vector2d::Zero();
  double turn_s = 0.0;
  // The direction depends on where the turn ends, and the other way round.
  constexpr int kRounds = 12;
  for (int i = 0; i < kRounds; ++i) {
    const double left_m = (goal_m - turned_m).norm();
    if (!(left_m > 0.0)) return std::nullopt;
    cruise_mps = speed_mps / left_m * (goal_m - turned_m);
    turn_s = (cruise_mps - from.v_mps).norm() / a_mps2;
    turned_m = from.p_m + 0.5 * turn_s * (from.v_mps + cruise_mps);
  }
  const double left_m = (goal_m - turned_m).dot(cruise_mps) / speed_mps;
  const double stop_m = 0.5 * speed_mps * speed_mps / a_mps2;
  constexpr double kBeside = 1e-3;  // of the way to rest, by which the line may miss the goal
  const double miss_m = (goal_m - turned_m - left_m / speed_mps * cruise_mps).norm();
  if (left_m < stop_m || miss_m > kBeside * stop_m) return std::nullopt;
  const double cruise_s = (left_m - stop_m) / speed_mps, stop_s = speed_mps / a_mps2;
  return Closing{{{{0.0, from},
                   {turn_s, {turned_m, cruise_mps}},
                   {cruise_s, {turned_m + cruise_s * cruise_mps, cruise_mps}},
                   {stop_s, {goal_m, Vector2d::Zero()}}}},
                 turn_s + cruise_s + stop_s};
}

/// The least time in which a point on a line, `ahead_m` before its goal and moving towards it at
/// `speed_mps`, is at rest there.
double least_on_line_s(double ahead_m, double speed_mps, const BaseLimits& limits) noexcept {
  const double a_mps2 = limits.acceleration_mps2;
  double begun_s = 0.0;
  double stop_m = 0.5 * speed_mps * speed_mps / a_mps2;
  if (speed_mps < 0.0 || stop_m > ahead_m) {  // it has to come back
    begun_s = std::abs(speed_mps) / a_mps2;
    ahead_m = speed_mps < 0.0 ? ahead_m + stop_m : stop_m - ahead_m;
    speed_mps = stop_m = 0.0;
  }
  const double top_mps = std::sqrt(a_mps2 * (ahead_m + stop_m));
  if (top_mps <= limits.speed_mps) return begun_s + (2.0 * top_mps - speed_mps) / a_mps2;
  const double fast_mps = limits.speed_mps;
  const double ramps_m = fast_mps * fast_mps / a_mps2 - stop_m;
  return begun_s + (2.0 * fast_mps - speed_mps) / a_mps2 + (ahead_m - ramps_m) / fast_mps;
}

}  // namespace

Closing close(const BaseState& from, const Vector2d& goal_m, const BaseLimits& limits) {
  if (auto closing = close_at(from, goal_m, limits.speed_mps, limits)) return *closing;
  std::optional<Closing> best;
  double low_mps = 0.0, high_mps = limits.speed_mps;
  constexpr int kHalvings = 10;
  for (int i = 0; i < kHalvings; ++i) {
    const double speed_mps = 0.5 * (low_mps + high_mps);
    auto closing = close_at(from, goal_m, speed_mps, limits);
    (closing ? low_mps : high_mps) = speed_mps;
    if (closing) best = closing;
  }
  if (best) return *best;
  const double a_mps2 = limits.acceleration_mps2;
  const double rest_s = from.v_mps.norm() / a_mps2;
  const BaseState rest{from.p_m + 0.5 * rest_s * from.v_mps, Vector2d::Zero()};
  const Vector2d way_m = goal_m - rest.p_m;
  const double length_m = way_m.norm();
  if (!(length_m > 0.0)) return Closing{{{{rest_s, rest}, {}, {}, {0.0, rest}}}, rest_s};
  const double speed_mps = std::min(limits.speed_mps, std::sqrt(a_mps2 * length_m));
  const Vector2d cruise_mps = speed_mps / length_m * way_m;
  const double ramp_s = speed_mps / a_mps2;
  const double cruise_s = length_m / speed_mps - ramp_s;
  const Vector2d turned_m = rest.p_m + 0.5 * ramp_s * cruise_mps;
  return Closing{{{{rest_s, rest},
                   {ramp_s, {turned_m, cruise_mps}},
                   {cruise_s, {turned_m + cruise_s * cruise_mps, cruise_mps}},
                   {ramp_s, {goal_m, Vector2d::Zero()}}}},
                 rest_s + 2.0 * ramp_s + cruise_s};
}

double least_duration_s(const BaseState& from, const Vector2d& goal_m,
                        const BaseLimits& limits) noexcept {
  const Vector2d way_m = goal_m - from.p_m;
  const double length_m = way_m.norm();
  const Vector2d along = length_m > 0.0 ? Vector2d(way_m / length_m) : Vector2d::UnitX();
  const double across_mps = along.x() * from.v_mps.y() - along.y() * from.v_mps.x();
  return std::max(least_on_line_s(length_m, along.dot(from.v_mps), limits),
                  least_on_line_s(0.0, across_mps, limits));
}

Vector2d place_on(const BaseState& from, const Stretch& stretch, double t) noexcept {
  if (t >= stretch.duration_s) return stretch.end.p_m;
  return from.p_m + t * from.v_mps +
         0.5 * t * t / stretch.duration_s * (stretch.end.v_mps - from.v_mps);
}

}  // namespace sidestep::detail
