#include "walkers.hpp"

#include <algorithm>
#include <cmath>

namespace sidestep {
namespace {

/// Obstacles whose distance grows sideways by less are above or below.
constexpr double kLeastSideways = 0.3;
constexpr double kMostKnots = 1e4;

}  // namespace

std::vector<double> Spread::times_s(double horizon_s) const {
  std::vector<double> times_s{0.0};
  if (!(horizon_s > 0.0)) return times_s;
  const auto steps = static_cast<int>(std::min(std::ceil(horizon_s / step_s - 1e-9), kMostKnots));
  for (int k = 1; k < steps; ++k) times_s.push_back(k * step_s);
  times_s.push_back(horizon_s);
  return times_s;
}

double Spread::radius_m(const Track& track, double time_s) const noexcept {
  // P(t) = F P F^T + Q (Bar-Shalom, Li and Kirubarajan 2001, 6.2.2), of which the positions.
  Track later = track;
  const Eigen::Matrix4d& now = track.covariance;
  const Eigen::Matrix2d cross = now.topRightCorner<2, 2>();
  later.covariance.topLeftCorner<2, 2>() +=
      time_s * (cross + cross.transpose()) + time_s * time_s * now.bottomRightCorner<2, 2>() +
      std::pow(acceleration_noise, 2) * std::pow(time_s, 3) / 3.0 * Eigen::Matrix2d::Identity();
  const double at_first_m = sigmas * position_deviation_m(track);
  const double growth_m = sigmas * position_deviation_m(later) - at_first_m;
  return track.radius_m + at_first_m + std::clamp(growth_m, 0.0, max_growth_m);
}

std::vector<Eigen::Vector2d> straight_path(const Track& track, std::span<const double> times_s,
                                           double turn_s) {
  std::vector<Eigen::Vector2d> path;
  for (const double time_s : times_s) {
    const double way_s = std::min(time_s, 2.0 * turn_s - time_s);
    path.push_back(track.position_m + way_s * track.velocity_mps);
  }
  return path;
}

PredictedSet set_along(const Track& track, std::span<const double> times_s,
                       std::span<const Eigen::Vector2d> path, const Spread& spread) {
  PredictedSet set{track.id, 1.0, track.bottom_m, track.top_m, {}};
  for (std::size_t k = 0; k < times_s.size(); ++k) {
    set.knots.push_back({times_s[k], path[k], spread.radius_m(track, times_s[k])});
  }
  return set;
}

Result<Prediction> predict_along(const Tracks& tracks, std::span<const double> times_s,
                                 const Paths& paths, const Spread& spread) {
  std::vector<PredictedSet> sets;
  for (std::size_t i = 0; i < tracks.tracks.size(); ++i) {
    sets.push_back(set_along(tracks.tracks[i], times_s, paths[i], spread));
  }
  return Prediction::create(tracks.stamp, std::move(sets));
}

std::optional<WallBeside> wall_beside(const Track& track, const Eigen::Vector2d& at_m,
                                      const DistanceField* field) noexcept {
  if (field == nullptr) return std::nullopt;
  const Eigen::Vector3d p_m(at_m.x(), at_m.y(), 0.5 * (track.bottom_m + track.top_m));
  double distance_m = 0.0;
  Eigen::Vector3d gradient;
  FieldStatus status = FieldStatus::kKnown;
  field->query({&p_m, 1}, {&distance_m, 1}, {&gradient, 1}, {&status, 1});
  const double sideways = gradient.head<2>().norm();
  if (status == FieldStatus::kOutside || !std::isfinite(distance_m) ||
      !(sideways > kLeastSideways)) {
    return std::nullopt;
  }
  return WallBeside{distance_m, gradient.head<2>() / sideways};
}

}  // namespace sidestep
