#include "recording.hpp"

#include <functional>
#include <map>
#include <string>
#include <vector>

#include <sidestep/core/node.hpp>

#include "conversions.hpp"

namespace sidestep::rosbag {
namespace {

using ros_messages::CameraInfo;
using ros_messages::Image;
using ros_messages::JointState;
using ros_messages::LaserScan;
using ros_messages::Odometry;
using ros_messages::PointCloud2;
using ros_messages::PoseStamped;
using ros_messages::TfMessage;
using ros_messages::TransformStamped;

/// Every message with a header begins with its number, seconds and nanoseconds.
constexpr std::size_t kStampBytes = 12;

std::optional<Stamp> header_stamp(std::span<const std::uint8_t> bytes) {
  if (bytes.size() < kStampBytes) return std::nullopt;
  ::ros::Time time;
  std::memcpy(&time.sec, bytes.data() + 4, sizeof time.sec);
  std::memcpy(&time.nsec, bytes.data() + 8, sizeof time.nsec);
  return ros_messages::to_stamp(time);
}

std::string parent_topic(const std::string& topic) {
  const std::size_t slash = topic.rfind('/');
  return slash == std::string::npos ? "" : topic.substr(0, slash + 1);
}

/// What is done with the messages of a topic.
struct Reader {
  std::vector<std::string> types;  ///< Those that it reads.
  std::size_t wants = BagVisitor::kWhole;
  /// False where the message is of no use.
  std::function<bool(const Connection&, const MessageRef&, std::span<const std::uint8_t>)> take;
  std::int64_t messages = 0;
  std::int64_t unusable = 0;
  std::string wrong_type;  ///< What the topic has instead.
};

/// Whether a type that readers know is defined in the bag as it is here.
bool has_known_definition(const Connection& connection) {
  const auto is = [&]<class M>(const char* type, const M*) {
    return connection.type == type && has_definition_of<M>(connection.md5sum);
  };
  return is("tf2_msgs/TFMessage", static_cast<TfMessage*>(nullptr)) ||
         is("tf/tfMessage", static_cast<TfMessage*>(nullptr)) ||
         is("sensor_msgs/JointState", static_cast<JointState*>(nullptr)) ||
         is("sensor_msgs/Image", static_cast<Image*>(nullptr)) ||
         is("sensor_msgs/PointCloud2", static_cast<PointCloud2*>(nullptr)) ||
         is("sensor_msgs/LaserScan", static_cast<LaserScan*>(nullptr)) ||
         is("sensor_msgs/CameraInfo", static_cast<CameraInfo*>(nullptr)) ||
         is("geometry_msgs/TransformStamped", static_cast<TransformStamped*>(nullptr)) ||
         is("geometry_msgs/PoseStamped", static_cast<PoseStamped*>(nullptr)) ||
         is("nav_msgs/Odometry", static_cast<Odometry*>(nullptr));
}

class Collector final : public BagVisitor {
 public:
  Collector(const Options& options, Recording& recording)
      : options_(options), recording_(recording) {
    add_measurements();
    add_poses();
    if (options.joints) add_joints(*options.joints);
  }

  std::size_t wants(const Connection& connection) override {
    std::size_t most = 0;
    for_each_reader(connection.topic, [&](Reader& reader) {
      if (has_right_type(connection, reader)) {
        most = std::max(most, reader.wants);
      } else {
        reader.wrong_type = connection.type;
      }
    });
    return most;
  }

  void message(const Connection& connection, const MessageRef& ref,
               std::span<const std::uint8_t> bytes) override {
    for_each_reader(connection.topic, [&](Reader& reader) {
      if (!has_right_type(connection, reader)) return;
      ++reader.messages;
      if (!reader.take(connection, ref, bytes)) ++reader.unusable;
    });
  }

  [[nodiscard]] bool reads(const Connection& connection) const {
    const auto [from, to] = readers_.equal_range(connection.topic);
    return std::any_of(from, to,
                       [&](const auto& entry) { return has_right_type(connection, entry.second); });
  }

  /// By topic; one may serve several purposes.
  [[nodiscard]] const std::multimap<std::string, Reader>& readers() const noexcept {
    return readers_;
  }

 private:
  template <class Visit>
  void for_each_reader(const std::string& topic, Visit&& visit) {
    const auto [from, to] = readers_.equal_range(topic);
    for (auto reader = from; reader != to; ++reader) visit(reader->second);
  }

  static bool has_right_type(const Connection& connection, const Reader& reader) {
    return std::ranges::find(reader.types, connection.type) != reader.types.end() &&
           has_known_definition(connection);
  }

  void add_reader(const std::string& topic, Reader reader) {
    readers_.emplace(topic, std::move(reader));
  }

  void add_measurements() {
    const bool by_header = options_.stamps == "header";
    add_reader(options_.topic,
               {{"sensor_msgs/Image", "sensor_msgs/PointCloud2", "sensor_msgs/LaserScan"},
                kStampBytes,
                [this, by_header](const Connection& connection, const MessageRef& ref,
                                  std::span<const std::uint8_t> bytes) {
                  recording_.type = connection.type;
                  const auto stamp = by_header ? header_stamp(bytes) : ref.received;
                  if (stamp) recording_.measurements.push_back({*stamp, ref});
                  return stamp.has_value();
                }});
    const std::string cameras =
        options_.camera_info_topic.value_or(parent_topic(options_.topic) + "camera_info");
    add_reader(cameras,
               {{"sensor_msgs/CameraInfo"},
                kWhole,
                [this](const Connection&, const MessageRef& ref,
                       std::span<const std::uint8_t> bytes) { return take_camera(ref, bytes); }});
  }

  void add_poses() {
    const PoseOptions& pose = options_.pose;
    if (pose.from == "topic") {
      return add_track(
          *pose.topic,
          {"geometry_msgs/TransformStamped", "geometry_msgs/PoseStamped", "nav_msgs/Odometry"},
          recording_.camera_track);
    }
    for (const std::string& topic : pose.tf_topics) add_tf(topic, false);
    for (const std::string& topic : pose.tf_static_topics) add_tf(topic, true);
  }

  void add_tf(const std::string& topic, bool is_static) {
    add_reader(topic, {{"tf/tfMessage", "tf2_msgs/TFMessage"},
                       kWhole,
                       [this, is_static](const Connection&, const MessageRef&,
                                         std::span<const std::uint8_t> bytes) {
                         const auto message = deserialise<TfMessage>(bytes);
                         return message && ros_messages::add_transforms(*message, is_static,
                                                                        recording_.tf) == 0;
                       }});
  }

  void add_track(const std::string& topic, std::vector<std::string> types, PoseTrack& track) {
    add_reader(topic, {std::move(types), kWhole,
                       [&track](const Connection& connection, const MessageRef&,
                                std::span<const std::uint8_t> bytes) {
                         if (connection.type == "nav_msgs/Odometry")
                           return take_pose<Odometry>(bytes, track);
                         if (connection.type == "geometry_msgs/PoseStamped") {
                           return take_pose<PoseStamped>(bytes, track);
                         }
                         return take_pose<TransformStamped>(bytes, track);
                       }});
  }

  void add_joints(const JointOptions& joints) {
    for (const std::string& topic : joints.topics) {
      add_reader(
          topic,
          {{"sensor_msgs/JointState"},
           kWhole,
           [this](const Connection&, const MessageRef&, std::span<const std::uint8_t> bytes) {
             const auto message = deserialise<JointState>(bytes);
             return message && ros_messages::add_joint_states(*message, recording_.joints) == 0;
           }});
    }
    if (joints.base && joints.base->from == "odometry") {
      add_track(*joints.base->topic, {"nav_msgs/Odometry"}, recording_.base_track);
    }
  }

  bool take_camera(const MessageRef& ref, std::span<const std::uint8_t> bytes) {
    const auto info = deserialise<CameraInfo>(bytes);
    const auto camera =
        info ? ros_messages::intrinsics(*info) : Result<CameraIntrinsics>(error_of(info));
    if (!camera) return false;
    recording_.is_distorted = recording_.is_distorted || ros_messages::is_distorted(*info);
    const auto& known = recording_.cameras.samples();
    const bool is_news = known.empty() || !same(known.back().value, *camera);
    const Stamp stamp =
        options_.stamps == "header" ? ros_messages::to_stamp(info->header.stamp) : ref.received;
    if (is_news) recording_.cameras.add(stamp, *camera);
    return true;
  }

  static bool same(const CameraIntrinsics& a, const CameraIntrinsics& b) {
    return a.width_px == b.width_px && a.height_px == b.height_px && a.fx_px == b.fx_px &&
           a.fy_px == b.fy_px && a.cx_px == b.cx_px && a.cy_px == b.cy_px;
  }

  template <class M>
  static bool take_pose(std::span<const std::uint8_t> bytes, PoseTrack& track) {
    const auto message = deserialise<M>(bytes);
    const auto pose = message ? ros_messages::pose_of(*message) : std::nullopt;
    if (!pose) return false;
    if (track.poses.samples().empty()) {
      track.reference_frame = ros_messages::frame_name(message->header.frame_id);
    }
    return track.poses.add(ros_messages::to_stamp(message->header.stamp), *pose);
  }

  const Options& options_;
  Recording& recording_;
  std::multimap<std::string, Reader> readers_;
};

std::string inventory(const Bag& bag) {
  std::map<std::string, std::string> types;
  for (const auto& [number, connection] : bag.connections()) {
    types.emplace(connection.topic, connection.type);
  }
  std::string text;
  for (const auto& [topic, type] : types) {
    text += (text.empty() ? "" : ", ") + topic + " (" + type + ")";
  }
  return text.empty() ? "the bag has no topics" : "the bag has " + text;
}

/// A topic without which there are no frames must have messages for each of its purposes.
Result<void> check_topic(const std::string& topic, const Collector& collector, const Bag& bag) {
  const auto [from, to] = collector.readers().equal_range(topic);
  const auto idle =
      std::find_if(from, to, [](const auto& entry) { return entry.second.messages == 0; });
  if (idle == to) return {};
  const Reader& reader = idle->second;
  const std::string where = bag.file().string();
  std::string expected;
  for (const std::string& type : reader.types) expected += (expected.empty() ? "" : " or ") + type;
  if (!reader.wrong_type.empty()) {
    const bool is_compressed = reader.wrong_type == "sensor_msgs/CompressedImage";
    return fail(ErrorCode::kConfig,
                "topic '" + topic + "' has messages of " + reader.wrong_type + ", expected " +
                    expected + " as ROS 1 defines it",
                where,
                is_compressed ? "record the raw topic, or republish it with image_transport"
                              : inventory(bag));
  }
  if (!bag.damages().empty()) {
    return fail(ErrorCode::kIo,
                "nothing of topic '" + topic +
                    "' can be read: the bag is damaged: " + bag.damages().front().describe(),
                where, inventory(bag));
  }
  return fail(ErrorCode::kConfig, "the bag has no messages on topic '" + topic + "'", where,
              inventory(bag));
}

Result<void> check_topics(const Options& options, const Collector& collector, const Bag& bag) {
  std::vector<std::string> needed{options.topic};
  if (options.pose.from == "topic") needed.push_back(*options.pose.topic);
  if (options.joints && options.joints->base && options.joints->base->from == "odometry") {
    needed.push_back(*options.joints->base->topic);
  }
  for (const std::string& topic : needed) {
    SIDESTEP_TRY(check_topic(topic, collector, bag));
  }
  return {};
}

void tell_unusable(const Collector& collector, const Recording& recording, const Bag& bag,
                   Log& log) {
  for (const auto& [topic, reader] : collector.readers()) {
    if (!reader.wrong_type.empty()) {
      log.warn(bag.file().string() + ": messages on " + topic + " of " + reader.wrong_type +
               " are not read: not of " + joined(reader.types) + " as ROS 1 defines it");
    }
    if (reader.unusable > 0) {
      log.warn(bag.file().string() + ": of " + std::to_string(reader.messages) + " messages on " +
               topic + ", " + std::to_string(reader.unusable) +
               " are damaged, repeat a stamp, or hold figures that are none");
    }
  }
  if (recording.is_distorted) {
    log.warn(bag.file().string() +
             ": the camera's images are distorted, and are read as if they were not");
  }
  for (const Damage& damage : bag.damages()) {
    log.warn(bag.file().string() + " is damaged: " + damage.describe());
  }
}

/// What was read of a bag and what was passed over, by topic.
void tell_counts(const Collector& collector, const Bag& bag, Log& log) {
  std::map<std::string, std::uint64_t> read, passed_over;
  for (const auto& [number, connection] : bag.connections()) {
    (collector.reads(connection) ? read : passed_over)[connection.topic] +=
        bag.message_count(number);
  }
  const auto listed = [](const std::map<std::string, std::uint64_t>& counts) {
    std::vector<std::string> texts;
    for (const auto& [topic, count] : counts)
      texts.push_back(std::to_string(count) + " on " + topic);
    return texts.empty() ? "none" : joined(texts);
  };
  log.debug("read " + bag.file().string() + ": messages " + listed(read) +
            "; passed over: " + listed(passed_over));
}

}  // namespace

Result<Recording> read_recording(Bag& bag, const Options& options, Log& log) {
  Recording recording;
  Collector collector(options, recording);
  bag.scan(collector);
  tell_unusable(collector, recording, bag, log);
  tell_counts(collector, bag, log);
  SIDESTEP_TRY(check_topics(options, collector, bag));
  std::ranges::stable_sort(recording.measurements, {}, &Measurement::stamp);
  return recording;
}

}  // namespace sidestep::rosbag
