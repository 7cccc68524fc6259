// The simulator's frames, with the faults of a camera and its driver.
#include <algorithm>
#include <limits>

#include "fault_window.hpp"
#include "simulator.hpp"

namespace sidestep::faulty {
namespace {

struct Options : FaultOptions {
  simulator::Options as;
  static Parameters<Options> parameters() {
    return declare_fault<Options>({"throws", "fails", "ends", "stalls", "hangs", "out_of_order",
                                   "clock_back", "pose_missing", "pose_missing_at_once", "pose_nan",
                                   "depth_nan"})
        .add("as", &Options::as, "Parameters of what is wrapped.");
  }
  [[nodiscard]] std::vector<OptionMistake> check() const { return as.check(); }
};

class FaultySource final : public Source, public GroundTruth {
 public:
  FaultySource(const Options& options, std::unique_ptr<Source> camera, const Clock& clock)
      : window_(options, clock),
        camera_(std::move(camera)),
        truth_(dynamic_cast<const GroundTruth&>(*camera_)) {}

  Result<std::optional<Frame>> next(const Deadline& deadline) override {
    window_.pass("throws");
    if (window_.has("fails")) return fail(ErrorCode::kIo, "the cable is loose");
    if (window_.has("ends")) return std::optional<Frame>();
    if (window_.has("stalls")) return fail(ErrorCode::kDeadlineExceeded, "nothing arrived");
    if (window_.has("hangs")) window_.hang();
    if (window_.has("pose_missing_at_once")) return no_pose(0);
    return spoilt(in_order(deadline));
  }
  std::optional<std::int64_t> frame_count() const override { return camera_->frame_count(); }
  const Scene& scene() const override { return truth_.scene(); }

 private:
  /// Two by two, the later one first.
  Result<std::optional<Frame>> in_order(const Deadline& deadline) {
    if (late_ && is_overtaken_) {
      is_overtaken_ = false;
      return std::exchange(late_, std::nullopt);
    }
    auto frame = camera_->next(deadline);
    if (!window_.has("out_of_order") || !frame || !*frame) return frame;
    is_overtaken_ = late_.has_value();
    if (is_overtaken_) return frame;
    late_ = std::move(*frame);
    return fail(ErrorCode::kDeadlineExceeded, "the frame is on its way");
  }

  Result<std::optional<Frame>> spoilt(Result<std::optional<Frame>> frame) const {
    if (!frame || !*frame) return frame;
    if (window_.has("clock_back")) (*frame)->stamp.ns -= 1'000'000'000;
    if (window_.has("pose_missing")) return no_pose((*frame)->sequence);
    constexpr double kNaN = std::numeric_limits<double>::quiet_NaN();
    if (window_.has("pose_nan")) (*frame)->T_world_camera.translation().setConstant(kNaN);
    if (window_.has("depth_nan")) {
      auto& depth_m = std::get<DepthImage>((*frame)->measurement).depth_m;
      std::ranges::fill(depth_m, static_cast<float>(kNaN));
    }
    return frame;
  }

  static tl::unexpected<Error> no_pose(std::int64_t sequence) {
    return fail(ErrorCode::kBadFrame, "where the camera was is not known",
                "frame " + std::to_string(sequence));
  }

  FaultWindow window_;
  std::unique_ptr<Source> camera_;
  const GroundTruth& truth_;
  std::optional<Frame> late_;
  bool is_overtaken_ = false;
};

Result<std::unique_ptr<Source>> create(const Options& options, const HostContext& context) {
  auto camera = simulator::create_source(options.as, context);
  if (!camera) return tl::make_unexpected(std::move(camera.error()));
  return std::make_unique<FaultySource>(options, std::move(*camera), context.clock);
}

}  // namespace
}  // namespace sidestep::faulty

SIDESTEP_PLUGIN(sidestep::Source, sidestep::faulty::Options, sidestep::faulty::create, "faulty",
                "1", "The simulator, with faults")
