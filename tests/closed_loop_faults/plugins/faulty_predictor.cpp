// The worst case, with faults.
#include <limits>

#include "fault_window.hpp"

namespace sidestep::faulty {
namespace {

struct Options : FaultOptions {
  static Parameters<Options> parameters() {
    return declare_fault<Options>({"throws", "throws_a_number", "fails", "nan", "late",
                                   "ends_early", "old_stamp", "leaves_one_out", "invents_one",
                                   "too_likely"});
  }
};

class FaultyPredictor final : public Predictor {
 public:
  FaultyPredictor(const Options& options, const Clock& clock)
      : window_(options, clock), fault_(options.fault) {}

  Result<Prediction> predict(const PredictionRequest& request) override {
    window_.pass("throws");
    if (window_.has("throws_a_number")) throw 7;
    if (window_.has("fails")) return fail(ErrorCode::kUnsupported, "has no crystal ball");
    const Prediction worst =
        SIDESTEP_TRY(worst_case_prediction(request.tracks, 1.0, request.horizon_s, 0.0));
    if (!window_.is_open()) return worst;
    return spoilt(worst.stamp(), worst.sets());
  }

 private:
  [[nodiscard]] Result<Prediction> spoilt(Stamp stamp, std::vector<PredictedSet> sets) const {
    if (fault_ == "old_stamp") stamp.ns -= 1'000'000'000;
    if (!sets.empty()) {
      PredictedSet& last = sets.back();
      if (fault_ == "nan") last.knots[0].radius_m = std::numeric_limits<double>::quiet_NaN();
      if (fault_ == "late") last.knots[0].time_s = 0.1;
      if (fault_ == "ends_early") last.knots.back().time_s *= 0.5;
      if (fault_ == "invents_one") ++last.track;
      if (fault_ == "too_likely") sets.push_back(last);
      if (fault_ == "leaves_one_out") sets.pop_back();
    }
    return Prediction::create(stamp, std::move(sets));
  }

  FaultWindow window_;
  std::string fault_;
};

Result<std::unique_ptr<Predictor>> create(const Options& options, const HostContext& context) {
  return std::make_unique<FaultyPredictor>(options, context.clock);
}

}  // namespace
}  // namespace sidestep::faulty

SIDESTEP_PLUGIN(sidestep::Predictor, sidestep::faulty::Options, sidestep::faulty::create, "faulty",
                "1", "The worst case, with faults")
