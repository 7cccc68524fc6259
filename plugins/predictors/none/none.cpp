#include <sidestep/plugin/plugin.hpp>

namespace {

using namespace sidestep;

struct Options {
  static Parameters<Options> parameters() { return {}; }
};

class None final : public Predictor {
 public:
  [[nodiscard]] Result<Prediction> predict(const PredictionRequest& request) override {
    return Prediction::create(request.tracks.stamp, {});
  }
  [[nodiscard]] PredictionSubject subject() const noexcept override {
    return PredictionSubject::kNothing;
  }
};

Result<std::unique_ptr<Predictor>> create(const Options&, const HostContext&) {
  return std::make_unique<None>();
}

}  // namespace

SIDESTEP_PLUGIN(sidestep::Predictor, Options, create, "none", "0.1.0",
                "Predicts nothing: obstacles are where the map shows them")
