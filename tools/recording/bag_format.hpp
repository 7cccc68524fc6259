#pragma once

#include <cstddef>
#include <cstdint>
#include <string>

#include "bag_record.hpp"
#include "ros_messages.hpp"

/// What writer and reader of recordings share beyond the records of bags.
namespace sidestep::bag {

/// Header and data of the first record together, which is written twice.
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
