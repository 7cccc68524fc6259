#include "bag_record.hpp"

#include <fcntl.h>
#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <cstring>

namespace sidestep::bag {
namespace {

bool lies_within(std::uint64_t offset, std::size_t count, std::uint64_t size) {
  return offset <= size && count <= size - offset;
}

constexpr std::size_t kLengthBytes = 4;
/// Headers hold a few numbers and a topic's name; connections have the definition of a message,
/// which may be long.
constexpr std::uint32_t kLongestHeader = 1U << 20;
/// The length at the beginning of bytes that hold it.
std::uint32_t read_length(std::string_view bytes) noexcept {
  return static_cast<std::uint32_t>(read_number(bytes.substr(0, kLengthBytes)));
}

/// What most headers fit in with both lengths.
constexpr std::size_t kUsual = 256;

bool read_text(const ByteSource& bytes, std::uint64_t offset, std::size_t count,
               std::string& into) {
  into.resize(count);
  return bytes.read(offset, {reinterpret_cast<std::uint8_t*>(into.data()), count});
}

}  // namespace

bool MemoryBytes::read(std::uint64_t offset, std::span<std::uint8_t> into) const {
  if (!lies_within(offset, into.size(), size())) return false;
  std::ranges::copy(bytes_.subspan(offset, into.size()), into.begin());
  return true;
}

Result<std::unique_ptr<FileBytes>> FileBytes::open(const std::filesystem::path& file) {
  const int descriptor = ::open(file.c_str(), O_RDONLY | O_CLOEXEC);
  if (descriptor < 0) {
    const int error = errno;
    if (error == ENOENT || error == ENOTDIR) {
      return fail(ErrorCode::kNotFound, "there is no such file", file.string());
    }
    return fail(ErrorCode::kIo, std::string("the file cannot be opened: ") + std::strerror(error),
                file.string());
  }
  struct stat status {};
  if (fstat(descriptor, &status) != 0 || !S_ISREG(status.st_mode)) {
    ::close(descriptor);
    return fail(ErrorCode::kNotFound, "this is no file", file.string());
  }
  return std::unique_ptr<FileBytes>(
      new FileBytes(descriptor, static_cast<std::uint64_t>(status.st_size)));
}

FileBytes::~FileBytes() { ::close(descriptor_); }

bool FileBytes::read(std::uint64_t offset, std::span<std::uint8_t> into) const {
  if (!lies_within(offset, into.size(), size_)) return false;
  while (!into.empty()) {
    const ssize_t count =
        ::pread(descriptor_, into.data(), into.size(), static_cast<off_t>(offset));
    if (count < 0 && errno == EINTR) continue;
    if (count <= 0) return false;
    offset += static_cast<std::uint64_t>(count);
    into = into.subspan(static_cast<std::size_t>(count));
  }
  return true;
}

std::uint64_t read_number(std::string_view bytes) noexcept {
  std::uint64_t number = 0;
  for (std::size_t i = bytes.size(); i-- > 0;) {
    number = number << 8U | static_cast<unsigned char>(bytes[i]);
  }
  return number;
}

std::optional<Fields> Fields::parse(std::string bytes) {
  Fields fields;
  fields.bytes_ = std::move(bytes);
  const std::string_view all = fields.bytes_;
  for (std::size_t at = 0; at < all.size();) {
    if (all.size() - at < kLengthBytes) return std::nullopt;
    const std::size_t length = read_length(all.substr(at));
    at += kLengthBytes;
    if (length > all.size() - at) return std::nullopt;
    const std::size_t equals = all.substr(at, length).find('=');
    if (equals == std::string_view::npos) return std::nullopt;
    fields.fields_.push_back({static_cast<std::uint32_t>(at),
                              static_cast<std::uint32_t>(at + equals),
                              static_cast<std::uint32_t>(at + length)});
    at += length;
  }
  return fields;
}

std::optional<std::string_view> Fields::find(std::string_view name) const {
  const std::string_view all = bytes_;
  for (const Field& field : fields_) {
    if (all.substr(field.begin, field.equals - field.begin) != name) continue;
    return all.substr(field.equals + 1, field.end - field.equals - 1);
  }
  return std::nullopt;
}

std::optional<Stamp> Fields::time(std::string_view name) const {
  const auto both = number<std::uint64_t>(name);
  if (!both) return std::nullopt;
  const std::uint64_t seconds = *both & 0xffffffffU;
  const std::uint64_t nanoseconds = *both >> 32U;
  return Stamp{static_cast<std::int64_t>(seconds * 1'000'000'000U + nanoseconds)};
}

tl::expected<Record, std::string> read_record(const ByteSource& bytes, std::uint64_t offset,
                                              std::uint64_t limit) {
  const auto bad = [](std::string what) { return tl::make_unexpected(std::move(what)); };
  const std::uint64_t left = limit - offset;
  std::string head;
  const auto usual = static_cast<std::size_t>(std::min<std::uint64_t>(left, kUsual));
  if (!read_text(bytes, offset, usual, head)) return bad("the file cannot be read");
  if (head.size() < kLengthBytes) return bad("it is cut off in a record's header");
  const std::uint32_t length = read_length(head);
  if (length > kLongestHeader) return bad("there is no record");
  const std::size_t whole = length + 2 * kLengthBytes;
  if (whole > left) return bad("it is cut off in a record's header");
  if (whole > head.size() && !read_text(bytes, offset, whole, head)) {
    return bad("the file cannot be read");
  }
  auto fields = Fields::parse(head.substr(kLengthBytes, length));
  const auto op = fields ? fields->number<std::uint8_t>("op") : std::nullopt;
  if (!op) return bad("there is no record");
  Record record{static_cast<Op>(*op), std::move(*fields), offset + whole, 0};
  record.data_size = read_length(std::string_view(head).substr(whole - kLengthBytes));
  return record;
}

}  // namespace sidestep::bag
