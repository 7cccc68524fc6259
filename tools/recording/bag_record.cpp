#include "bag_record.hpp"

#include <fcntl.h>
#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <utility>

namespace sidestep::bag {
namespace {

constexpr std::uint64_t kWindow_bytes = 256 * 1024;
/// No header has this much to say: it is damaged.
constexpr std::uint32_t kLargestHeader_bytes = 1 << 20;

std::uint32_t number_at(std::span<const std::byte> bytes) {
  std::uint32_t number = 0;
  std::memcpy(&number, bytes.data(), sizeof number);
  return number;
}

bool is_op(std::uint8_t op) {
  return op >= static_cast<std::uint8_t>(Op::kMessage) &&
         op <= static_cast<std::uint8_t>(Op::kConnection);
}

}  // namespace

std::optional<Fields> Fields::of(std::span<const std::byte> bytes) {
  Fields fields;
  while (!bytes.empty()) {
    if (bytes.size() < sizeof(std::uint32_t)) return std::nullopt;
    const std::uint32_t size = number_at(bytes);
    bytes = bytes.subspan(sizeof size);
    if (size > bytes.size()) return std::nullopt;
    const std::string_view field(reinterpret_cast<const char*>(bytes.data()), size);
    const std::size_t equals = field.find('=');
    if (equals == std::string_view::npos) return std::nullopt;
    fields.fields_.push_back({field.substr(0, equals), field.substr(equals + 1)});
    bytes = bytes.subspan(size);
  }
  return fields;
}

std::optional<std::string_view> Fields::text(std::string_view name) const noexcept {
  const auto found = std::ranges::find(fields_, name, &Field::name);
  return found == fields_.end() ? std::nullopt : std::optional(found->value);
}

Result<File> File::open(const std::filesystem::path& file) {
  const int descriptor = ::open(file.c_str(), O_RDONLY | O_CLOEXEC);
  struct stat status = {};
  if (descriptor < 0 || fstat(descriptor, &status) != 0) {
    const int reason = errno;
    if (descriptor >= 0) close(descriptor);
    return fail(reason == ENOENT ? ErrorCode::kNotFound : ErrorCode::kIo,
                std::string("cannot read the recording: ") + std::strerror(reason), file.string());
  }
  File opened(descriptor, file, static_cast<std::uint64_t>(status.st_size));
  if (!S_ISREG(status.st_mode)) {
    return fail(ErrorCode::kIo, "cannot read the recording: it is no file", file.string());
  }
  return opened;
}

File::File(int descriptor, std::filesystem::path file, std::uint64_t size)
    : descriptor_(descriptor), file_(std::move(file)), size_(size) {}

File::File(File&& other) noexcept
    : descriptor_(std::exchange(other.descriptor_, -1)),
      file_(std::move(other.file_)),
      size_(other.size_),
      window_(std::move(other.window_)),
      window_position_(other.window_position_) {}

File::~File() {
  if (descriptor_ >= 0) close(descriptor_);
}

Error File::damaged(std::uint64_t position, const std::string& why) const {
  return Error{ErrorCode::kIo, "damaged at byte " + std::to_string(position) + ": " + why,
               file_.string(), "", nullptr};
}

Result<std::span<const std::byte>> File::read(std::uint64_t position, std::uint64_t count) {
  if (position > size_ || count > size_ - position) {
    return tl::make_unexpected(damaged(
        size_, "the file ends here, before what begins at byte " + std::to_string(position)));
  }
  const std::uint64_t window_end = window_position_ + window_.size();
  if (position < window_position_ || position + count > window_end) {
    window_.resize(std::min(std::max(count, kWindow_bytes), size_ - position));
    window_position_ = position;
    std::size_t done = 0;
    while (done < window_.size()) {
      const ssize_t got = pread(descriptor_, window_.data() + done, window_.size() - done,
                                static_cast<off_t>(position + done));
      if (got < 0 && errno == EINTR) continue;
      if (got <= 0) {
        window_.clear();
        return tl::make_unexpected(damaged(
            position + done, got < 0 ? std::strerror(errno) : "the file has become shorter"));
      }
      done += static_cast<std::size_t>(got);
    }
  }
  return std::span<const std::byte>(window_).subspan(position - window_position_, count);
}

Result<Record> File::record(std::uint64_t position, std::uint64_t end) {
  Record record;
  record.position = position;
  const auto read_length = [&](std::uint64_t at) -> Result<std::uint32_t> {
    if (at > end || end - at < sizeof(std::uint32_t)) {
      return tl::make_unexpected(damaged(at, "a record is cut off"));
    }
    const auto bytes = read(at, sizeof(std::uint32_t));
    if (!bytes) return tl::make_unexpected(bytes.error());
    return number_at(*bytes);
  };
  const auto header_bytes = read_length(position);
  if (!header_bytes) return tl::make_unexpected(header_bytes.error());
  const std::uint64_t header_position = position + sizeof(std::uint32_t);
  if (*header_bytes > kLargestHeader_bytes || *header_bytes > end - header_position) {
    return tl::make_unexpected(damaged(position, "a record's header has a length that cannot be"));
  }
  const auto header = read(header_position, *header_bytes);
  if (!header) return tl::make_unexpected(header.error());
  record.header.assign(header->begin(), header->end());
  const auto fields = Fields::of(record.header);
  const auto op = fields ? fields->number<std::uint8_t>("op") : std::nullopt;
  if (!op || !is_op(*op)) {
    return tl::make_unexpected(damaged(position, "what should be a record's header is none"));
  }
  record.op = static_cast<Op>(*op);
  record.fields = *fields;
  const auto data_bytes = read_length(header_position + *header_bytes);
  if (!data_bytes) return tl::make_unexpected(data_bytes.error());
  record.data_position = header_position + *header_bytes + sizeof(std::uint32_t);
  record.data_bytes = *data_bytes;
  if (record.op != Op::kChunk && *data_bytes > end - record.data_position) {
    return tl::make_unexpected(damaged(position, "a record goes on beyond what holds it"));
  }
  return record;
}

}  // namespace sidestep::bag
