#include "simulator.hpp"

#include <utility>

#include <sidestep/geometry/ray_caster.hpp>

#include "camera_path.hpp"
#include "depth_noise.hpp"
#include "depth_renderer.hpp"
#include "load_scene.hpp"

namespace sidestep::simulator {
namespace {

CameraIntrinsics intrinsics(const CameraOptions& options) {
  return {options.width_px, options.height_px, options.fx_px,
          options.fy_px,    options.cx_px,     options.cy_px};
}

class Simulator final : public Source, public GroundTruth {
 public:
  Simulator(const Options& options, Scene scene, CameraPath path, WorkerPool& workers,
            std::uint64_t seed)
      : frames_(options.frames),
        rate_hz_(options.rate_hz),
        camera_(intrinsics(options.camera)),
        scene_(std::move(scene)),
        path_(std::move(path)),
        workers_(workers),
        caster_(scene_),
        renderer_(camera_),
        sensor_(camera_, {options.range_min_m, options.range_max_m}, options.noise, seed) {}

  Result<std::optional<Frame>> next(const Deadline& deadline) override {
    if (deadline.stop_requested()) return fail(ErrorCode::kCancelled, "rendering was cancelled");
    if (frames_ > 0 && at_ >= frames_) return std::optional<Frame>();
    if (deadline.expired()) {
      return fail(ErrorCode::kDeadlineExceeded, "no time was left to render a frame");
    }
    std::optional<Frame> frame(std::in_place);
    frame->sequence = at_++;
    frame->stamp = Stamp::from_seconds(static_cast<double>(frame->sequence) / rate_hz_);
    frame->T_world_camera = path_.T_world_camera(frame->stamp.seconds());
    caster_.set_time(frame->stamp.seconds());
    renderer_.render(caster_, frame->T_world_camera, workers_, exact_);
    DepthImage image{camera_, {}};
    sensor_.measure(exact_, frame->sequence, workers_, image.depth_m);
    frame->measurement = std::move(image);
    return frame;
  }

  std::optional<std::int64_t> frame_count() const override {
    if (frames_ == 0) return {};
    return frames_;
  }

  const Scene& scene() const override { return scene_; }

 private:
  std::int64_t frames_;
  double rate_hz_;
  CameraIntrinsics camera_;
  Scene scene_;
  CameraPath path_;
  WorkerPool& workers_;
  RayCaster caster_;
  DepthRenderer renderer_;
  DepthSensor sensor_;
  ExactImage exact_;
  std::int64_t at_ = 0;
};

}  // namespace

std::vector<OptionMistake> Options::check() const {
  std::vector<OptionMistake> mistakes = check_camera_path(camera_path);
  if (range_min_m >= range_max_m) {
    mistakes.push_back({{"range_min_m", "range_max_m"}, "must be less than range_max_m", {}});
  }
  return mistakes;
}

Result<std::unique_ptr<Source>> create_source(const Options& options, const HostContext& context) {
  auto scene = load_scene(options.scene, context.scene_paths, context.documents);
  if (!scene) return tl::make_unexpected(scene.error());
  return std::unique_ptr<Source>(std::make_unique<Simulator>(
      options, std::move(*scene), CameraPath(options.camera_path, options.camera_path_repeats),
      context.workers, context.seed));
}

}  // namespace sidestep::simulator
