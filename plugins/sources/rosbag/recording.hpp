#pragma once

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <cstring>
#include <map>
#include <optional>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include <ros/message_traits.h>
#include <ros/serialization.h>

#include <sidestep/core/error.hpp>
#include <sidestep/core/log.hpp>
#include <sidestep/core/time.hpp>
#include <sidestep/sensing/frame.hpp>

#include "bag.hpp"
#include "histories.hpp"
#include "rosbag_source.hpp"

namespace sidestep::rosbag {

/// What ROS reads messages from, but for lists that say to be longer than the rest of the message:
/// ROS would make room for them first, be it gigabytes, and fail afterwards.
class MessageStream : public ::ros::serialization::Stream {
 public:
  explicit MessageStream(std::span<const std::uint8_t> bytes)
      // Reads only; the class is that of writing streams, too.
      : Stream(const_cast<std::uint8_t*>(bytes.data()), static_cast<std::uint32_t>(bytes.size())) {}

  template <class T>
  void next(T& value) {
    ::ros::serialization::deserialize(*this, value);
  }
  template <class T, class Allocator>
  void next(std::vector<T, Allocator>& list) {
    std::uint32_t count = 0;
    if (getLength() >= sizeof count) std::memcpy(&count, getData(), sizeof count);
    const std::uint64_t least_bytes =
        ::ros::message_traits::IsSimple<T>::value ? count * std::uint64_t{sizeof(T)} : count;
    if (least_bytes > getLength()) ::ros::serialization::throwStreamOverrun();
    ::ros::serialization::deserialize(*this, list);
  }
};

/// A message of type M. Fails with kBadFrame where the bytes are none. [any]
template <class M>
[[nodiscard]] Result<M> deserialise(std::span<const std::uint8_t> bytes) {
  M message;
  try {
    MessageStream stream(bytes);
    stream.next(message);
  } catch (const std::exception&) {
    return fail(ErrorCode::kBadFrame, "the message is damaged: it ends before its contents do");
  }
  return message;
}

/// Whether a connection's definition is that of M.
template <class M>
[[nodiscard]] bool has_definition_of(const std::string& md5sum) {
  return md5sum == "*" || md5sum == ::ros::message_traits::MD5Sum<M>::value();
}

/// When recorded frames are due on the clock of a run that plays them: the first one when it
/// begins, the others as long after that as they were recorded, divided by `rate`.
class Playback {
 public:
  /// Stamps do not decrease.
  Playback(std::vector<Stamp> recorded, double rate)
      : recorded_(std::move(recorded)), rate_(rate) {}

  /// Counts the first time only.
  void start(Stamp now) noexcept {
    if (!begin_) begin_ = now;
  }

  [[nodiscard]] Stamp due(std::size_t frame) const noexcept {
    const auto since_first_ns = static_cast<double>(recorded_[frame].ns - recorded_.front().ns);
    return Stamp{begin_->ns + static_cast<std::int64_t>(since_first_ns / rate_)};
  }

  /// The last frame that is due; nothing where none is.
  [[nodiscard]] std::optional<std::size_t> newest_due(Stamp now) const noexcept {
    std::size_t due_count = 0;
    for (std::size_t left = recorded_.size(); left > 0;) {  // a binary search
      const std::size_t half = left / 2;
      if (due(due_count + half) <= now) {
        due_count += half + 1;
        left -= half + 1;
      } else {
        left = half;
      }
    }
    if (due_count == 0) return std::nullopt;
    return due_count - 1;
  }

 private:
  std::vector<Stamp> recorded_;
  double rate_;
  std::optional<Stamp> begin_;
};

/// An image or a cloud that is to become a frame.
struct Measurement {
  Stamp stamp;
  MessageRef ref;
};

/// Poses that the messages of a topic tell.
struct PoseTrack {
  std::string reference_frame;  ///< Of the first message.
  ros_messages::TimeSeries<ros_messages::RigidPose> poses;
};

/// What a pass over a bag leaves in memory: everything that is named in the options but images and
/// clouds, of which it has the places.
struct Recording {
  std::string type;                       ///< Of their messages.
  std::vector<Measurement> measurements;  ///< By stamp.
  /// What the camera info says, where it changes.
  ros_messages::TimeSeries<CameraIntrinsics> cameras;
  bool is_distorted = false;
  ros_messages::TfTree tf;
  PoseTrack camera_track;  ///< Of pose.topic.
  PoseTrack base_track;    ///< Of joints.base.topic.
  ros_messages::JointHistory joints;
};

/// Reads all of a bag but its images and clouds. Logs what of it is unusable, by topic. Fails with
/// kConfig where a topic that is named is not in the bag, or has messages of another type, with
/// kIo where the bag is damaged and nothing can be read of the measurements.
[[nodiscard]] Result<Recording> read_recording(Bag& bag, const Options& options, Log& log);

}  // namespace sidestep::rosbag
