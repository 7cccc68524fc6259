#pragma once

#include <cstdint>
#include <cstring>
#include <span>
#include <string>
#include <vector>

#include <ros/message_traits.h>
#include <ros/serialization.h>

#include <sidestep/core/error.hpp>

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

}  // namespace sidestep::rosbag
