#pragma once

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <limits>
#include <map>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include <sidestep/core/error.hpp>
#include <sidestep/core/time.hpp>

#include "bag_record.hpp"

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

using bag::FileBytes;

/// Who sent messages of which type on which topic.
struct Connection {
  std::string topic;
  std::string type;    ///< E.g. "sensor_msgs/Image".
  std::string md5sum;  ///< Of the type's definition.
  friend bool operator==(const Connection&, const Connection&) = default;
};

/// Where a message lies.
struct MessageRef {
  Stamp received;            ///< When it was recorded.
  std::uint64_t offset = 0;  ///< Of its data, in the file or in its chunk.
  std::uint32_t size_bytes = 0;
  std::int32_t chunk = -1;  ///< Among the compressed ones; -1: in the file itself.
};

/// A place where a bag is cut off or damaged.
struct Damage {
  std::uint64_t offset = 0;    ///< In the file: of the record, or of the chunk, that is damaged.
  std::string what;            ///< "it is cut off in a record's header".
  std::optional<Stamp> after;  ///< When the last message before it was recorded.
  /// What, the byte, and the time.
  [[nodiscard]] std::string describe() const;
};

/// Is told of every message of a bag in the order of the file.
class BagVisitor {
 public:
  static constexpr std::size_t kWhole = std::numeric_limits<std::size_t>::max();

  virtual ~BagVisitor() = default;
  /// How many bytes of the messages of a connection are wanted, from the first: 0 for none of such
  /// messages at all, kWhole for all.
  virtual std::size_t wants(const Connection& connection) = 0;
  /// A message of a connection that is wanted, with its first bytes as far as they are wanted.
  virtual void message(const Connection& connection, const MessageRef& ref,
                       std::span<const std::uint8_t> bytes) = 0;
};

/// A bag of format 2.0, whole or not: read from its beginning, record by record, not by the index
/// at its end, which a recorder that was killed never wrote. One thread at a time.
class Bag {
 public:
  /// Fails with kNotFound or kIo where there is no such file, with kUnsupported for another format
  /// or an encrypted bag.
  [[nodiscard]] static Result<std::unique_ptr<Bag>> open(const std::filesystem::path& file);

  /// Goes through the whole file once. What cannot be read is passed over and listed in damages().
  /// Allocates for the largest compressed chunk and the largest message that is wanted whole.
  void scan(BagVisitor& visitor);

  /// Every connection that the scan met, those of no interest included, by number.
  [[nodiscard]] const std::map<std::uint32_t, Connection>& connections() const noexcept {
    return connections_;
  }
  /// How many messages of a connection the scan met, wanted or not.
  [[nodiscard]] std::uint64_t message_count(std::uint32_t connection) const {
    const auto found = message_counts_.find(connection);
    return found == message_counts_.end() ? 0 : found->second;
  }
  /// In the order of the file; empty where it is whole.
  [[nodiscard]] const std::vector<Damage>& damages() const noexcept { return damages_; }
  [[nodiscard]] const std::filesystem::path& file() const noexcept { return file_; }

  /// A message's bytes, valid until the next call. Fails with kBadFrame where they can no longer be
  /// read.
  [[nodiscard]] Result<std::span<const std::uint8_t>> read(const MessageRef& ref);

 private:
  friend class BagScan;

  /// A chunk that is compressed.
  struct StoredChunk {
    std::uint64_t offset = 0;  ///< Of its data.
    std::uint64_t stored_bytes = 0;
    std::uint64_t most_bytes = 0;
    Compression compression = Compression::kBz2;
  };
  Bag(std::filesystem::path file, std::unique_ptr<FileBytes> bytes)
      : file_(std::move(file)), bytes_(std::move(bytes)) {}
  /// Makes a chunk the one that is held; what is wrong with it otherwise.
  std::string load(std::int32_t chunk);

  std::filesystem::path file_;
  std::unique_ptr<FileBytes> bytes_;
  /// What the file's header says; 0 for an index that was never written.
  std::uint64_t index_offset_ = 0;
  std::uint32_t connection_count_ = 0;
  std::uint32_t chunk_count_ = 0;
  std::uint64_t first_record_ = 0;

  std::map<std::uint32_t, Connection> connections_;
  std::map<std::uint32_t, std::uint64_t> message_counts_;  ///< By connection.
  std::vector<StoredChunk> chunks_;
  std::vector<Damage> damages_;
  std::int32_t loaded_ = -1;  ///< Of chunks_, the one that chunk_bytes_ holds.
  std::vector<std::uint8_t> chunk_bytes_;
  std::vector<std::uint8_t> message_bytes_;
};

}  // namespace sidestep::rosbag
