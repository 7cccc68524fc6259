#include <sidestep/runtime/prediction.hpp>

#include <algorithm>

#include <sidestep/core/format.hpp>
#include <sidestep/runtime/call_plugin.hpp>

namespace sidestep {
namespace {

/// What makes a prediction no answer to a request; empty if nothing does.
std::string why_unusable(const Prediction& prediction, const PredictionRequest& request) {
  constexpr double kRounding_s = 1e-9;
  if (prediction.stamp() != request.tracks.stamp) {
    return format("is of %.3f s, not of the tracks", prediction.stamp().seconds());
  }
  for (const Track& track : request.tracks.tracks) {
    const auto of_track = [&](const PredictedSet& set) { return set.track == track.id; };
    const std::string name = "track " + std::to_string(track.id);
    if (std::ranges::none_of(prediction.sets(), of_track)) return "leaves out " + name;
    for (const PredictedSet& set : prediction.sets()) {
      if (!of_track(set)) continue;
      if (set.knots.front().time_s > kRounding_s) return "begins too late for " + name;
      if (set.knots.back().time_s < request.horizon_s - kRounding_s) {
        return "ends before the horizon for " + name;
      }
    }
  }
  return {};
}

}  // namespace

Prediction predict(Predictor& predictor, const std::string& name, const PredictionRequest& request,
                   Log& log) {
  auto predicted = call_stage(name, [&] { return predictor.predict(request); });
  const std::string trouble =
      predicted ? why_unusable(*predicted, request) : predicted.error().describe();
  if (trouble.empty()) return *std::move(predicted);
  log.warn(name + (predicted ? ": its prediction " : " failed: ") + trouble +
           "; the worst case stands in for it");
  return worst_case_prediction(request.tracks, kWalkingSpeed_mps, request.horizon_s);
}

}  // namespace sidestep
