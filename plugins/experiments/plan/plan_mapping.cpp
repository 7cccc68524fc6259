#include "plan_parts.hpp"

#include <algorithm>
#include <bit>
#include <functional>
#include <numeric>

#include <sidestep/runtime/run_observer.hpp>

namespace sidestep {
namespace {

constexpr int kMaxPictureWidth_px = 320;
constexpr std::int64_t kCommitEvery = 50;  // frames

/// Series "frame": times and counts of one frame.
void record_frame(const MappingStep& step, std::int64_t item, Recorder& recorder) {
  recorder.add("frame", item, "sequence", step.frame_sequence);
  recorder.add("frame", item, "stamp_s", step.stamp.seconds());
  recorder.add("frame", item, "read_ms", step.read_ms);
  recorder.add("frame", item, "integrate_ms", step.integrate_ms);
  recorder.add("frame", item, "field_ms", step.field_ms);
  recorder.add("frame", item, "publish_ms", step.publish_ms);
  recorder.add("frame", item, "frame_ms", step.frame_ms());
  recorder.add("frame", item, "changed_blocks", step.update.changed_blocks.size());
  const IntegrationCounts& counts = step.update.counts;
  recorder.add("frame", item, "points", counts.points);
  recorder.add("frame", item, "inserted", counts.inserted);
  recorder.add("frame", item, "floor", counts.floor);
  recorder.add("frame", item, "self", counts.self);
  recorder.add("frame", item, "out_of_range", counts.out_of_range);
  recorder.add("frame", item, "outside_grid", counts.outside_grid);
  recorder.add("frame", item, "invalid", counts.invalid);
}

std::int64_t set_of(const VoxelBits& bits) {
  return std::transform_reduce(bits.words.begin(), bits.words.end(), std::int64_t{0}, std::plus{},
                               [](std::uint64_t word) { return std::popcount(word); });
}

}  // namespace

FrameTap::FrameTap(Source& source, std::optional<std::int64_t> count, std::int64_t limit,
                   int pictures)
    : source_(source), count_(count), limit_(limit), wanted_(pictures) {
  const auto total = frame_count();
  if (total && wanted_ > 0) stride_ = std::max<std::int64_t>(1, *total / wanted_);
}

std::optional<std::int64_t> FrameTap::frame_count() const {
  if (!count_) return limit_ > 0 ? std::optional(limit_) : std::nullopt;
  return limit_ > 0 ? std::min(limit_, *count_) : *count_;
}

Result<std::optional<Frame>> FrameTap::next(const Deadline& deadline) {
  if (limit_ > 0 && passed_ >= limit_) {
    is_cut_ = true;
    return std::nullopt;
  }
  auto frame = source_.next(deadline);
  if (frame ? frame->has_value() : frame.error().code == ErrorCode::kBadFrame) ++passed_;
  if (frame && *frame) {
    keep(**frame);
    if (mapper_ != nullptr) survey_.add(**frame, mapper_->grid());
    if (keeps_last_) last_ = std::make_shared<const Frame>(**frame);
  }
  return frame;
}

std::string FrameTap::left_out() const {
  if (!is_cut_ || (count_ && *count_ <= limit_)) return "";
  const std::string first = "mapped the first " + std::to_string(limit_);
  // A stream's end is not known before it is there.
  return count_ ? first + " of " + std::to_string(*count_) + " frames"
                : first + " frames, whether or not there are more";
}

void FrameTap::keep(const Frame& frame) {
  const auto* image = std::get_if<DepthImage>(&frame.measurement);
  if (image == nullptr || wanted_ <= 0 || (passed_ - 1) % stride_ != 0) return;
  const int width = image->camera.width_px;
  const int height = image->camera.height_px;
  // The mapper is the one to judge frames; a malformed one is merely not drawn.
  if (width <= 0 || height <= 0 ||
      image->depth_m.size() != static_cast<std::size_t>(width) * static_cast<std::size_t>(height)) {
    return;
  }
  if (static_cast<int>(pictures_.size()) == wanted_) {
    if (frame_count()) return;
    // A stream of unknown length: thin out what was kept, and go on at half the rate.
    std::size_t i = 0;
    std::erase_if(pictures_, [&](const DepthPicture&) { return i++ % 2 != 0; });
    stride_ *= 2;
    if ((passed_ - 1) % stride_ != 0) return;
  }
  const int step = (width + kMaxPictureWidth_px - 1) / kMaxPictureWidth_px;
  DepthPicture picture{frame.sequence, {(height + step - 1) / step, (width + step - 1) / step, {}}};
  for (int v = 0; v < height; v += step) {
    for (int u = 0; u < width; u += step) picture.depth_m.values.push_back(image->at(u, v));
  }
  pictures_.push_back(std::move(picture));
}

StoredRow<DepthPicture> stored_picture() {
  return StoredRow<DepthPicture>()
      .add("sequence", &DepthPicture::frame_sequence)
      .add("depth_m", &DepthPicture::depth_m);
}

Result<MapRecord> map_frames(MappingPipeline& pipeline, const FrameTap& source,
                             const OccupancyView& occupancy, SnapshotSlot& slot, Recorder& recorder,
                             ExperimentContext& context) {
  MapRecord map;
  SIDESTEP_TRY(pipeline.attach());
  const std::int64_t total = source.frame_count().value_or(0);
  while (!context.stop.stop_requested()) {
    auto step = pipeline.step(Deadline(context.stop));
    if (!step) {
      if (!context.stop.stop_requested()) map.fault = std::move(step.error());
      break;
    }
    if (!*step) break;
    const auto item = static_cast<std::int64_t>(map.steps.size());
    record_frame(**step, item, recorder);
    if (context.observer != nullptr) {
      const Stamp stamp = (*step)->stamp;
      context.observer->mapped({source.last(), **step, slot.snapshot(), stamp, stamp});
    }
    map.steps.push_back(std::move(**step));
    if (item % kCommitEvery == kCommitEvery - 1) SIDESTEP_TRY(recorder.commit());
    if (context.progress) {
      const auto bad = static_cast<std::int64_t>(pipeline.bad_frames().size());
      context.progress(item + 1 + bad, total, "mapping");
    }
  }
  map.bad_frames = pipeline.bad_frames();
  map.interrupted = context.stop.stop_requested();
  map.field = slot.pin();
  map.occupied_vox = set_of(occupancy.occupied());
  map.known_vox = set_of(occupancy.known());
  map.empty_reason = source.survey().emptiness(occupancy, PointSurvey::Keys::kMapper);
  map.left_out = source.left_out();
  if (!map.left_out.empty()) context.log.warn(map.left_out + " (experiment.max_frames)");
  record_bad_frames(map.bad_frames, recorder);
  stored_picture().record_all(source.pictures(), "depth", recorder);
  SIDESTEP_TRY(recorder.commit());
  return map;
}

}  // namespace sidestep
