#include "bag_file.hpp"

#include <utility>

namespace sidestep::bag {
namespace {

bool is_op(Op op) { return op >= Op::kMessage && op <= Op::kConnection; }

}  // namespace

Result<File> File::open(const std::filesystem::path& file) {
  auto bytes = FileBytes::open(file);
  if (!bytes) {
    bytes.error().message = "cannot read the recording: " + bytes.error().message;
    return error_of(bytes);
  }
  return File(file, std::move(*bytes));
}

Error File::damaged(std::uint64_t position, const std::string& why) const {
  return Error{ErrorCode::kIo, "damaged at byte " + std::to_string(position) + ": " + why,
               file_.string(), "", nullptr};
}

Result<std::span<const std::byte>> File::read(std::uint64_t position, std::uint64_t count) {
  if (position > size() || count > size() - position) {
    return tl::make_unexpected(damaged(
        size(), "the file ends here, before what begins at byte " + std::to_string(position)));
  }
  read_.resize(count);
  if (!bytes_->read(position, read_)) {
    return tl::make_unexpected(damaged(position, "the file cannot be read here any more"));
  }
  return std::as_bytes(std::span<const std::uint8_t>(read_));
}

Result<PlacedRecord> File::record(std::uint64_t position, std::uint64_t end) const {
  if (position > end) return tl::make_unexpected(damaged(position, "a record is cut off"));
  auto read = read_record(*bytes_, position, end);
  if (!read) return tl::make_unexpected(damaged(position, read.error()));
  if (!is_op(read->op)) {
    return tl::make_unexpected(damaged(position, "what should be a record's header is none"));
  }
  PlacedRecord record{std::move(*read), position};
  if (record.op != Op::kChunk && record.end() > end) {
    return tl::make_unexpected(damaged(position, "a record goes on beyond what holds it"));
  }
  return record;
}

}  // namespace sidestep::bag
