#pragma once

#include <cstddef>
#include <cstdint>
#include <string>
#include <string_view>

#include "ros_messages.hpp"

/// What writer and reader of bags share: format 2.0, http://wiki.ros.org/Bags/Format/2.0. A bag is
/// a line and then records; a record is a header, name=value fields, and data, each after its
/// length.
namespace sidestep::bag {

inline constexpr std::string_view kFirstLine = "#ROSBAG V2.0\n";

/// What a record is, its field `op`.
enum class Op : std::uint8_t {
  kMessage = 0x02,
  kFile = 0x03,  ///< The first one: where the index is. Of fixed size, since it is written twice.
  kIndex = 0x04,
  kChunk = 0x05,
  kChunkInfo = 0x06,
  kConnection = 0x07,
};

/// Header and data of the first record together.
inline constexpr std::size_t kFileRecord_bytes = 4096;
inline constexpr std::uint32_t kIndexVersion = 1;
/// Time and offset, in an index; connection and count, in what is said of a chunk.
inline constexpr std::size_t kIndexEntry_bytes = 12;
inline constexpr std::size_t kChunkCount_bytes = 8;

/// Where messages of one topic come from.
struct Connection {
  std::uint32_t id = 0;
  std::string topic;
  std::string type;
  std::string md5sum;
  std::string definition;
  bool latching = false;  ///< Whoever listens late is to be sent the last message.
};

}  // namespace sidestep::bag
