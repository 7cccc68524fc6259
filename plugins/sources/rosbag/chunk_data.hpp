#pragma once

#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

namespace sidestep::rosbag {

enum class Compression : std::uint8_t { kNone, kBz2, kLz4 };

/// Nothing for a name that bags do not know.
[[nodiscard]] std::optional<Compression> compression_of(std::string_view name);

/// A chunk's data as they were before they were compressed, as far as they can be had.
struct ChunkData {
  std::vector<std::uint8_t> bytes;
  std::string damage;  ///< Why they end early; empty where they are all there.
};

/// Decompresses bz2 or lz4 to at most `most` bytes: memory grows with what comes out, not with what
/// a damaged header promises. [any]
[[nodiscard]] ChunkData decompress(Compression compression, std::span<const std::uint8_t> stored,
                                   std::uint64_t most);

}  // namespace sidestep::rosbag
