#include <algorithm>

#include <sidestep/geometry/orca.hpp>
#include <sidestep/plugin/plugin.hpp>

#include "walkers.hpp"

namespace {

using namespace sidestep;

struct Options : Spread {
  double horizon_s = 5.0;
  double max_speed_mps = kWalkingSpeed_mps;
  bool sees_robot = false;

  static Parameters<Options> parameters() {
    return declare_spread<Options>()
        .add("horizon_s", &Options::horizon_s, "Walkers avoid collisions within this time.",
             {.unit = "s", .min = 0.1, .max = 60.0})
        .add("max_speed_mps", &Options::max_speed_mps,
             "Speed limit of walkers that make way; a faster one keeps its present speed.",
             {.unit = "m/s", .min = 0.0, .max = 100.0})
        .add("sees_robot", &Options::sees_robot,
             "Walkers make way for the robot, which keeps its present velocity.");
  }
};

/// Walkers prefer their present velocity, and make way for each other.
class Orca final : public Predictor {
 public:
  explicit Orca(const Options& options) : options_(options) {}
  [[nodiscard]] Result<Prediction> predict(const PredictionRequest& request) override {
    const std::vector<double> times_s = options_.times_s(request.horizon_s);
    std::vector<OrcaAgent> agents;
    Paths paths;
    for (const Track& track : request.tracks.tracks) {
      agents.push_back({track.position_m, track.velocity_mps, track.radius_m});
      paths.push_back({track.position_m});
    }
    if (options_.sees_robot && request.robot != nullptr) {
      agents.push_back(
          {request.robot->position_m, request.robot->velocity_mps, request.robot->radius_m});
    }
    for (std::size_t k = 1; k < times_s.size(); ++k) {
      step(request, times_s[k] - times_s[k - 1], agents);
      for (std::size_t i = 0; i < paths.size(); ++i) paths[i].push_back(agents[i].position_m);
    }
    return predict_along(request.tracks, times_s, paths, options_);
  }

 private:
  /// All walkers choose by what is now, then all move.
  void step(const PredictionRequest& request, double step_s, std::vector<OrcaAgent>& agents) const {
    OrcaSettings settings;
    settings.horizon_s = options_.horizon_s;
    settings.step_s = step_s;
    const std::vector<Track>& tracks = request.tracks.tracks;
    std::vector<Eigen::Vector2d> chosen_mps;
    for (std::size_t i = 0; i < tracks.size(); ++i) {
      std::vector<OrcaAgent> others = agents;
      others.erase(others.begin() + static_cast<std::ptrdiff_t>(i));
      std::vector<OrcaWall> walls;
      const auto wall = wall_beside(tracks[i], agents[i].position_m, request.field);
      if (wall && wall->distance_m >= 0.0) {
        walls.push_back({agents[i].position_m - wall->distance_m * wall->normal});
      }
      const Eigen::Vector2d& preferred_mps = tracks[i].velocity_mps;
      chosen_mps.push_back(orca_velocity(agents[i], preferred_mps,
                                         std::max(options_.max_speed_mps, preferred_mps.norm()),
                                         others, walls, settings));
    }
    for (std::size_t i = 0; i < agents.size(); ++i) {
      if (i < chosen_mps.size()) agents[i].velocity_mps = chosen_mps[i];
      agents[i].position_m += step_s * agents[i].velocity_mps;
    }
  }

  Options options_;
};

Result<std::unique_ptr<Predictor>> create(const Options& options, const HostContext&) {
  return std::make_unique<Orca>(options);
}

}  // namespace

SIDESTEP_PLUGIN(sidestep::Predictor, Options, create, "orca", "0.1.0",
                "Tracks make way for each other, and for the robot if told to")
