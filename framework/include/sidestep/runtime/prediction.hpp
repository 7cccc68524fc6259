#pragma once

#include <string>

#include <sidestep/core/log.hpp>
#include <sidestep/planning/prediction.hpp>

namespace sidestep {

/// ISO 13855: the speed at which somebody walks up.
inline constexpr double kWalkingSpeed_mps = 1.6;

/// What a predictor says of the request's tracks. Where it throws or fails, leaves a track out, or
/// predicts of another stamp, too late, or not as far as was asked: the worst case, at
/// kWalkingSpeed_mps, and a warning that names `name`. [planning]; allocates.
[[nodiscard]] Prediction predict(Predictor& predictor, const std::string& name,
                                 const PredictionRequest& request, Log& log);

}  // namespace sidestep
