#pragma once

#include <memory>

#include <sidestep/plugin/plugin.hpp>

namespace turns_back {

struct Options {
  double probability = 0.2;
  double widening_mps = 0.2;

  static sidestep::Parameters<Options> parameters();
};

/// Two alternatives for each track: it goes on at its velocity, or turns back at once.
class TurnsBack final : public sidestep::Predictor {
 public:
  explicit TurnsBack(const Options& options) : options_(options) {}

  [[nodiscard]] sidestep::Result<sidestep::Prediction> predict(
      const sidestep::PredictionRequest& request) override;

 private:
  Options options_;
};

sidestep::Result<std::unique_ptr<sidestep::Predictor>> create(const Options& options,
                                                              const sidestep::HostContext& context);

}  // namespace turns_back
