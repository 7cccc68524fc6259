#include "rosbag_source.hpp"

#include <algorithm>
#include <array>
#include <chrono>
#include <cmath>
#include <optional>
#include <set>
#include <string>
#include <thread>
#include <utility>

#include <sidestep/core/error.hpp>
#include <sidestep/geometry/transform.hpp>
#include <sidestep/robot/robot_model.hpp>

#include "bag.hpp"
#include "conversions.hpp"
#include "recorded_frames.hpp"
#include "recording.hpp"

namespace sidestep::rosbag {
namespace {

/// Where the camera and the robot were, by what a bag tells. Immutable; [any] thread.
class Viewpoints {
 public:
  /// Borrows the recording. `robot` may be null where the options ask for no joints. Fails with
  /// kConfig where, of all the bag tells, no pose or joint position can come: frames that tf does
  /// not know or connect, with `measured_in` for the measurements' frame; joints that no message
  /// tells of.
  [[nodiscard]] static Result<Viewpoints> create(const Recording& recording, const Options& options,
                                                 std::shared_ptr<const RobotModel> robot,
                                                 const std::string& measured_in,
                                                 const std::string& file);

  /// Fails with kBadFrame where what is known around `stamp` is missing or too far apart.
  [[nodiscard]] Result<Transform> T_world_camera(const std::string& measured_in, Stamp stamp) const;

  /// In the order of the robot's joints; nothing where the options ask for none. Fails likewise.
  [[nodiscard]] Result<std::optional<Eigen::VectorXd>> joint_positions(Stamp stamp) const;

 private:
  struct BaseJoints {
    int x = 0;
    int y = 0;
    int yaw = 0;
  };
  Viewpoints(const Recording& recording, const Options& options,
             std::shared_ptr<const RobotModel> robot);
  Result<void> find_joints(const std::string& file);
  [[nodiscard]] Result<Transform> T_world_base(Stamp stamp) const;
  [[nodiscard]] Result<Transform> in_tf(const std::string& frame, Stamp stamp,
                                        double max_gap_s) const;

  const Recording* recording_;
  PoseOptions pose_;
  std::optional<JointOptions> joints_;
  std::shared_ptr<const RobotModel> robot_;
  Transform T_world_reference_;
  Transform T_body_camera_;
  std::vector<Joint> told_;      ///< Joints by messages.
  std::vector<int> told_index_;  ///< Their places in the robot's order.
  Eigen::VectorXd fixed_;        ///< All joints; those that are fixed are set.
  std::optional<BaseJoints> base_;
};

using ros_messages::LookupFailure;
using ros_messages::LookupFault;

std::string joined(const std::vector<std::string>& names) {
  std::string text;
  for (const std::string& name : names) text += (text.empty() ? "" : ", ") + name;
  return text.empty() ? "none" : text;
}

tl::unexpected<Error> dropped(const LookupFailure& failure) {
  return fail(ErrorCode::kBadFrame, failure.message);
}

Result<Transform> along(const PoseTrack& track, const std::string& topic, Stamp stamp,
                        double max_gap_s) {
  const auto bracket = track.poses.around(stamp, max_gap_s);
  if (bracket) {
    return interpolate(bracket->before->value, bracket->after->value, bracket->share).transform();
  }
  switch (bracket.error()) {
    case LookupFault::kTooEarly:
      return fail(ErrorCode::kBadFrame, "the poses on " + topic + " begin later");
    case LookupFault::kTooLate:
      return fail(ErrorCode::kBadFrame, "the poses on " + topic + " end earlier");
    default:
      return fail(ErrorCode::kBadFrame,
                  "the poses on " + topic + " have a gap longer than max_gap_s");
  }
}

Viewpoints::Viewpoints(const Recording& recording, const Options& options,
                       std::shared_ptr<const RobotModel> robot)
    : recording_(&recording),
      pose_(options.pose),
      joints_(options.joints),
      robot_(std::move(robot)),
      T_world_reference_(product(options.pose.T_world_reference)),
      T_body_camera_(product(options.pose.T_body_camera)) {}

Result<Viewpoints> Viewpoints::create(const Recording& recording, const Options& options,
                                      std::shared_ptr<const RobotModel> robot,
                                      const std::string& measured_in, const std::string& file) {
  Viewpoints viewpoints(recording, options, std::move(robot));
  const auto check_path = [&](const std::string& frame) -> Result<void> {
    const auto missing = recording.tf.missing_path(options.pose.world_frame, frame);
    if (!missing) return {};
    return fail(ErrorCode::kConfig, missing->message, file,
                "frames of the bag that have no parent: " + joined(recording.tf.roots()));
  };
  if (options.pose.from == "tf") {
    auto checked = check_path(options.pose.camera_frame.value_or(measured_in));
    if (checked && options.joints && options.joints->base) {
      const BaseOptions& base = *options.joints->base;
      checked = check_path(base.from == "tf" ? base.frame : recording.base_track.reference_frame);
    }
    if (!checked) return error_of(checked);
  }
  if (options.joints) {
    SIDESTEP_TRY(viewpoints.find_joints(file));
  }
  return viewpoints;
}

Result<void> Viewpoints::find_joints(const std::string& file) {
  if (robot_ == nullptr) {
    return fail(ErrorCode::kConfig, "source.joints is set, but the run has no robot");
  }
  const RobotDescription& robot = robot_->description();
  fixed_ = Eigen::VectorXd::Zero(robot.dof());
  std::set<int> elsewhere;  // Joints that messages need not tell of.
  std::vector<std::string> unknown;
  const auto index = [&](const std::string& name) {
    const auto found = robot.joint_index(name);
    if (!found) unknown.push_back(name);
    if (found) elsewhere.insert(*found);
    return found.value_or(0);
  };
  for (const FixedJoint& joint : joints_->fixed) fixed_[index(joint.joint)] = joint.position;
  if (joints_->base) {
    base_ = BaseJoints{index(joints_->base->x_joint), index(joints_->base->y_joint),
                       index(joints_->base->yaw_joint)};
  }
  if (!unknown.empty()) {
    return fail(ErrorCode::kConfig,
                "robot '" + robot.name + "' has no joint " + joined(unknown) +
                    ", which source.joints names",
                file);
  }
  for (int i = 0; i < robot.dof(); ++i) {
    if (elsewhere.contains(i)) continue;
    told_.push_back(robot.joints[static_cast<std::size_t>(i)]);
    told_index_.push_back(i);
  }
  const std::vector<std::string> missing = recording_->joints.missing(told_);
  if (missing.empty()) return {};
  return fail(ErrorCode::kConfig,
              "no message on " + joined(joints_->topics) + " tells of joint " + joined(missing) +
                  " of robot '" + robot.name + "'",
              file,
              "they tell of " + joined(recording_->joints.names()) +
                  "; joints.fixed and joints.base are for others");
}

Result<Transform> Viewpoints::in_tf(const std::string& frame, Stamp stamp, double max_gap_s) const {
  auto found = recording_->tf.lookup(pose_.world_frame, frame, stamp, max_gap_s);
  if (!found) return dropped(found.error());
  return *found;
}

Result<Transform> Viewpoints::T_world_camera(const std::string& measured_in, Stamp stamp) const {
  auto told = pose_.from == "tf"
                  ? in_tf(pose_.camera_frame.value_or(measured_in), stamp, pose_.max_gap_s)
                  : along(recording_->camera_track, *pose_.topic, stamp, pose_.max_gap_s);
  if (!told) return told;
  if (pose_.inverse) told = told->inverse();
  return T_world_reference_ * *told * T_body_camera_;
}

Result<Transform> Viewpoints::T_world_base(Stamp stamp) const {
  const BaseOptions& base = *joints_->base;
  const double max_gap_s = joints_->max_gap_s;
  if (base.from == "tf") return in_tf(base.frame, stamp, max_gap_s);
  auto told = along(recording_->base_track, *base.topic, stamp, max_gap_s);
  if (!told || pose_.from != "tf") return told;
  const auto placed = SIDESTEP_TRY(in_tf(recording_->base_track.reference_frame, stamp, max_gap_s));
  return placed * *told;
}

Result<std::optional<Eigen::VectorXd>> Viewpoints::joint_positions(Stamp stamp) const {
  if (!joints_) return std::optional<Eigen::VectorXd>();
  Eigen::VectorXd positions = fixed_;
  for (std::size_t i = 0; i < told_.size(); ++i) {
    const auto position = recording_->joints.position(told_[i], stamp, joints_->max_gap_s);
    if (!position) return dropped(position.error());
    positions[told_index_[i]] = *position;
  }
  if (base_) {
    const auto told = SIDESTEP_TRY(T_world_base(stamp));
    const Transform T_world_base = T_world_reference_ * told;
    positions[base_->x] = T_world_base.translation().x();
    positions[base_->y] = T_world_base.translation().y();
    positions[base_->yaw] = std::atan2(T_world_base.linear()(1, 0), T_world_base.linear()(0, 0));
  }
  return std::optional<Eigen::VectorXd>(std::move(positions));
}

/// How often a clock that is waited for is looked at.
constexpr auto kPoll = std::chrono::microseconds(200);

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
  RosbagSource(const Options& options, Parts parts, const HostContext& context)
      : options_(options),
        range_{options.depth_min_m, options.depth_max_m},
        offset_(Stamp::from_seconds(options.pose.offset_s)),
        bag_(std::move(parts.bag)),
        recording_(std::move(parts.recording)),
        viewpoints_(std::move(parts.viewpoints)),
        clock_(context.clock),
        playback_(stamps_of(*recording_), options.rate),
        tally_(context.log, options.path.string(), recording_->measurements.size()) {}

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
    tally_.count_frame(frame.has_value());
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
        tally_.count_left_out("overtaken by later ones", *newest - at_);
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
    if (told_damages_ >= bag_->damages().size()) {
      tally_.tell();
      return std::optional<Frame>();
    }
    const Damage& damage = bag_->damages()[told_damages_++];
    return fail(ErrorCode::kBadFrame, "the bag is damaged: " + damage.describe(),
                bag_->file().string(), "the frames that could be read came before this");
  }

  Result<Frame> read(const Measurement& measurement, std::size_t index) {
    const auto bytes = SIDESTEP_TRY(bag_->read(measurement.ref));
    Frame frame;
    frame.sequence = static_cast<std::int64_t>(index);
    frame.stamp = is_paced() ? playback_.due(index) : measurement.stamp;
    const auto taken_in = SIDESTEP_TRY(read(bytes, measurement.stamp, frame));
    const Stamp looked_up{measurement.stamp.ns + offset_.ns};
    auto pose = SIDESTEP_TRY(viewpoints_.T_world_camera(taken_in, looked_up));
    frame.T_world_camera = pose;
    if (recording_->type == "sensor_msgs/PointCloud2" && options_.points_in == "forward") {
      frame.T_world_camera = pose * T_forward_optical();
    }
    frame.joint_positions = SIDESTEP_TRY(viewpoints_.joint_positions(looked_up));
    return frame;
  }

  /// Puts the measurement into the frame; the name of the frame that it was measured in.
  Result<std::string> read(std::span<const std::uint8_t> bytes, Stamp stamp, Frame& frame) {
    if (recording_->type == "sensor_msgs/PointCloud2") return read_cloud(bytes, frame);
    if (recording_->type == "sensor_msgs/LaserScan") return read_scan(bytes, frame);
    return read_image(bytes, stamp, frame);
  }

  static Result<std::string> read_scan(std::span<const std::uint8_t> bytes, Frame& frame) {
    const auto message = SIDESTEP_TRY(deserialise<ros_messages::LaserScan>(bytes));
    frame.measurement = SIDESTEP_TRY(ros_messages::laser_scan(message));
    return message.header.frame_id;
  }

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
    tally_.count_left_out("points are not finite",
                          std::size_t{message.width} * message.height - cloud.points_m.size());
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
  recorded_frames::FrameTally tally_;
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
  const bool is_image = recording.type == "sensor_msgs/Image";
  if (!is_image || all_given || !recording.cameras.samples().empty()) return {};
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
      options, Parts{std::move(bag), std::move(kept), std::move(viewpoints)}, context));
}

}  // namespace sidestep::rosbag
