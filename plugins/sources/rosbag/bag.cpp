#include "bag.hpp"

#include <string_view>
#include <utility>

#include "bag_record.hpp"

namespace sidestep::rosbag {
namespace {

using bag::kFirstLine;

std::string seconds_text(Stamp stamp) {
  std::string digits = std::to_string(stamp.ns % 1'000'000'000);
  digits.insert(0, 9 - digits.size(), '0');
  return std::to_string(stamp.ns / 1'000'000'000) + "." + digits + " s";
}

Result<void> check_magic(const FileBytes& bytes, const std::string& where) {
  std::string magic(kFirstLine.size(), '\0');
  if (!bytes.read(0, {reinterpret_cast<std::uint8_t*>(magic.data()), magic.size()})) {
    return fail(ErrorCode::kIo,
                "the bag is cut off in its first line, at byte " + std::to_string(bytes.size()),
                where);
  }
  if (magic == kFirstLine) return {};
  if (magic.starts_with("#ROSBAG V1") || magic.starts_with("#ROSRECORD")) {
    return fail(ErrorCode::kUnsupported, "the bag has a format older than 2.0", where,
                "convert it with `rosbag fix`");
  }
  return fail(ErrorCode::kUnsupported, "this is no bag of ROS 1", where,
              "bags of ROS 1 begin with '#ROSBAG V2.0'");
}

}  // namespace

std::string Damage::describe() const {
  return what + ", at byte " + std::to_string(offset) +
         (after ? ", after the message of " + seconds_text(*after) : ", before the first message");
}

Result<std::unique_ptr<Bag>> Bag::open(const std::filesystem::path& file) {
  auto bytes = FileBytes::open(file);
  if (!bytes) {
    bytes.error().hint = "set source.path";
    return error_of(bytes);
  }
  SIDESTEP_TRY(check_magic(**bytes, file.string()));
  const auto header = bag::read_record(**bytes, kFirstLine.size(), (*bytes)->size());
  if (!header || header->op != bag::Op::kFile || header->end() > (*bytes)->size()) {
    return fail(ErrorCode::kIo,
                "the bag's header cannot be read, at byte " + std::to_string(kFirstLine.size()) +
                    (header ? "" : ": " + header.error()),
                file.string());
  }
  if (const auto encryptor = header->fields.find("encryptor"); encryptor && !encryptor->empty()) {
    return fail(ErrorCode::kUnsupported, "the bag is encrypted, with " + std::string(*encryptor),
                file.string(), "decrypt it with `rosbag decrypt`");
  }
  std::unique_ptr<Bag> opened(new Bag(file, std::move(*bytes)));
  opened->index_offset_ = header->fields.number<std::uint64_t>("index_pos").value_or(0);
  opened->connection_count_ = header->fields.number<std::uint32_t>("conn_count").value_or(0);
  opened->chunk_count_ = header->fields.number<std::uint32_t>("chunk_count").value_or(0);
  opened->first_record_ = header->end();
  return opened;
}

std::string Bag::load(std::int32_t chunk) {
  const StoredChunk& wanted = chunks_[static_cast<std::size_t>(chunk)];
  loaded_ = -1;
  std::vector<std::uint8_t> stored(wanted.stored_bytes);
  if (!bytes_->read(wanted.offset, stored)) return "the file cannot be read";
  ChunkData data = decompress(wanted.compression, stored, wanted.most_bytes);
  chunk_bytes_ = std::move(data.bytes);
  loaded_ = chunk;
  return std::move(data.damage);
}

Result<std::span<const std::uint8_t>> Bag::read(const MessageRef& ref) {
  const auto gone = [&] {
    return fail(ErrorCode::kBadFrame, "the message can no longer be read", file_.string());
  };
  if (ref.chunk < 0) {
    message_bytes_.resize(ref.size_bytes);
    if (!bytes_->read(ref.offset, message_bytes_)) return gone();
    return std::span<const std::uint8_t>(message_bytes_);
  }
  // A damaged chunk was scanned as far as it goes, and its messages with it.
  if (loaded_ != ref.chunk) static_cast<void>(load(ref.chunk));
  if (loaded_ != ref.chunk || ref.offset + ref.size_bytes > chunk_bytes_.size()) return gone();
  return std::span<const std::uint8_t>(chunk_bytes_).subspan(ref.offset, ref.size_bytes);
}

}  // namespace sidestep::rosbag
