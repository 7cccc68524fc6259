#include "rosbag_source.hpp"

#include <algorithm>
#include <chrono>
#include <string>
#include <thread>
#include <utility>

#include "bag.hpp"
#include "conversions.hpp"
#include "deserialise.hpp"
#include "playback.hpp"
#include "recording.hpp"
#include "viewpoints.hpp"

namespace sidestep::rosbag {
namespace {

/// How often a clock that is waited for is looked at.
constexpr auto kPoll = std::chrono::microseconds(200);

/// From a sensor's frame with x forward and z up to its optical one.
Transform T_forward_optical() {
  Transform transform = Transform::Identity();
  transform.linear() << 0, 0, 1, -1, 0, 0, 0, -1, 0;
  return transform;
}

/// The camera's frame, as the first message that can be read says; empty for none.
std::string first_frame_name(Bag& bag, const Recording& recording) {
  constexpr std::size_t kTried = 5;
  for (std::size_t i = 0; i < std::min(kTried, recording.measurements.size()); ++i) {
    const auto bytes = bag.read(recording.measurements[i].ref);
    if (!bytes) continue;
    const auto header = deserialise<ros_messages::Header>(*bytes);
    if (header) return header->frame_id;
  }
  return {};
}

/// What a source needs beside its options.
struct Parts {
  std::unique_ptr<Bag> bag;
  std::unique_ptr<Recording> recording;
  Viewpoints viewpoints;
};

class RosbagSource final : public Source {
 public:
  RosbagSource(const Options& options, Parts parts, const Clock& clock)
      : options_(options),
        range_{options.depth_min_m, options.depth_max_m},
        offset_(Stamp::from_seconds(options.pose.offset_s)),
        bag_(std::move(parts.bag)),
        recording_(std::move(parts.recording)),
        viewpoints_(std::move(parts.viewpoints)),
        clock_(clock),
        playback_(stamps_of(*recording_), options.rate) {}

  Result<std::optional<Frame>> next(const Deadline& deadline) override {
    if (deadline.stop_requested()) return fail(ErrorCode::kCancelled, "reading was cancelled");
    if (at_ >= recording_->measurements.size()) return next_damage();
    if (is_paced()) {
      SIDESTEP_TRY(wait(deadline));
    } else if (deadline.expired()) {
      return fail(ErrorCode::kDeadlineExceeded, "no time was left to read a frame");
    }
    const std::size_t index = at_++;
    auto frame = read(recording_->measurements[index], index);
    if (!frame) {
      Error error = std::move(frame.error());
      error.code = ErrorCode::kBadFrame;
      error.where = "frame " + std::to_string(index) + " (" + bag_->file().string() + ")";
      return tl::make_unexpected(std::move(error));
    }
    return std::optional<Frame>(std::move(*frame));
  }

  std::optional<std::int64_t> frame_count() const override {
    if (is_paced()) return {};
    return static_cast<std::int64_t>(recording_->measurements.size());
  }

 private:
  static std::vector<Stamp> stamps_of(const Recording& recording) {
    std::vector<Stamp> stamps;
    for (const Measurement& measurement : recording.measurements) {
      stamps.push_back(measurement.stamp);
    }
    return stamps;
  }

  [[nodiscard]] bool is_paced() const { return options_.pace == "clock"; }

  /// Until a frame is due, passing over those that a later one has overtaken.
  Result<void> wait(const Deadline& deadline) {
    playback_.start(clock_.now());
    for (;; std::this_thread::sleep_for(kPoll)) {
      if (deadline.stop_requested()) return fail(ErrorCode::kCancelled, "reading was cancelled");
      if (const auto newest = playback_.newest_due(clock_.now()); newest && *newest >= at_) {
        at_ = *newest;
        return {};
      }
      if (deadline.expired()) {
        return fail(ErrorCode::kDeadlineExceeded,
                    "frame " + std::to_string(at_) + " was not due in time");
      }
    }
  }

  Result<std::optional<Frame>> next_damage() {
    if (told_damages_ >= bag_->damages().size()) return std::optional<Frame>();
    const Damage& damage = bag_->damages()[told_damages_++];
    return fail(ErrorCode::kBadFrame, "the bag is damaged: " + damage.describe(),
                bag_->file().string(), "the frames that could be read came before this");
  }

  Result<Frame> read(const Measurement& measurement, std::size_t index) {
    const auto bytes = SIDESTEP_TRY(bag_->read(measurement.ref));
    Frame frame;
    frame.sequence = static_cast<std::int64_t>(index);
    frame.stamp = is_paced() ? playback_.due(index) : measurement.stamp;
    auto read = SIDESTEP_TRY(recording_->is_cloud ? read_cloud(bytes, frame)
                                                  : read_image(bytes, measurement.stamp, frame));
    const Stamp looked_up{measurement.stamp.ns + offset_.ns};
    auto pose = SIDESTEP_TRY(viewpoints_.T_world_camera(read, looked_up));
    frame.T_world_camera = pose;
    if (recording_->is_cloud && options_.points_in == "forward") {
      frame.T_world_camera = pose * T_forward_optical();
    }
    frame.joint_positions = SIDESTEP_TRY(viewpoints_.joint_positions(looked_up));
    return frame;
  }

  /// Puts the measurement into the frame; the name of the frame that it was measured in.
  Result<std::string> read_image(std::span<const std::uint8_t> bytes, Stamp stamp, Frame& frame) {
    const auto message = SIDESTEP_TRY(deserialise<ros_messages::Image>(bytes));
    const CameraIntrinsics camera =
        camera_at(stamp, static_cast<int>(message.width), static_cast<int>(message.height));
    frame.measurement = SIDESTEP_TRY(ros_messages::depth_image(message, camera, range_));
    return message.header.frame_id;
  }

  Result<std::string> read_cloud(std::span<const std::uint8_t> bytes, Frame& frame) {
    const auto message = SIDESTEP_TRY(deserialise<ros_messages::PointCloud2>(bytes));
    auto cloud = SIDESTEP_TRY(ros_messages::point_cloud(message));
    if (options_.points_in == "forward") {
      const Eigen::Matrix3f R_optical_forward =
          T_forward_optical().linear().transpose().cast<float>();
      for (Eigen::Vector3f& p : cloud.points_m) p = R_optical_forward * p;
    }
    frame.measurement = std::move(cloud);
    return message.header.frame_id;
  }

  /// What the camera info said last; before its first message, what that says. An image without
  /// any has the size that it has.
  [[nodiscard]] CameraIntrinsics camera_at(Stamp stamp, int width_px, int height_px) const {
    const auto& known = recording_->cameras.samples();
    using Sample = std::ranges::range_value_t<decltype(known)>;
    CameraIntrinsics camera{width_px, height_px};
    if (!known.empty()) {
      const auto later = std::ranges::upper_bound(known, stamp, {}, &Sample::stamp);
      camera = later == known.begin() ? later->value : std::prev(later)->value;
    }
    camera.fx_px = options_.camera.fx_px.value_or(camera.fx_px);
    camera.fy_px = options_.camera.fy_px.value_or(camera.fy_px);
    camera.cx_px = options_.camera.cx_px.value_or(camera.cx_px);
    camera.cy_px = options_.camera.cy_px.value_or(camera.cy_px);
    return camera;
  }

  Options options_;
  ros_messages::DepthRange range_;
  Stamp offset_;
  std::unique_ptr<Bag> bag_;
  std::unique_ptr<Recording> recording_;  ///< Borrowed by the viewpoints.
  Viewpoints viewpoints_;
  const Clock& clock_;
  Playback playback_;
  std::size_t at_ = 0;
  std::size_t told_damages_ = 0;
};

Result<void> select(const Options& options, const std::string& file, Recording& recording,
                    Log& log) {
  std::vector<Measurement> selected;
  const auto& all = recording.measurements;
  const auto stride = static_cast<std::size_t>(options.stride);
  const auto limit =
      options.max_frames > 0 ? static_cast<std::size_t>(options.max_frames) : all.size();
  for (auto i = static_cast<std::size_t>(options.first_frame);
       i < all.size() && selected.size() < limit; i += stride) {
    selected.push_back(all[i]);
  }
  if (selected.empty()) {
    return fail(ErrorCode::kConfig,
                "first_frame is " + std::to_string(options.first_frame) +
                    ", but the bag has only " + std::to_string(all.size()) + " frames",
                file);
  }
  if (selected.size() < all.size()) {
    log.warn("hands out " + std::to_string(selected.size()) + " of " + std::to_string(all.size()) +
             " frames, as first_frame, stride and max_frames say");
  }
  recording.measurements = std::move(selected);
  return {};
}

Result<void> check_intrinsics(const Options& options, const std::string& file,
                              const Recording& recording) {
  const CameraOptions& camera = options.camera;
  const bool all_given = camera.fx_px && camera.fy_px && camera.cx_px && camera.cy_px;
  if (recording.is_cloud || all_given || !recording.cameras.samples().empty()) return {};
  return fail(ErrorCode::kConfig, "no camera info tells the intrinsics of the images", file,
              "set source.camera_info_topic, or all of source.camera");
}

}  // namespace

Result<std::unique_ptr<Source>> create_source(const Options& options, const HostContext& context) {
  auto bag = SIDESTEP_TRY(Bag::open(options.path));
  auto recording = SIDESTEP_TRY(read_recording(*bag, options, context.log));
  const std::string file = options.path.string();
  for (const auto& checked : {select(options, file, recording, context.log),
                              check_intrinsics(options, file, recording)}) {
    if (!checked) return error_of(checked);
  }
  const std::string measured_in = first_frame_name(*bag, recording);
  auto kept = std::make_unique<Recording>(std::move(recording));
  auto viewpoints =
      SIDESTEP_TRY(Viewpoints::create(*kept, options, context.robot, measured_in, file));
  return std::unique_ptr<Source>(std::make_unique<RosbagSource>(
      options, Parts{std::move(bag), std::move(kept), std::move(viewpoints)}, context.clock));
}

}  // namespace sidestep::rosbag
