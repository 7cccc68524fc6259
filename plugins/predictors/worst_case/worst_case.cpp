#include <sidestep/plugin/plugin.hpp>

namespace {

using namespace sidestep;

struct Options {
  double speed_mps = kWalkingSpeed_mps;
  double sigmas = 2.0;

  static Parameters<Options> parameters() {
    return Parameters<Options>()
        .add("speed_mps", &Options::speed_mps, "Speed in any direction (ISO 13855: 1.6 m/s).",
             {.unit = "m/s", .min = 0.0, .max = 100.0})
        .add("sigmas", &Options::sigmas,
             "Standard deviations of the position by which a set is wider than its track.",
             {.min = 0.0, .max = 10.0});
  }
};

class WorstCase final : public Predictor {
 public:
  explicit WorstCase(const Options& options) : options_(options) {}
  [[nodiscard]] Result<Prediction> predict(const PredictionRequest& request) override {
    return worst_case_prediction(request.tracks, options_.speed_mps, request.horizon_s,
                                 options_.sigmas);
  }

 private:
  Options options_;
};

Result<std::unique_ptr<Predictor>> create(const Options& options, const HostContext&) {
  return std::make_unique<WorstCase>(options);
}

}  // namespace

SIDESTEP_PLUGIN(sidestep::Predictor, Options, create, "worst_case", "0.1.0",
                "Each track may go anywhere at walking speed")
