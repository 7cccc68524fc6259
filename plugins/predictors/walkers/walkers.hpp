#pragma once

#include <limits>
#include <optional>
#include <span>
#include <vector>

#include <Eigen/Core>

#include <sidestep/planning/prediction.hpp>
#include <sidestep/plugin/parameters.hpp>

namespace sidestep {

/// How wide the set of a track becomes with time. Options of a predictor derive from it.
struct Spread {
  double step_s = 0.25;
  double sigmas = 1.0;
  double acceleration_noise = 0.1;
  double max_growth_m = 0.5;

  /// 0, step_s, 2 step_s, ..., horizon_s; 0 alone where there is no horizon.
  [[nodiscard]] std::vector<double> times_s(double horizon_s) const;

  /// Radius of a track's set that long after its position: that of the track, and `sigmas` times
  /// the largest standard deviation of a position that began with the track's covariance and moves
  /// at a velocity under white noise; at most `max_growth_m` more than at time 0.
  [[nodiscard]] double radius_m(const Track& track, double time_s) const noexcept;
};

/// Where each track's centre is at each time, track by track.
using Paths = std::vector<std::vector<Eigen::Vector2d>>;

/// Where a track's centre is at each time if it keeps its velocity, and turns back at `turn_s`.
[[nodiscard]] std::vector<Eigen::Vector2d> straight_path(
    const Track& track, std::span<const double> times_s,
    double turn_s = std::numeric_limits<double>::infinity());

/// The set of a track along a path, as many places as times.
[[nodiscard]] PredictedSet set_along(const Track& track, std::span<const double> times_s,
                                     std::span<const Eigen::Vector2d> path, const Spread& spread);

/// A set for each track along its path. Fails as Prediction::create().
[[nodiscard]] Result<Prediction> predict_along(const Tracks& tracks,
                                               std::span<const double> times_s, const Paths& paths,
                                               const Spread& spread);

/// What a walker has beside itself, as its distance field says.
struct WallBeside {
  double distance_m;       ///< Of the walker's axis.
  Eigen::Vector2d normal;  ///< From the wall to the walker; unit length.
};

/// The wall nearest to a place at a track's middle height. None where the field ends, is not given,
/// or what is nearest lies above or below, as a floor.
[[nodiscard]] std::optional<WallBeside> wall_beside(const Track& track, const Eigen::Vector2d& at_m,
                                                    const DistanceField* field) noexcept;

/// Declares a predictor's spread; a predictor adds its own.
template <class Options>
Parameters<Options> declare_spread() {
  return Parameters<Options>()
      .add("step_s", &Options::step_s, "Time between the knots of a set.",
           {.unit = "s", .min = 0.02, .max = 10.0})
      .add("sigmas", &Options::sigmas,
           "Standard deviations of the predicted position by which a set is wider than its track.",
           {.min = 0.0, .max = 10.0})
      .add("acceleration_noise", &Options::acceleration_noise,
           "Square root of the spectral density of unforeseen accelerations.",
           {.unit = "m/s^1.5", .min = 0.0, .max = 10.0})
      .add("max_growth_m", &Options::max_growth_m, "Largest growth of a set's radius.",
           {.unit = "m", .min = 0.0, .max = 100.0});
}

}  // namespace sidestep
