#pragma once

#include <filesystem>
#include <map>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include <sidestep/core/error.hpp>

#include "bag_format.hpp"

namespace sidestep::bag {

/// A record, and where it begins.
struct PlacedRecord : Record {
  std::uint64_t position = 0;
};

/// A bag's file. Whatever it holds, no more is read than there is.
class File {
 public:
  /// Fails with kNotFound or kIo, naming file and reason.
  [[nodiscard]] static Result<File> open(const std::filesystem::path& file);

  [[nodiscard]] std::uint64_t size() const noexcept { return bytes_->size(); }
  [[nodiscard]] std::string name() const { return file_.string(); }

  /// `count` bytes, until the next call. Fails with kIo, naming the byte where the file ends.
  [[nodiscard]] Result<std::span<const std::byte>> read(std::uint64_t position,
                                                        std::uint64_t count);

  /// The record at `position`, which must end by `end` but for the data of a chunk, which may go
  /// on beyond the end of a file that is cut off. Fails with kIo, naming the byte.
  [[nodiscard]] Result<PlacedRecord> record(std::uint64_t position, std::uint64_t end) const;

  [[nodiscard]] tl::unexpected<Error> damaged(std::uint64_t position, const std::string& why) const;

 private:
  File(std::filesystem::path file, std::unique_ptr<FileBytes> bytes)
      : file_(std::move(file)), bytes_(std::move(bytes)) {}

  std::filesystem::path file_;
  std::unique_ptr<FileBytes> bytes_;
  std::vector<std::uint8_t> read_;  ///< Last.
};

/// A message as it lies in a bag. Its bytes are there until the reader's next call.
struct Message {
  const Connection* connection = nullptr;
  ros::Time time;
  std::span<const std::byte> data;
};

/// Reads an uncompressed bag of format 2.0, anybody's, in the order of time. Whatever the file
/// holds, what is read is checked, and no more memory is taken than the file is long, some times
/// over. Not for several threads at once.
class Reader {
 public:
  /// By the bag's index, or, where it has none or the index is damaged, by all of its records up to
  /// where they break off. Fails with kNotFound or kIo, naming file and reason, where it is no bag,
  /// and with kUnsupported where its chunks are compressed.
  [[nodiscard]] static Result<Reader> open(const std::filesystem::path& file);

  [[nodiscard]] bool is_indexed() const noexcept { return is_indexed_; }
  /// Where and why not all of the file could be read; names the byte.
  [[nodiscard]] const std::optional<Error>& damage() const noexcept { return damage_; }

  /// By their numbers in the bag.
  [[nodiscard]] const std::map<std::uint32_t, Connection>& connections() const noexcept {
    return connections_;
  }
  [[nodiscard]] std::size_t message_count() const noexcept { return entries_.size(); }

  /// Only messages of these topics come from now on; all where there are none.
  void select(const std::vector<std::string>& topics);
  /// The next message; nothing after the last. Fails with kIo, naming the byte, where the message
  /// is not what the index says; the one after it may be.
  [[nodiscard]] Result<std::optional<Message>> next();

 private:
  struct Entry {
    ros::Time time;
    std::uint32_t connection = 0;
    std::uint64_t position = 0;  ///< Of the message's record.
  };

  explicit Reader(File file) : file_(std::move(file)) {}
  [[nodiscard]] Result<void> read_all();
  [[nodiscard]] Result<void> read_index(const PlacedRecord& file_record);
  [[nodiscard]] Result<void> read_chunk_index(const PlacedRecord& chunk_info);
  [[nodiscard]] Result<std::uint32_t> read_entries(const PlacedRecord& index,
                                                   const PlacedRecord& chunk);
  [[nodiscard]] Result<void> scan(std::uint64_t position);
  [[nodiscard]] Result<void> scan_chunk(const PlacedRecord& chunk);
  [[nodiscard]] Result<void> note_connection(const PlacedRecord& record);
  [[nodiscard]] Result<void> check_chunk(const PlacedRecord& chunk) const;

  File file_;
  bool is_indexed_ = false;
  std::optional<Error> damage_;
  std::map<std::uint32_t, Connection> connections_;
  std::vector<Entry> entries_;  ///< Ascending in time.
  std::size_t next_ = 0;
  std::optional<std::vector<std::uint32_t>> selected_;  ///< Connections; nothing: all.
};

}  // namespace sidestep::bag
