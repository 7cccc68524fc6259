#include <sidestep/plugin/plugin.hpp>

#include "walkers.hpp"

namespace {

using namespace sidestep;

struct Options : Spread {
  static Parameters<Options> parameters() { return declare_spread<Options>(); }
};

class ConstantVelocity final : public Predictor {
 public:
  explicit ConstantVelocity(const Options& options) : options_(options) {}
  [[nodiscard]] Result<Prediction> predict(const PredictionRequest& request) override {
    const std::vector<double> times_s = options_.times_s(request.horizon_s);
    Paths paths;
    for (const Track& track : request.tracks.tracks) {
      paths.push_back(straight_path(track, times_s));
    }
    return predict_along(request.tracks, times_s, paths, options_);
  }

 private:
  Options options_;
};

Result<std::unique_ptr<Predictor>> create(const Options& options, const HostContext&) {
  return std::make_unique<ConstantVelocity>(options);
}

}  // namespace

SIDESTEP_PLUGIN(sidestep::Predictor, Options, create, "constant_velocity", "0.1.0",
                "Each track keeps its velocity, with growing uncertainty")
