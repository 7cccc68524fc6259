#pragma once

#include <filesystem>
#include <memory>
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

  /// `count` bytes, until the next call. Fails with kIo, naming the byte where the file ends.
  [[nodiscard]] Result<std::span<const std::byte>> read(std::uint64_t position,
                                                        std::uint64_t count);

  /// The record at `position`, which must end by `end` but for the data of a chunk, which may go
  /// on beyond the end of a file that is cut off. Fails with kIo, naming the byte.
  [[nodiscard]] Result<PlacedRecord> record(std::uint64_t position, std::uint64_t end) const;

  [[nodiscard]] Error damaged(std::uint64_t position, const std::string& why) const;

 private:
  File(std::filesystem::path file, std::unique_ptr<FileBytes> bytes)
      : file_(std::move(file)), bytes_(std::move(bytes)) {}

  std::filesystem::path file_;
  std::unique_ptr<FileBytes> bytes_;
  std::vector<std::uint8_t> read_;  ///< Last.
};

}  // namespace sidestep::bag
