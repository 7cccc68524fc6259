#pragma once

#include <filesystem>
#include <map>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include <sidestep/field/occupancy_bits.hpp>
#include <sidestep/runtime/run_observer.hpp>

#include "bag_writer.hpp"
#include "record_queue.hpp"
#include "run_messages.hpp"

namespace sidestep {

/// What a recording holds: topic by topic, docs/reference/recording.md.
namespace topics {
inline constexpr const char* kDepth = "/camera/depth/image_rect";
inline constexpr const char* kCameraInfo = "/camera/depth/camera_info";
inline constexpr const char* kPoints = "/camera/depth/points";
inline constexpr const char* kTransforms = "/tf";
inline constexpr const char* kJointStates = "/joint_states";
inline constexpr const char* kTrajectory = "/sidestep/trajectory";
inline constexpr const char* kRobot = "/sidestep/robot";
inline constexpr const char* kMap = "/sidestep/map";
inline constexpr const char* kScene = "/sidestep/scene";
inline constexpr const char* kMoving = "/sidestep/moving";
inline constexpr const char* kPaths = "/sidestep/paths";
inline constexpr const char* kEvents = "/sidestep/events";
inline constexpr const char* kView = "/sidestep/view";
}  // namespace topics

/// Lets through what comes a period or more after what it let through last.
class Throttle {
 public:
  explicit Throttle(double period_s) : period_ns_(Stamp::from_seconds(period_s).ns) {}

  [[nodiscard]] bool lets_through(Stamp stamp) noexcept {
    if (last_ && stamp.ns < last_->ns + period_ns_) return false;
    last_ = stamp;
    return true;
  }
  void restart() noexcept { last_.reset(); }

 private:
  std::int64_t period_ns_;
  std::optional<Stamp> last_;
};

/// Writes what a run tells, in the order in which it is told, into a bag. After the first failure
/// it writes nothing more. Throws what a robot throws. Not for several threads at once.
class RunBag {
 public:
  /// Fails as bag::Writer::create() does.
  [[nodiscard]] static Result<RunBag> create(const std::filesystem::path& file);

  void begin(const ObservedWorld& world);
  /// A frame, as it was received.
  void seen(const Frame& frame, Stamp received);
  /// A map, as it was published.
  void mapped(const MapSnapshot& map, Stamp published);
  void stepped(const ObservedStep& step);
  void happened(const ObservedEvent& event);
  void end(const ObservedEnd& end);
  /// A message to the viewer's page, of this episode.
  void viewed(Stamp stamp, std::string_view message);

  /// Hands over to the disk what is there.
  void flush();
  /// What was given up is the last event of all.
  void close(const Dropped& dropped);

  /// What went wrong, if anything.
  [[nodiscard]] const std::optional<Error>& fault() const noexcept { return fault_; }
  [[nodiscard]] std::int64_t message_count() const noexcept { return message_count_; }
  [[nodiscard]] std::uint64_t bytes() const noexcept { return writer_.bytes(); }

 private:
  explicit RunBag(bag::Writer writer) : writer_(std::move(writer)) {}

  template <class Message>
  void put(const char* topic, ros::Time time, const Message& message, bool latching = false);
  void put_event(ros::Time time, const std::string& json);
  /// Tells of the episode's world, once: its clock is not known before anything has a stamp.
  void show_world(Stamp first);
  void put_robot(std::span<const double> q, Stamp stamp);
  void put_map(Stamp stamp);
  void put_paths(ros::Time time, const Trajectory* refused);
  void note(const Result<void>& done);
  /// A stamp of the episode as ROS's time.
  [[nodiscard]] ros::Time time_of(Stamp stamp) const noexcept { return ros_time(stamp, epoch_); }
  /// The clock of the next episode begins after all that there is.
  void move_epoch() noexcept;

  bag::Writer writer_;
  std::map<std::string, std::uint32_t> connections_;  ///< By topic.
  std::vector<std::byte> bytes_;                      ///< Of the message that is written.
  std::optional<Error> fault_;
  std::int64_t message_count_ = 0;
  ros::Time last_time_;
  ros::Time last_event_, last_view_;

  Stamp epoch_ = kRosEpoch;
  bool has_begun_ = false;
  ObservedWorld world_;
  std::string camera_frame_;
  bool is_shown_ = false;
  bool has_stepped_ = false;
  OccupancyBits voxels_;
  std::shared_ptr<const DistanceField> waiting_map_;  ///< Has not been written yet.
  Stamp waiting_map_stamp_;
  std::shared_ptr<const Trajectory> followed_;
  Throttle transforms_{0.02}, maps_{0.5}, moving_{0.1};
  Scratch scratch_;
};

}  // namespace sidestep
