#include <algorithm>
#include <cmath>

#include <sidestep/plugin/plugin.hpp>

#include "walkers.hpp"

namespace {

using namespace sidestep;

constexpr double kStep_s = 0.05;
constexpr double kMostSteps = 1e4;

struct Options : Spread {
  double clearance_m = 0.1;
  double reach_m = 0.5;

  static Parameters<Options> parameters() {
    return declare_spread<Options>()
        .add("clearance_m", &Options::clearance_m, "Distance that walkers keep from walls.",
             {.unit = "m", .min = 0.0, .max = 10.0})
        .add("reach_m", &Options::reach_m, "Walkers begin to turn this much farther from a wall.",
             {.unit = "m", .min = 1e-3, .max = 10.0});
  }
};

/// Walkers keep their present velocity, less the part that leads into a wall.
class GoalDirected final : public Predictor {
 public:
  explicit GoalDirected(const Options& options) : options_(options) {}
  [[nodiscard]] Result<Prediction> predict(const PredictionRequest& request) override {
    const std::vector<double> times_s = options_.times_s(request.horizon_s);
    Paths paths;
    for (const Track& track : request.tracks.tracks) {
      std::vector<Eigen::Vector2d>& path = paths.emplace_back();
      path.push_back(track.position_m);
      for (std::size_t k = 1; k < times_s.size(); ++k) {
        path.push_back(walk(track, path.back(), times_s[k] - times_s[k - 1], request.field));
      }
    }
    return predict_along(request.tracks, times_s, paths, options_);
  }

 private:
  [[nodiscard]] Eigen::Vector2d walk(const Track& track, Eigen::Vector2d at_m, double duration_s,
                                     const DistanceField* field) const {
    if (field == nullptr) return at_m + duration_s * track.velocity_mps;
    // No step is longer than the margin in which walls turn a walker.
    const double longest_s =
        std::min(kStep_s, 0.2 * options_.reach_m / std::max(track.velocity_mps.norm(), 1e-9));
    const double steps = std::clamp(std::ceil(duration_s / longest_s), 1.0, kMostSteps);
    for (int i = 0; i < static_cast<int>(steps); ++i) {
      at_m += duration_s / steps * deflected(track, at_m, *field);
    }
    return at_m;
  }

  /// The track's velocity at a place: the part towards what is near there fades with the distance
  /// to it.
  [[nodiscard]] Eigen::Vector2d deflected(const Track& track, const Eigen::Vector2d& at_m,
                                          const DistanceField& field) const {
    const auto wall = wall_beside(track, at_m, &field);
    const double towards_mps = wall ? -track.velocity_mps.dot(wall->normal) : 0.0;
    if (!(towards_mps > 0.0)) return track.velocity_mps;
    const double spare_m = wall->distance_m - track.radius_m - options_.clearance_m;
    const double share = std::clamp(1.0 - spare_m / options_.reach_m, 0.0, 1.0);
    return track.velocity_mps + share * towards_mps * wall->normal;
  }

  Options options_;
};

Result<std::unique_ptr<Predictor>> create(const Options& options, const HostContext&) {
  return std::make_unique<GoalDirected>(options);
}

}  // namespace

SIDESTEP_PLUGIN(sidestep::Predictor, Options, create, "goal_directed", "0.1.0",
                "Each track keeps its velocity, along walls where there are any")
