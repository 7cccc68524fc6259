#include "ros1_source.hpp"

#include <algorithm>
#include <cmath>
#include <numeric>
#include <utility>

#include <ros/callback_queue.h>
#include <ros/node_handle.h>
#include <boost/function.hpp>

#include <sidestep/core/format.hpp>

#include "conversions.hpp"
#include "node.hpp"
#include "viewpoint_feed.hpp"

namespace sidestep::ros1_source {
namespace {

using ros1_node::ros_now;
using ros_messages::LookupFault;

/// tf is many small messages; those of a second must not be lost while a frame is mapped.
constexpr std::uint32_t kTfQueue = 1000;
constexpr std::uint32_t kStateQueue = 200;
/// How long messages are waited for before the deadline is looked at again.
constexpr double kPoll_s = 0.002;
constexpr double kKept_s = 5.0;
constexpr double kMasterPeriod_s = 1.0;

double seconds_between(Stamp from, Stamp to) { return 1e-9 * static_cast<double>(to.ns - from.ns); }

std::string milliseconds(double value_s) { return format("%.1f ms", 1e3 * value_s); }

std::string spread_text(std::vector<double> values_s) {
  if (values_s.empty()) return "none";
  std::ranges::sort(values_s);
  const double mean_s =
      std::accumulate(values_s.begin(), values_s.end(), 0.0) / static_cast<double>(values_s.size());
  const auto at = static_cast<std::size_t>(0.95 * static_cast<double>(values_s.size() - 1));
  return "mean " + milliseconds(mean_s) + ", p95 " + milliseconds(values_s[at]);
}

/// A message with its measurement, in one of its forms.
struct Arrival {
  boost::shared_ptr<const ros_messages::Image> image;
  boost::shared_ptr<const ros_messages::PointCloud2> cloud;
  boost::shared_ptr<const ros_messages::LaserScan> scan;
  Stopwatch since;  ///< It was taken up.

  [[nodiscard]] const ros_messages::Header& header() const {
    if (scan) return scan->header;
    return image ? image->header : cloud->header;
  }
};

class Ros1Source final : public Source {
 public:
  Ros1Source(const Options& options, const HostContext& context, ViewpointFeed feed)
      : options_(options),
        clock_(context.clock),
        log_(context.log),
        time_(options.clock_tolerance_s),
        feed_(std::move(feed)),
        where_("source ros1 " + options.topic),
        drops_(context.log, where_, [] { return ros_now().seconds(); }) {
    node_.setCallbackQueue(&queue_);
    subscribe_all();
  }

  ~Ros1Source() override {
    log_.info(where_ + ": " + std::to_string(sync_s_.size()) + " frames; synchronisation with tf " +
              spread_text(sync_s_) + "; age when handed over " + spread_text(age_s_) + "; " +
              drops_.describe());
  }

  /// Waits for what a first frame needs.
  Result<void> connect();
  Result<std::optional<Frame>> next(const Deadline& deadline) override;
  std::optional<std::int64_t> frame_count() const override { return {}; }

 private:
  struct Seen {
    Stamp stamp;
    Transform T_world_camera;
  };
  template <class Message, class Callback>
  void subscribe(const std::string& topic, std::uint32_t queue, Callback callback);
  void subscribe_all();
  void serve(double wait_s);
  /// The frame, once all of it is there; nothing where it is waited for or was dropped.
  Result<std::optional<Frame>> synchronise();
  void drop(const std::string& kind, const std::string& reason);
  [[nodiscard]] std::optional<std::string> jump_to(const Transform& T_world_camera, Stamp stamp);
  Result<void> measure(const Arrival& arrival, Frame& frame);
  [[nodiscard]] std::string missing() const;

  Options options_;
  const Clock& clock_;
  Log& log_;
  ros1_node::RunTime time_;
  ViewpointFeed feed_;
  std::string where_;  ///< For messages: several sensors may be of this kind.
  FrameDrops drops_;
  std::optional<ros_messages::CameraInfo> info_;
  std::optional<Arrival> arrived_;  ///< The newest.
  std::optional<Arrival> pending_;  ///< Waits for its pose.
  std::string waits_for_;
  std::optional<Seen> last_seen_;
  Stamp forgotten_;
  bool told_distorted_ = false;
  std::int64_t number_ = 0;
  std::vector<double> sync_s_;
  std::vector<double> age_s_;
  ::ros::CallbackQueue queue_;
  ::ros::NodeHandle node_;
  std::vector<::ros::Subscriber> subscribers_;
};

template <class Message, class Callback>
void Ros1Source::subscribe(const std::string& topic, std::uint32_t queue, Callback callback) {
  using Pointer = boost::shared_ptr<const Message>;
  const boost::function<void(const Pointer&)> call(callback);
  subscribers_.push_back(node_.subscribe<Message>(topic, queue, call, ::ros::VoidConstPtr(),
                                                  ::ros::TransportHints().tcpNoDelay()));
}

void Ros1Source::subscribe_all() {
  for (const bool is_static : {false, true}) {
    for (const std::string& topic : is_static ? options_.tf_static_topics : options_.tf_topics) {
      subscribe<ros_messages::TfMessage>(topic, kTfQueue, [this, is_static](const auto& message) {
        feed_.add(*message, is_static);
      });
    }
  }
  if (options_.joints) {
    for (const std::string& topic : options_.joints->topics) {
      subscribe<ros_messages::JointState>(topic, kStateQueue,
                                          [this](const auto& message) { feed_.add(*message); });
    }
  }
  // Of measurements only the newest counts.
  if (options_.measures == "point_cloud") {
    subscribe<ros_messages::PointCloud2>(options_.topic, 1, [this](const auto& message) {
      arrived_ = Arrival{nullptr, message, nullptr, {}};
      ++number_;
    });
    return;
  }
  if (options_.measures == "laser_scan") {
    subscribe<ros_messages::LaserScan>(options_.topic, 1, [this](const auto& message) {
      arrived_ = Arrival{nullptr, nullptr, message, {}};
      ++number_;
    });
    return;
  }
  subscribe<ros_messages::CameraInfo>(options_.camera_info_topic, 1,
                                      [this](const auto& message) { info_ = *message; });
  subscribe<ros_messages::Image>(options_.topic, 1, [this](const auto& message) {
    arrived_ = Arrival{message, nullptr, nullptr, {}};
    ++number_;
  });
}

void Ros1Source::serve(double wait_s) {
  queue_.callAvailable(::ros::WallDuration(wait_s));
  const Stamp kept{ros_now().ns - Stamp::from_seconds(kKept_s).ns};
  if (seconds_between(forgotten_, kept) > 1.0) {
    feed_.forget_before(kept);
    forgotten_ = kept;
  }
}

std::string Ros1Source::missing() const {
  if (!waits_for_.empty()) return waits_for_;
  if (number_ == 0) return "nothing has come on " + options_.topic;
  if (options_.is_image() && !info_) {
    return "nothing has come on " + options_.camera_info_topic;
  }
  return "no frame has come on " + options_.topic + " since";
}

Result<void> Ros1Source::connect() {
  const Deadline deadline = Deadline::after_s(options_.connect_wait_s);
  const auto first = next(deadline);
  if (first) {
    last_seen_.reset();
    return {};
  }
  if (first.error().code != ErrorCode::kDeadlineExceeded &&
      first.error().code != ErrorCode::kBadFrame) {
    return error_of(first);
  }
  const bool is_bad = first.error().code == ErrorCode::kBadFrame;
  return fail(ErrorCode::kNotFound, is_bad ? first.error().message : missing(), where_,
              "is the camera up, and are topics and frames its own? (rostopic hz TOPIC, "
              "rosrun tf tf_echo WORLD CAMERA)");
}

Result<std::optional<Frame>> Ros1Source::next(const Deadline& deadline) {
  for (;;) {
    if (deadline.stop_requested()) return fail(ErrorCode::kCancelled, "waiting was cancelled");
    serve(kPoll_s);
    SIDESTEP_TRY(ros1_node::update(time_, clock_));
    if (!pending_ && arrived_) {
      pending_ = std::exchange(arrived_, std::nullopt);
      pending_->since.restart();
    }
    if (pending_) {
      auto frame = synchronise();
      if (!frame || *frame) return frame;
    }
    if (deadline.expired()) return fail(ErrorCode::kDeadlineExceeded, missing(), where_);
  }
}

void Ros1Source::drop(const std::string& kind, const std::string& reason) {
  drops_.add(kind, reason);
  pending_.reset();
}

Result<std::optional<Frame>> Ros1Source::synchronise() {
  const ros_messages::Header& header = pending_->header();
  const Stamp stamp = ros_messages::to_stamp(header.stamp);
  const double age_s = seconds_between(stamp, ros_now());
  if (age_s < -options_.clock_tolerance_s) {
    drop("ahead of the clock",
         "it is stamped " + milliseconds(-age_s) +
             " ahead of this machine's clock: the clocks are not synchronised");
    return std::optional<Frame>();
  }
  if (age_s > options_.max_frame_age_s) {
    drop("too old", "it is " + milliseconds(age_s) + " old");
    return std::optional<Frame>();
  }
  if (options_.is_image() && !info_) {
    pending_.reset();  // Before the first camera info, images mean nothing.
    return std::optional<Frame>();
  }
  const auto viewpoint = feed_.at(stamp, options_.camera_frame.value_or(header.frame_id));
  if (!viewpoint) {
    const auto fault = viewpoint.error().fault;
    const bool may_come = fault == LookupFault::kTooLate || fault == LookupFault::kUnknown ||
                          fault == LookupFault::kNotConnected;
    waits_for_ = viewpoint.error().message;
    if (may_come && 1e-3 * pending_->since.elapsed_ms() < options_.sync_wait_s) {
      return std::optional<Frame>();
    }
    drop(may_come ? "tf or joints late" : "tf or joints missing", viewpoint.error().message);
    return std::optional<Frame>();
  }
  waits_for_.clear();
  if (const auto jump = jump_to(viewpoint->T_world_camera, stamp)) {
    drop("tf jumped", *jump);
    return std::optional<Frame>();
  }
  const Arrival arrival = *std::exchange(pending_, std::nullopt);
  sync_s_.push_back(1e-3 * arrival.since.elapsed_ms());
  age_s_.push_back(age_s);
  std::optional<Frame> frame(std::in_place);
  frame->sequence = number_;
  frame->stamp = time_.to_run(stamp);
  frame->T_world_camera = viewpoint->T_world_camera;
  frame->joint_positions = viewpoint->joint_positions;
  SIDESTEP_TRY(measure(arrival, *frame));
  return frame;
}

/// How far the camera would have jumped since the last frame, if it did.
std::optional<std::string> Ros1Source::jump_to(const Transform& T_world_camera, Stamp stamp) {
  const auto before = std::exchange(last_seen_, Seen{stamp, T_world_camera});
  if (!before) return std::nullopt;
  constexpr double kLeast_s = 1e-3;
  const double dt_s = std::max(kLeast_s, std::abs(seconds_between(before->stamp, stamp)));
  const Transform T_before_now = before->T_world_camera.inverse() * T_world_camera;
  const double way_m = T_before_now.translation().norm();
  const double turn_rad = Eigen::AngleAxisd(T_before_now.linear()).angle();
  if (way_m <= options_.max_speed_mps * dt_s && turn_rad <= options_.max_turn_radps * dt_s) {
    return std::nullopt;
  }
  return format("tf jumped: the camera moved %.3f m and turned %.3f rad in %.3f s", way_m, turn_rad,
                dt_s);
}

Result<void> Ros1Source::measure(const Arrival& arrival, Frame& frame) {
  const auto named = [&](Error error) {
    error.where = options_.topic;
    return tl::make_unexpected(std::move(error));
  };
  if (arrival.scan) {
    auto scan = ros_messages::laser_scan(*arrival.scan);
    if (!scan) return named(std::move(scan.error()));
    frame.measurement = std::move(*scan);
    return {};
  }
  if (arrival.cloud) {
    auto cloud = ros_messages::point_cloud(*arrival.cloud);
    if (!cloud) return named(std::move(cloud.error()));
    if (options_.points_in == "forward") {
      const Eigen::Matrix3f R = T_forward_optical().linear().transpose().cast<float>();
      for (Eigen::Vector3f& p : cloud->points_m) p = R * p;
      frame.T_world_camera = frame.T_world_camera * T_forward_optical();
    }
    frame.measurement = std::move(*cloud);
    return {};
  }
  const auto camera = ros_messages::intrinsics(*info_);
  if (!camera) return named(camera.error());
  if (ros_messages::is_distorted(*info_) && !std::exchange(told_distorted_, true)) {
    log_.warn(where_ + ": " + options_.camera_info_topic +
              " tells of distortion and of no projection: is the depth image rectified?");
  }
  auto image = ros_messages::depth_image(*arrival.image, *camera,
                                         {options_.depth_min_m, options_.depth_max_m});
  if (!image) return named(std::move(image.error()));
  frame.measurement = std::move(*image);
  return {};
}

}  // namespace

Parameters<BaseOptions> BaseOptions::parameters() {
  using B = BaseOptions;
  return ros_messages::base_joint_parameters<B>().add("frame", &B::frame,
                                                      "The base's frame in tf.");
}

Parameters<JointOptions> JointOptions::parameters() {
  using J = JointOptions;
  return Parameters<J>()
      .add("topics", &J::topics, "Topics of sensor_msgs/JointState.")
      .add("max_gap_s", &J::max_gap_s,
           "Longest time between two positions of a joint that are interpolated.",
           {.unit = "s", .min = 0.0})
      .add("base", &J::base, "Joints that tf tells of; absent: joint states tell of all.");
}

Parameters<Options> Options::parameters() {
  using O = Options;
  return Parameters<O>()
      .add("topic", &O::topic,
           "sensor_msgs/Image, rectified, of 16UC1 (mm) or 32FC1 (m), sensor_msgs/PointCloud2, or "
           "sensor_msgs/LaserScan.")
      .add("measures", &O::measures, "What the topic's messages are.",
           {.choices = {"depth_image", "point_cloud", "laser_scan"}})
      .add("camera_info_topic", &O::camera_info_topic,
           "sensor_msgs/CameraInfo of the depth image; used with nothing else.")
      .add("points_in", &O::points_in,
           "Point clouds: whether z of their frame goes into the scene (optical), or x (forward).",
           {.choices = {"optical", "forward"}})
      .add("depth_min_m", &O::depth_min_m, "Depths below count as no return.",
           {.unit = "m", .min = 0.0})
      .add("depth_max_m", &O::depth_max_m, "Depths beyond count as no return.",
           {.unit = "m", .min = 0.0})
      .add("world_frame", &O::world_frame,
           "The frame of tf that is the map's world; with executor ros1, its world_frame.")
      .add("camera_frame", &O::camera_frame,
           "The camera's optical frame; null: what each message's header says.")
      .add("tf_topics", &O::tf_topics, "Topics of tf2_msgs/TFMessage.")
      .add("tf_static_topics", &O::tf_static_topics,
           "Topics of transforms that hold for all times.")
      .add("tf_max_gap_s", &O::tf_max_gap_s,
           "Longest time between two transforms that are interpolated.", {.unit = "s", .min = 0.0})
      .add("sync_wait_s", &O::sync_wait_s,
           "How long tf and joint states may come later than the frame that they are needed for.",
           {.unit = "s", .min = 0.0, .max = 10.0})
      .add("max_frame_age_s", &O::max_frame_age_s, "An older frame is dropped.",
           {.unit = "s", .min = 0.01})
      .add("max_speed_mps", &O::max_speed_mps,
           "A frame to which the camera would have moved faster is dropped: tf jumped.",
           {.unit = "m/s", .min = 0.0})
      .add("max_turn_radps", &O::max_turn_radps, "So is one to which it would have turned faster.",
           {.unit = "rad/s", .min = 0.0})
      .add("clock_tolerance_s", &O::clock_tolerance_s,
           "A change of the distance between ROS time and the run's clock beyond this is a jump; "
           "so is a frame that is farther ahead.",
           {.unit = "s", .min = 0.001})
      .add("connect_wait_s", &O::connect_wait_s,
           "How long the master and a first frame with its pose are waited for.",
           {.unit = "s", .min = 0.0, .max = 600.0})
      .add("joints", &O::joints,
           "Where the robot's joints are, for mappers that leave the robot itself out; absent: not "
           "told.");
}

std::vector<OptionMistake> Options::check() const {
  std::vector<OptionMistake> mistakes;
  if (depth_min_m >= depth_max_m) {
    mistakes.push_back({{"depth_min_m", "depth_max_m"}, "must be less than depth_max_m", {}});
  }
  if (tf_topics.empty() && tf_static_topics.empty()) {
    mistakes.push_back({{"tf_topics"}, "is empty, and tf_static_topics is, too", {}});
  }
  if (joints && joints->topics.empty()) {
    mistakes.push_back({{"joints"}, "has no topics", {}});
  }
  return mistakes;
}

void FrameDrops::add(const std::string& kind, const std::string& reason) {
  ++counts_[kind];
  ++total_;
  ++untold_;
  const double now_s = time_s_();
  if (told_s_ && now_s - *told_s_ < 1.0) return;
  log_.warn(where_ + ": dropped " + std::to_string(untold_) +
            (untold_ == 1 ? " frame: " : " frames, the last: ") + reason);
  untold_ = 0;
  told_s_ = now_s;
}

std::string FrameDrops::describe() const {
  std::string text = std::to_string(total_) + (total_ == 1 ? " frame" : " frames") + " dropped";
  const char* separator = ": ";
  for (const auto& [kind, count] : counts_) {
    text += separator + std::to_string(count) + " " + kind;
    separator = ", ";
  }
  return text;
}

Result<std::unique_ptr<Source>> create_source(const Options& options, const HostContext& context) {
  auto feed = SIDESTEP_TRY(ViewpointFeed::create(options, context.robot));
  SIDESTEP_TRY(ros1_node::join_ros(options.connect_wait_s, kMasterPeriod_s));
  auto source = std::make_unique<Ros1Source>(options, context, std::move(feed));
  SIDESTEP_TRY(source->connect());
  return std::unique_ptr<Source>(std::move(source));
}

}  // namespace sidestep::ros1_source
