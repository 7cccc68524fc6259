#include <sidestep/runtime/predict.hpp>

#include <map>
#include <string>

#include <sidestep/core/format.hpp>
#include <sidestep/runtime/call_plugin.hpp>

namespace sidestep {
namespace {

constexpr double kPredictionRounding = 1e-9;  // s; of likelihoods, too

/// The part of the contract of a predictor of tracks that Prediction::create() does not check.
Result<void> check_sets(const Prediction& prediction, const PredictionRequest& request) {
  std::map<std::int64_t, double> likelihoods;
  for (const Track& track : request.tracks.tracks) likelihoods[track.id] = 0.0;
  for (const PredictedSet& set : prediction.sets()) {
    const std::string of_track = "the set of track " + std::to_string(set.track);
    const auto likelihood = likelihoods.find(set.track);
    if (likelihood == likelihoods.end()) return invalid(of_track + " is of none of the tracks");
    likelihood->second += set.likelihood;
    const double begin_s = set.knots.front().time_s, end_s = set.knots.back().time_s;
    if (begin_s > kPredictionRounding) {
      return invalid(of_track + format(" begins late, %g s after the tracks", begin_s));
    }
    if (end_s < request.horizon_s - kPredictionRounding) {
      return invalid(of_track + format(" ends after %g s, before the horizon of %g s", end_s,
                                       request.horizon_s));
    }
  }
  for (const auto& [id, sum] : likelihoods) {
    const std::string track = "track " + std::to_string(id);
    if (sum == 0.0) return invalid(track + " has no set");
    if (sum > 1.0 + kPredictionRounding) {
      return invalid("the likelihoods of " + track + format(" sum to %g", sum));
    }
  }
  return {};
}

}  // namespace

Result<void> check_prediction(const Prediction& prediction, const PredictionRequest& request,
                              PredictionSubject subject) {
  if (prediction.stamp() != request.tracks.stamp) {
    return invalid(format("the prediction has the stamp %.9f s, the tracks %.9f s",
                          prediction.stamp().seconds(), request.tracks.stamp.seconds()));
  }
  return subject == PredictionSubject::kTracks ? check_sets(prediction, request) : Result<void>();
}

Result<Prediction> predict(Predictor& predictor, const std::string& name,
                           const PredictionRequest& request, Log& log) {
  if (predictor.subject() != PredictionSubject::kNothing) {
    SIDESTEP_TRY(check_tracks(request.tracks));
  }
  auto prediction = call_stage(name, [&]() -> Result<Prediction> {
    auto its = SIDESTEP_TRY(predictor.predict(request));
    SIDESTEP_TRY(check_prediction(its, request, predictor.subject()));
    return its;
  });
  if (prediction) return prediction;
  log.warn(prediction.error().describe() + "; the worst case stands in for it");
  return worst_case_prediction(request.tracks, kWalkingSpeed_mps, request.horizon_s);
}

}  // namespace sidestep
