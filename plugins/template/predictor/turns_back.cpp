// A predictor: whoever walks goes on, or turns back.
#include "turns_back.hpp"

#include <utility>

namespace turns_back {

using namespace sidestep;

Parameters<Options> Options::parameters() {
  return Parameters<Options>()
      .add("probability", &Options::probability, "That a track turns back.",
           {.min = 0.01, .max = 0.99})
      .add("widening_mps", &Options::widening_mps, "How fast the radius of a set grows.",
           {.unit = "m/s", .min = 0.0});
}

Result<Prediction> TurnsBack::predict(const PredictionRequest& request) {
  std::vector<PredictedSet> sets;
  for (const Track& track : request.tracks.tracks) {
    for (const double way : {1.0, -1.0}) {
      PredictedSet& set = sets.emplace_back();
      set.track = track.id;
      // Sets of one track are alternatives: their likelihoods sum to 1 at most.
      set.likelihood = way > 0.0 ? 1.0 - options_.probability : options_.probability;
      set.bottom_m = track.bottom_m;
      set.top_m = track.top_m;
      // From time 0, that of the tracks, until the horizon; linear from knot to knot.
      set.knots = {{0.0, track.position_m, track.radius_m}};
      if (request.horizon_s <= 0.0) continue;
      set.knots.push_back({request.horizon_s,
                           track.position_m + way * request.horizon_s * track.velocity_mps,
                           track.radius_m + options_.widening_mps * request.horizon_s});
    }
  }
  // Refuses what is not finite, naming the track.
  return Prediction::create(request.tracks.stamp, std::move(sets));
}

Result<std::unique_ptr<Predictor>> create(const Options& options, const HostContext&) {
  return std::make_unique<TurnsBack>(options);
}

}  // namespace turns_back

SIDESTEP_PLUGIN(sidestep::Predictor, turns_back::Options, turns_back::create, "turns_back", "0.1.0",
                "Whatever moves goes on or turns back: an example of a plugin")
