#include "view_messages.hpp"

#include <algorithm>
#include <cmath>
#include <utility>

#include "event_json.hpp"
#include "message_bytes.hpp"

namespace sidestep {
namespace {

using Json = nlohmann::ordered_json;

constexpr int kFrameColumns = 160;  ///< Most of a depth image that are sent.

std::string_view status_name(Replanner::Status status) noexcept {
  switch (status) {
    case Replanner::Status::kMoving: return "moving";
    case Replanner::Status::kWaiting: return "waiting";
    case Replanner::Status::kReached: return "reached";
  }
  return "";
}

Json values(const Eigen::VectorXd& q) {
  Json json = Json::array();
  for (const double value : q) json.push_back(value);
  return json;
}

Json camera_json(const CameraIntrinsics& camera) {
  return {{"width_px", camera.width_px}, {"height_px", camera.height_px}, {"fx_px", camera.fx_px},
          {"fy_px", camera.fy_px},       {"cx_px", camera.cx_px},         {"cy_px", camera.cy_px}};
}

std::uint16_t depth_mm(float depth_m) noexcept {
  if (!(depth_m > 0.0F)) return 0;
  return static_cast<std::uint16_t>(std::lround(std::min(1e3F * depth_m, 65535.0F)));
}

}  // namespace

ViewMessage map_message(Stamp time, Stamp stamp, const OccupancyBits& bits,
                        std::span<const std::int32_t> blocks, bool full) {
  const GridSpec& grid = bits.grid();
  Payload payload;
  payload.reserve(blocks.size() * sizeof(BlockBits));
  for (const std::int32_t block : blocks) {
    payload.add(std::span<const std::uint16_t>(bits.block(block).occupied));
    payload.add(std::span<const std::uint16_t>(bits.block(block).known));
  }
  return make_message(
      ViewKind::kMap, time,
      {{"stamp_s", stamp.seconds()},
       {"full", full},
       {"origin_m", point_json(grid.origin_m)},
       {"voxel_m", grid.resolution_m},
       {"size_vox", Json::array({grid.size_vox.x(), grid.size_vox.y(), grid.size_vox.z()})},
       {"blocks", std::vector<std::int32_t>(blocks.begin(), blocks.end())}},
      payload);
}

ViewMessage state_message(const ObservedStep& step, std::span<const Transform> T_world_link,
                          std::span<const Transform> T_world_object,
                          const std::optional<Clearance>& clearance) {
  Payload payload;
  for (const Transform& pose : T_world_link) payload.add(pose);
  for (const Transform& pose : T_world_object) payload.add(pose);
  Json nearest = nullptr;
  if (clearance) {
    nearest = {{"distance_m", clearance->distance_m},
               {"link", clearance->link},
               {"object", clearance->object},
               {"point_m", point_json(clearance->point_m)}};
  }
  return make_message(ViewKind::kState, step.stamp,
                      {{"status", status_name(step.status)},
                       {"q", values(step.q)},
                       {"true_q", step.q_true.size() == 0 ? Json(nullptr) : values(step.q_true)},
                       {"clearance", std::move(nearest)}},
                      payload);
}

std::optional<ViewMessage> frame_message(Stamp time, const Frame& frame) {
  const auto* const image = std::get_if<DepthImage>(&frame.measurement);
  if (image == nullptr || image->camera.width_px <= 0 || image->camera.height_px <= 0) {
    return std::nullopt;
  }
  const int width = image->camera.width_px;
  const int height = image->camera.height_px;
  const int stride = (width + kFrameColumns - 1) / kFrameColumns;
  std::vector<std::uint16_t> pixels;
  for (int v = 0; v < height; v += stride) {
    for (int u = 0; u < width; u += stride) pixels.push_back(depth_mm(image->at(u, v)));
  }
  Payload payload;
  payload.add(std::span<const std::uint16_t>(pixels));
  return make_message(ViewKind::kFrame, time,
                      {{"stamp_s", frame.stamp.seconds()},
                       {"pose", pose_json(frame.T_world_camera)},
                       {"camera", camera_json(image->camera)},
                       {"columns", (width + stride - 1) / stride},
                       {"rows", (height + stride - 1) / stride}},
                      payload);
}

ViewMessage event_message(const ObservedEvent& observed) {
  return make_message(ViewKind::kEvent, observed.event.stamp, event_json(observed));
}

ViewMessage timing_message(Stamp time, const ViewTiming& timing) {
  return make_message(ViewKind::kTiming, time,
                      {{"frames", timing.frames},
                       {"steps", timing.steps},
                       {"checks", timing.checks},
                       {"frames_dropped", timing.frames_dropped}});
}

ViewMessage slice_message(Stamp time, Stamp stamp, const FieldSlice& slice) {
  Payload payload;
  payload.add(std::span<const std::int16_t>(slice.distance_mm));
  return make_message(ViewKind::kSlice, time,
                      {{"stamp_s", stamp.seconds()},
                       {"axis", std::string(1, "xyz"[slice.request.axis])},
                       {"position_m", slice.request.position_m},
                       {"first_m", point_json(slice.first_m)},
                       {"step_m", slice.step_m},
                       {"columns", slice.columns},
                       {"rows", slice.rows},
                       {"max_m", slice.max_distance_m}},
                      payload);
}

ViewMessage end_message(const ObservedEnd& end) {
  return make_message(ViewKind::kEnd, end.stamp,
                      {{"success", end.success}, {"verdict", end.verdict}});
}

}  // namespace sidestep
