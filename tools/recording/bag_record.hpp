#pragma once

#include <cstring>
#include <filesystem>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include <sidestep/core/error.hpp>

#include "bag_format.hpp"

namespace sidestep::bag {

/// The fields of a record's header, or of what is written like one. Borrows their bytes.
class Fields {
 public:
  Fields() = default;
  /// Nothing where the bytes are no fields.
  [[nodiscard]] static std::optional<Fields> of(std::span<const std::byte> bytes);

  /// A field's value; nothing where there is no such field.
  [[nodiscard]] std::optional<std::string_view> text(std::string_view name) const noexcept;
  /// The same as a number; nothing where it has another size.
  template <class Number>
  [[nodiscard]] std::optional<Number> number(std::string_view name) const noexcept {
    const auto value = text(name);
    if (!value || value->size() != sizeof(Number)) return std::nullopt;
    Number number;
    std::memcpy(&number, value->data(), sizeof number);
    return number;
  }

 private:
  struct Field {
    std::string_view name, value;
  };
  std::vector<Field> fields_;
};

/// Where a record is in the file, and what its header says.
struct Record {
  Op op = Op::kFile;
  std::uint64_t position = 0;
  std::vector<std::byte> header;  ///< What `fields` borrows.
  Fields fields;
  std::uint64_t data_position = 0;
  std::uint32_t data_bytes = 0;

  Record() = default;
  Record(Record&&) = default;
  Record& operator=(Record&&) = default;

  [[nodiscard]] std::uint64_t end() const noexcept { return data_position + data_bytes; }
};

/// A bag's file, read in stretches. Whatever it holds, no more is read than there is.
class File {
 public:
  /// Fails with kNotFound or kIo, naming file and reason.
  [[nodiscard]] static Result<File> open(const std::filesystem::path& file);
  File(File&& other) noexcept;
  File& operator=(File&&) = delete;
  ~File();

  [[nodiscard]] std::uint64_t size() const noexcept { return size_; }

  /// `count` bytes, until the next call. Fails with kIo, naming the byte where the file ends.
  [[nodiscard]] Result<std::span<const std::byte>> read(std::uint64_t position,
                                                        std::uint64_t count);

  /// The record at `position`, which must end by `end` but for the data of a chunk, which may go
  /// on beyond the end of a file that is cut off. Fails with kIo, naming the byte.
  [[nodiscard]] Result<Record> record(std::uint64_t position, std::uint64_t end);

  [[nodiscard]] Error damaged(std::uint64_t position, const std::string& why) const;

 private:
  File(int descriptor, std::filesystem::path file, std::uint64_t size);

  int descriptor_ = -1;
  std::filesystem::path file_;
  std::uint64_t size_ = 0;
  std::vector<std::byte> window_;
  std::uint64_t window_position_ = 0;
};

}  // namespace sidestep::bag
