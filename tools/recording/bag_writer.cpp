#include "bag_writer.hpp"

#include <fcntl.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <cstring>
#include <new>
#include <utility>

namespace sidestep::bag {
namespace {

using Bytes = std::vector<std::byte>;

constexpr std::size_t kLargestMessage_bytes = std::size_t{1} << 30;

void append_raw(Bytes& bytes, const void* data, std::size_t size) {
  const std::size_t before = bytes.size();
  bytes.resize(before + size);
  if (size > 0) std::memcpy(bytes.data() + before, data, size);
}
template <class Number>
void append_number(Bytes& bytes, Number number) {
  append_raw(bytes, &number, sizeof number);
}

/// The header of a record, or what is written like one: fields after their lengths.
class FieldList {
 public:
  explicit FieldList(Op op) { add("op", op); }
  FieldList() = default;

  template <class Value>
  FieldList& add(std::string_view name, Value value) {
    begin(name, sizeof value);
    append_number(bytes_, value);
    return *this;
  }
  FieldList& add(std::string_view name, const std::string& value) {
    begin(name, value.size());
    append_raw(bytes_, value.data(), value.size());
    return *this;
  }
  [[nodiscard]] const Bytes& bytes() const noexcept { return bytes_; }

 private:
  void begin(std::string_view name, std::size_t value_bytes) {
    append_number(bytes_, static_cast<std::uint32_t>(name.size() + 1 + value_bytes));
    append_raw(bytes_, name.data(), name.size());
    append_raw(bytes_, "=", 1);
  }

  Bytes bytes_;
};

void append_sized(Bytes& bytes, std::span<const std::byte> data) {
  append_number(bytes, static_cast<std::uint32_t>(data.size()));
  append_raw(bytes, data.data(), data.size());
}

void append_record(Bytes& bytes, const FieldList& header, std::span<const std::byte> data) {
  append_sized(bytes, header.bytes());
  append_sized(bytes, data);
}

void append_connection(Bytes& bytes, const Connection& connection) {
  FieldList header(Op::kConnection);
  header.add("conn", connection.id).add("topic", connection.topic);
  FieldList data;
  data.add("topic", connection.topic)
      .add("type", connection.type)
      .add("md5sum", connection.md5sum)
      .add("message_definition", connection.definition)
      .add("callerid", std::string("/sidestep"))
      .add("latching", std::string(connection.latching ? "1" : "0"));
  append_record(bytes, header, data.bytes());
}

tl::unexpected<Error> io_error(const std::filesystem::path& file, int reason) {
  return fail(ErrorCode::kIo, std::string("cannot write the recording: ") + std::strerror(reason),
              file.string());
}

/// 0, or why not all of it could be written.
int write_all(int descriptor, std::span<const std::byte> bytes, std::uint64_t position) {
  while (!bytes.empty()) {
    const ssize_t count =
        pwrite(descriptor, bytes.data(), bytes.size(), static_cast<off_t>(position));
    if (count < 0 && errno == EINTR) continue;
    if (count <= 0) return count < 0 ? errno : ENOSPC;
    bytes = bytes.subspan(static_cast<std::size_t>(count));
    position += static_cast<std::uint64_t>(count);
  }
  return 0;
}

}  // namespace

Result<Writer> Writer::create(const std::filesystem::path& file, std::size_t chunk_bytes) {
  const int descriptor = open(file.c_str(), O_WRONLY | O_CREAT | O_EXCL | O_CLOEXEC,
                              S_IRUSR | S_IWUSR | S_IRGRP | S_IROTH);
  if (descriptor < 0 && errno == EEXIST) {
    return fail(ErrorCode::kInvalidArgument, "the file exists, and is not overwritten",
                file.string(), "give another name, or remove it");
  }
  if (descriptor < 0) return io_error(file, errno);
  Writer writer(descriptor, file, chunk_bytes);
  Bytes first_line;
  append_raw(first_line, kFirstLine.data(), kFirstLine.size());
  SIDESTEP_TRY(writer.append(first_line));
  SIDESTEP_TRY(writer.write_file_record(0));
  return writer;
}

Writer::Writer(int descriptor, std::filesystem::path file, std::size_t chunk_bytes)
    : descriptor_(descriptor), file_(std::move(file)), chunk_bytes_(chunk_bytes) {}

Writer::Writer(Writer&& other) noexcept
    : descriptor_(std::exchange(other.descriptor_, -1)),
      file_(std::move(other.file_)),
      chunk_bytes_(other.chunk_bytes_),
      end_(other.end_),
      connections_(std::move(other.connections_)),
      chunks_(std::move(other.chunks_)),
      chunk_(std::move(other.chunk_)),
      chunk_index_(std::move(other.chunk_index_)) {}

Writer::~Writer() {
  try {
    (void)close();
  } catch (const std::bad_alloc&) {  // The bag lacks its index, which `rosbag reindex` makes.
    ::close(descriptor_);
  }
}

std::uint32_t Writer::add_connection(const std::string& topic, const ros::MessageType& type,
                                     bool latching) {
  const auto id = static_cast<std::uint32_t>(connections_.size());
  connections_.push_back({id, topic, std::string(type.name), std::string(type.md5sum),
                          std::string(type.definition), latching});
  append_connection(chunk_, connections_.back());
  return id;
}

Result<void> Writer::write(std::uint32_t connection, ros::Time time,
                           std::span<const std::byte> message) {
  if (message.size() > kLargestMessage_bytes) {
    return fail(ErrorCode::kInvalidArgument, "a message of more than 1 GiB is not recorded",
                file_.string());
  }
  // The number of bytes of a chunk must fit into 32 bits.
  if (!chunk_.empty() && chunk_.size() + message.size() > 2 * kLargestMessage_bytes) {
    SIDESTEP_TRY(flush());
  }
  chunk_index_[connection].push_back({time, static_cast<std::uint32_t>(chunk_.size())});
  FieldList header(Op::kMessage);
  header.add("conn", connection).add("time", time);
  append_record(chunk_, header, message);
  return chunk_.size() >= chunk_bytes_ ? flush() : Result<void>{};
}

Result<void> Writer::flush() {
  if (chunk_.empty()) return {};
  ChunkInfo info{.position = end_, .first = {~0U, 0}, .last = {}, .counts = {}};
  FieldList header(Op::kChunk);
  header.add("compression", std::string("none"));
  header.add("size", static_cast<std::uint32_t>(chunk_.size()));
  Bytes bytes;
  bytes.reserve(chunk_.size() + 4096);
  append_record(bytes, header, chunk_);
  for (auto& [connection, entries] : chunk_index_) {
    std::ranges::stable_sort(entries, {}, &Entry::time);
    info.first = std::min(info.first, entries.front().time);
    info.last = std::max(info.last, entries.back().time);
    info.counts[connection] = static_cast<std::uint32_t>(entries.size());
    FieldList index(Op::kIndex);
    index.add("ver", kIndexVersion).add("conn", connection);
    index.add("count", static_cast<std::uint32_t>(entries.size()));
    Bytes data;
    for (const Entry& entry : entries) {
      append_number(data, entry.time);
      append_number(data, entry.offset);
    }
    append_record(bytes, index, data);
  }
  if (info.counts.empty()) info.first = {};
  chunk_.clear();
  chunk_index_.clear();
  auto written = append(bytes);
  if (written) chunks_.push_back(std::move(info));
  return written;
}

Result<void> Writer::close() {
  if (descriptor_ < 0) return {};
  auto done = flush();
  // Where the disk is full, there may be room for the index still.
  const std::uint64_t index_position = end_;
  Bytes index;
  for (const Connection& connection : connections_) append_connection(index, connection);
  for (const ChunkInfo& chunk : chunks_) {
    FieldList header(Op::kChunkInfo);
    header.add("ver", kIndexVersion).add("chunk_pos", chunk.position);
    header.add("start_time", chunk.first).add("end_time", chunk.last);
    header.add("count", static_cast<std::uint32_t>(chunk.counts.size()));
    Bytes data;
    for (const auto& [connection, count] : chunk.counts) {
      append_number(data, connection);
      append_number(data, count);
    }
    append_record(index, header, data);
  }
  auto indexed = append(index);
  if (indexed) indexed = write_file_record(index_position);
  if (done) done = std::move(indexed);
  if (::close(descriptor_) != 0 && done) done = io_error(file_, errno);
  descriptor_ = -1;
  return done;
}

Result<void> Writer::write_file_record(std::uint64_t index_position) {
  FieldList header(Op::kFile);
  header.add("index_pos", index_position);
  header.add("conn_count",
             static_cast<std::uint32_t>(index_position > 0 ? connections_.size() : 0));
  header.add("chunk_count", static_cast<std::uint32_t>(index_position > 0 ? chunks_.size() : 0));
  Bytes bytes;
  append_record(bytes, header,
                Bytes(kFileRecord_bytes - header.bytes().size(), static_cast<std::byte>(' ')));
  if (end_ == kFirstLine.size()) return append(bytes);
  const int reason = write_all(descriptor_, bytes, kFirstLine.size());
  return reason == 0 ? Result<void>{} : io_error(file_, reason);
}

/// All of it, or the file is as before.
Result<void> Writer::append(std::span<const std::byte> bytes) {
  const int reason = write_all(descriptor_, bytes, end_);
  if (reason == 0) {
    end_ += bytes.size();
    return {};
  }
  // What is left of it would keep a reader from the index; where even this fails, `rosbag reindex`
  // knows how to go on.
  (void)!ftruncate(descriptor_, static_cast<off_t>(end_));
  return io_error(file_, reason);
}

}  // namespace sidestep::bag
