#pragma once

#include <string>

#include <sidestep/core/log.hpp>
#include <sidestep/planning/prediction.hpp>

namespace sidestep {

/// The contract of a predictor with that subject, as far as Prediction::create() does not check it.
/// Fails with kInvalidArgument, naming the track. [any]; allocates.
[[nodiscard]] Result<void> check_prediction(const Prediction& prediction,
                                            const PredictionRequest& request,
                                            PredictionSubject subject);

/// What a predictor says of the request's tracks, checked against its contract. Where it throws or
/// fails, has another stamp or, being of tracks, leaves one out, adds one, begins late, ends before
/// the horizon or is too likely: the worst case, at kWalkingSpeed_mps, and one warning that names
/// `name` (kind and name, e.g. "predictor orca") and what is wrong.
///
/// Fails with kInvalidArgument, naming the track, where a track itself makes no sense: nothing can
/// be said of where that is, and the map leaves it out. One of nothing (PredictionSubject) does
/// not look at tracks. [planning]; allocates.
[[nodiscard]] Result<Prediction> predict(Predictor& predictor, const std::string& name,
                                         const PredictionRequest& request, Log& log);

}  // namespace sidestep
