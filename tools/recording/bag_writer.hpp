#pragma once

#include <filesystem>
#include <map>
#include <span>
#include <vector>

#include <sidestep/core/error.hpp>

#include "bag_format.hpp"

namespace sidestep::bag {

/// Writes a bag, uncompressed, chunk by chunk. What flush() has written is on its way to the disk
/// whole: if the process ends before close(), `rosbag reindex` makes a bag of it. After a failure
/// to write, only close() is of use. Not for several threads at once.
class Writer {
 public:
  static constexpr std::size_t kChunk_bytes = 768 * 1024;

  /// A new file; fails with kInvalidArgument where there is one already, with kIo where it cannot
  /// be made, naming file and reason.
  [[nodiscard]] static Result<Writer> create(const std::filesystem::path& file,
                                             std::size_t chunk_bytes = kChunk_bytes);
  Writer(Writer&& other) noexcept;
  Writer& operator=(Writer&&) = delete;
  /// close(), but nobody hears of a failure.
  ~Writer();

  /// The number by which write() knows it.
  std::uint32_t add_connection(const std::string& topic, const ros::MessageType& type,
                               bool latching = false);

  /// Adds a message to the chunk, and writes the chunk where that has become large enough. Times
  /// need not ascend. Fails with kIo as flush() does, with kInvalidArgument beyond 1 GiB.
  [[nodiscard]] Result<void> write(std::uint32_t connection, ros::Time time,
                                   std::span<const std::byte> message);

  /// Writes what is in the chunk, if anything. Fails with kIo, naming file and reason (the disk is
  /// full): the chunk is lost, the file ends with the chunk before.
  [[nodiscard]] Result<void> flush();

  /// Writes the index; nothing may be written afterwards. Fails as flush() does.
  [[nodiscard]] Result<void> close();

  /// Of the file so far.
  [[nodiscard]] std::uint64_t bytes() const noexcept { return end_; }

 private:
  struct Entry {
    ros::Time time;
    std::uint32_t offset;  ///< In the chunk's data.
  };
  struct ChunkInfo {
    std::uint64_t position = 0;
    ros::Time first, last;
    std::map<std::uint32_t, std::uint32_t> counts;  ///< Messages by connection.
  };

  Writer(int descriptor, std::filesystem::path file, std::size_t chunk_bytes);
  [[nodiscard]] Result<void> write_file_record(std::uint64_t index_position);
  [[nodiscard]] Result<void> append(std::span<const std::byte> bytes);

  int descriptor_ = -1;  ///< -1 once closed.
  std::filesystem::path file_;
  std::size_t chunk_bytes_;
  std::uint64_t end_ = 0;  ///< Of what is whole in the file.
  std::vector<Connection> connections_;
  std::vector<ChunkInfo> chunks_;
  std::vector<std::byte> chunk_;  ///< Its data so far.
  std::map<std::uint32_t, std::vector<Entry>> chunk_index_;
};

}  // namespace sidestep::bag
