#include "chunk_data.hpp"

#include <bzlib.h>
#include <lz4frame.h>

#include <algorithm>
#include <memory>

namespace sidestep::rosbag {
namespace {

constexpr std::size_t kStep = std::size_t{1} << 18;

/// Room for more output behind what is there; none once there are `most` bytes.
std::span<std::uint8_t> more_room(std::vector<std::uint8_t>& bytes, std::size_t used,
                                  std::uint64_t most) {
  const auto room = static_cast<std::size_t>(
      std::min<std::uint64_t>(most - std::min<std::uint64_t>(most, used), kStep));
  bytes.resize(used + room);
  return {bytes.data() + used, room};
}

ChunkData decompress_bz2(std::span<const std::uint8_t> stored, std::uint64_t most) {
  ChunkData data;
  bz_stream stream{};
  if (BZ2_bzDecompressInit(&stream, 0, 0) != BZ_OK) return {{}, "bz2 has no memory"};
  const std::unique_ptr<bz_stream, int (*)(bz_stream*)> guard(&stream, &BZ2_bzDecompressEnd);
  // The library reads from what it takes as not const.
  stream.next_in = const_cast<char*>(reinterpret_cast<const char*>(stored.data()));
  stream.avail_in = static_cast<unsigned>(stored.size());
  std::size_t used = 0;
  while (data.damage.empty()) {
    const auto room = more_room(data.bytes, used, most);
    stream.next_out = reinterpret_cast<char*>(room.data());
    stream.avail_out = static_cast<unsigned>(room.size());
    const int code = BZ2_bzDecompress(&stream);
    used += room.size() - stream.avail_out;
    if (code == BZ_STREAM_END) break;
    if (code != BZ_OK) {
      data.damage = "its bz2 data are damaged";
    } else if (room.empty()) {
      data.damage = "its bz2 data are longer than it says";
    } else if (stream.avail_in == 0 && stream.avail_out > 0) {
      data.damage = "its bz2 data are cut off";
    }
  }
  data.bytes.resize(used);
  return data;
}

ChunkData decompress_lz4(std::span<const std::uint8_t> stored, std::uint64_t most) {
  ChunkData data;
  LZ4F_dctx* context = nullptr;
  if (LZ4F_isError(LZ4F_createDecompressionContext(&context, LZ4F_VERSION)) != 0U) {
    return {{}, "lz4 has no memory"};
  }
  const std::unique_ptr<LZ4F_dctx, decltype(&LZ4F_freeDecompressionContext)> guard(
      context, &LZ4F_freeDecompressionContext);
  std::size_t used = 0;
  while (data.damage.empty()) {
    const auto room = more_room(data.bytes, used, most);
    std::size_t written = room.size();
    std::size_t taken = stored.size();
    const std::size_t code =
        LZ4F_decompress(context, room.data(), &written, stored.data(), &taken, nullptr);
    stored = stored.subspan(std::min(taken, stored.size()));
    if (LZ4F_isError(code) != 0U) {
      data.damage = "its lz4 data are damaged";
      break;
    }
    used += written;
    if (code == 0) break;
    if (taken == 0 && written == 0) {
      data.damage =
          room.empty() ? "its lz4 data are longer than it says" : "its lz4 data are cut off";
    }
  }
  data.bytes.resize(used);
  return data;
}

}  // namespace

std::optional<Compression> compression_of(std::string_view name) {
  if (name == "none") return Compression::kNone;
  if (name == "bz2") return Compression::kBz2;
  if (name == "lz4") return Compression::kLz4;
  return std::nullopt;
}

ChunkData decompress(Compression compression, std::span<const std::uint8_t> stored,
                     std::uint64_t most) {
  switch (compression) {
    case Compression::kNone: return {{stored.begin(), stored.end()}, {}};
    case Compression::kBz2: return decompress_bz2(stored, most);
    case Compression::kLz4: return decompress_lz4(stored, most);
  }
  return {};
}

}  // namespace sidestep::rosbag
