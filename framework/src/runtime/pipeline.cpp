#include <sidestep/runtime/pipeline.hpp>

#include <algorithm>
#include <cmath>

#include <sidestep/core/index.hpp>
#include <sidestep/core/plugin_calls.hpp>
#include <sidestep/core/time.hpp>
#include <sidestep/mapping/frame_check.hpp>
#include <sidestep/runtime/call_plugin.hpp>

namespace sidestep {
namespace {

Error out_of_time(const Deadline& deadline) {
  if (deadline.stop_requested())
    return {ErrorCode::kCancelled, "mapping was cancelled", {}, {}, {}};
  return {ErrorCode::kDeadlineExceeded, "no usable frame came in time", {}, {}, {}};
}

}  // namespace

void move_frame(Frame& frame, const Transform& T_new_old, const std::optional<BaseJoints>& base) {
  frame.T_world_camera = T_new_old * frame.T_world_camera;
  if (base && frame.joint_positions) base->move(T_new_old, as_span(*frame.joint_positions));
}

Result<void> MappingPipeline::attach() {
  if (parts_.masks_tracks && SIDESTEP_TRY(attach_masked())) return {};
  return call_stage(parts_.names.field, [&] { return parts_.field_builder.attach(parts_.mapper); });
}

Result<bool> MappingPipeline::attach_masked() {
  masked_.reset();
  if (occupancy_ != nullptr && parts_.tracker != nullptr && parts_.motion_detector != nullptr) {
    masked_.emplace(parts_.mapper, *occupancy_);
    const auto attached =
        call_stage(parts_.names.field, [&] { return parts_.field_builder.attach(*masked_); });
    if (attached) return true;
    masked_.reset();
    if (attached.error().code != ErrorCode::kUnsupported) return error_of(attached);
  }
  parts_.log.warn(parts_.names.field + " of " + parts_.names.mapper +
                  " is not built without what is tracked: that takes a tracker, and a mapper and a "
                  "field that share the view '" +
                  OccupancyView::kViewName + "'");
  parts_.masks_tracks = false;
  return false;
}

MapSnapshot MappingPipeline::follow_motion(const Frame& frame) {
  MapSnapshot snapshot;
  if (parts_.motion_detector == nullptr || occupancy_ == nullptr) return snapshot;
  auto moving =
      std::make_shared<MovingObstacles>(*parts_.motion_detector->look(*occupancy_, frame.stamp));
  if (parts_.tracker != nullptr) {
    snapshot.tracks = parts_.tracker->update(*occupancy_, *moving, frame);
  }
  memory_.add_unseen(frame, *moving);
  snapshot.moving = std::move(moving);
  return snapshot;
}

Result<void> MappingPipeline::localise(Frame& frame, MappingStep& step) {
  if (parts_.localiser == nullptr) return {};
  const Stopwatch watch;
  SIDESTEP_TRY(check_frame(frame));
  if (parts_.base && frame.joint_positions &&
      (frame.joint_positions->size() <=
           std::max({parts_.base->x(), parts_.base->y(), parts_.base->yaw()}) ||
       !frame.joint_positions->allFinite())) {
    return fail(ErrorCode::kBadFrame, "frame " + std::to_string(frame.sequence) +
                                          " has joint positions that are not the robot's");
  }
  step.localisation = SIDESTEP_TRY(call_stage(
      parts_.names.localiser, [&] { return parts_.localiser->localise(frame, newest_.get()); }));
  Localisation& found = *step.localisation;
  if (!found.T_map_odom.matrix().allFinite() || !std::isfinite(found.sigma_m + found.sigma_rad)) {
    return fail(ErrorCode::kPlugin, "says a pose that is not a number",
                "plugin " + parts_.names.localiser);
  }
  if (!found.lost.empty()) {
    found.lost = parts_.names.localiser + ": " + found.lost;
    if (!is_lost_) parts_.log.warn(found.lost);
  }
  is_lost_ = !found.lost.empty();
  move_frame(frame, found.T_map_odom, parts_.base);
  step.localise_ms = watch.elapsed_ms();
  return {};
}

Result<std::optional<MappingStep>> MappingPipeline::step(const Deadline& deadline) {
  for (bool has_skipped = false;; has_skipped = true) {
    // The source watches the deadline of a frame; a row of unusable ones must end at it, too.
    if (has_skipped && deadline.expired()) return tl::make_unexpected(out_of_time(deadline));
    MappingStep step;
    Stopwatch watch;
    auto frame = call_stage(parts_.names.source, [&] { return parts_.source.next(deadline); });
    step.read_ms = watch.elapsed_ms();
    if (!frame && frame.error().code == ErrorCode::kBadFrame) {
      skip(std::move(frame.error()));
      continue;
    }
    if (!frame) return error_of(frame);
    if (!*frame) return std::optional<MappingStep>{};
    step.frame_sequence = (*frame)->sequence;
    step.stamp = (*frame)->stamp;
    auto localised = localise(**frame, step);
    if (!localised && localised.error().code == ErrorCode::kBadFrame) {
      skip(std::move(localised.error()));
      continue;
    }
    if (!localised) return error_of(localised);

    watch.restart();
    plugin_board().frames = step.frame_sequence + 1;
    auto update = call_stage(parts_.names.mapper, [&] { return parts_.mapper.integrate(**frame); });
    step.integrate_ms = watch.elapsed_ms();
    if (!update && update.error().code == ErrorCode::kBadFrame) {
      skip(std::move(update.error()));
      continue;
    }
    if (!update) return error_of(update);
    if (auto kept = map_check_.check(**frame, *update); !kept) {
      kept.error().where =
          "plugin " + parts_.names.mapper + ", frame " + std::to_string(step.frame_sequence);
      return error_of(kept);
    }
    step.update = std::move(*update);
    if (parts_.waits_for_content && !has_content()) {
      skip({ErrorCode::kBadFrame,
            "the map is empty: nothing that frame " + std::to_string(step.frame_sequence) +
                " measured lies in it",
            parts_.names.mapper, "see mapper.origin_m, mapper.size_vox and mapper.max_range_m",
            nullptr});
      continue;
    }

    watch.restart();
    MapSnapshot snapshot = follow_motion(**frame);
    step.motion_ms = watch.elapsed_ms();

    watch.restart();
    if (step.update.grid_moved) {
      SIDESTEP_TRY(attach());
    }
    if (masked_) masked_->apply(parts_.tracker->mask(), step.update);
    snapshot.field = SIDESTEP_TRY(
        call_stage(parts_.names.field, [&] { return parts_.field_builder.update(step.update); }));
    if (snapshot.field == nullptr) {
      return fail(ErrorCode::kPlugin, "returned no field", "plugin " + parts_.names.field);
    }
    step.field_ms = watch.elapsed_ms();
    const auto* image = std::get_if<DepthImage>(&(*frame)->measurement);
    if ((*frame)->sensor == 0) camera_.reset();
    if ((*frame)->sensor == 0 && image != nullptr) {
      camera_ = {step.stamp.seconds(), (*frame)->T_world_camera, image->camera};
    }
    snapshot.camera = camera_;
    snapshot.localisation = step.localisation;
    if (parts_.localiser != nullptr) newest_ = snapshot.field;

    skipped_for_.clear();
    watch.restart();
    const bool finds_motion = snapshot.moving != nullptr;
    parts_.slot.publish(std::move(snapshot));
    step.publish_ms = watch.elapsed_ms();
    // From a laser's height only what lies in its plane could be seen.
    const auto* cloud = std::get_if<PointCloud>(&(*frame)->measurement);
    if (finds_motion && (cloud == nullptr || !is_planar_scan(*cloud))) {
      parts_.motion_detector->remember(*occupancy_, (*frame)->T_world_camera.translation(),
                                       step.stamp);
    }
    return step;
  }
}

bool MappingPipeline::has_content() {
  if (has_content_) return true;
  has_content_ =
      occupancy_ == nullptr ||
      std::ranges::any_of(occupancy_->known().words, [](std::uint64_t word) { return word != 0; });
  return has_content_;
}

void MappingPipeline::skip(Error error) {
  const std::string reason = error.describe();
  if (reason != skipped_for_) parts_.log.warn("skipped: " + reason);
  skipped_for_ = reason;
  bad_frames_.push_back(std::move(error));
}

}  // namespace sidestep
