#pragma once

#include <concepts>
#include <cstdint>
#include <filesystem>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include <tl/expected.hpp>

#include <sidestep/core/error.hpp>
#include <sidestep/core/time.hpp>

/// Bags of format 2.0 (wiki.ros.org/Bags/Format/2.0): a line, and then records: the length of a
/// header, the header's fields `name=value`, each after its length, the length of the data, the
/// data. Numbers are little-endian.
namespace sidestep::bag {

/// Bytes that can be read from anywhere. One thread at a time.
class ByteSource {
 public:
  virtual ~ByteSource() = default;
  [[nodiscard]] virtual std::uint64_t size() const noexcept = 0;
  /// False where fewer bytes are there, or they cannot be read.
  [[nodiscard]] virtual bool read(std::uint64_t offset, std::span<std::uint8_t> into) const = 0;
};

class MemoryBytes final : public ByteSource {
 public:
  /// Borrows the bytes.
  explicit MemoryBytes(std::span<const std::uint8_t> bytes) : bytes_(bytes) {}
  [[nodiscard]] std::uint64_t size() const noexcept override { return bytes_.size(); }
  [[nodiscard]] bool read(std::uint64_t offset, std::span<std::uint8_t> into) const override;

 private:
  std::span<const std::uint8_t> bytes_;
};

/// A file as large as it was when it was opened.
class FileBytes final : public ByteSource {
 public:
  /// Fails with kNotFound or kIo, naming the file.
  [[nodiscard]] static Result<std::unique_ptr<FileBytes>> open(const std::filesystem::path& file);
  ~FileBytes() override;
  FileBytes(const FileBytes&) = delete;
  FileBytes& operator=(const FileBytes&) = delete;

  [[nodiscard]] std::uint64_t size() const noexcept override { return size_; }
  [[nodiscard]] bool read(std::uint64_t offset, std::span<std::uint8_t> into) const override;

 private:
  FileBytes(int descriptor, std::uint64_t size) : descriptor_(descriptor), size_(size) {}
  int descriptor_;
  std::uint64_t size_;
};

inline constexpr std::string_view kFirstLine = "#ROSBAG V2.0\n";

/// What a record is, its field `op`.
enum class Op : std::uint8_t {
  kMessage = 2,
  kFile = 3,  ///< The first one: where the index is.
  kIndex = 4,
  kChunk = 5,
  kChunkInfo = 6,
  kConnection = 7,
};

/// The little-endian number that bytes hold, eight at most.
[[nodiscard]] std::uint64_t read_number(std::string_view bytes) noexcept;

/// The fields of a header, which it keeps.
class Fields {
 public:
  /// Nothing where the bytes are no fields.
  [[nodiscard]] static std::optional<Fields> parse(std::string bytes);

  [[nodiscard]] std::optional<std::string_view> find(std::string_view name) const;
  /// Nothing as well where the field has not the number's size.
  template <std::unsigned_integral Number>
  [[nodiscard]] std::optional<Number> number(std::string_view name) const {
    const auto field = find(name);
    if (!field || field->size() != sizeof(Number)) return std::nullopt;
    return static_cast<Number>(read_number(*field));
  }
  [[nodiscard]] std::optional<Stamp> time(std::string_view name) const;

 private:
  struct Field {
    std::uint32_t begin;
    std::uint32_t equals;
    std::uint32_t end;
  };
  std::string bytes_;
  std::vector<Field> fields_;
};

/// A record, without its data.
struct Record {
  Op op = Op::kMessage;
  Fields fields;
  std::uint64_t data_offset = 0;
  std::uint32_t data_size = 0;

  [[nodiscard]] std::uint64_t end() const noexcept { return data_offset + data_size; }
};

/// The record at an offset; its data may go on beyond `limit`, the header does not. Fails with what
/// is wrong, for people.
[[nodiscard]] tl::expected<Record, std::string> read_record(const ByteSource& bytes,
                                                            std::uint64_t offset,
                                                            std::uint64_t limit);

}  // namespace sidestep::bag
