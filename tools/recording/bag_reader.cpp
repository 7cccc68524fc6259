#include "bag_reader.hpp"

#include <algorithm>
#include <cstring>
#include <utility>

namespace sidestep::bag {
namespace {

bool is_op(Op op) { return op >= Op::kMessage && op <= Op::kConnection; }

/// A message's record takes this much at least: its fields, and no data.
constexpr std::uint64_t kSmallestMessage_bytes = 46;

template <class Number>
Number number_at(std::span<const std::byte> bytes, std::size_t position) {
  Number number;
  std::memcpy(&number, bytes.data() + position, sizeof number);
  return number;
}

/// Of a message's header.
std::optional<ros::Time> time_of(const Fields& fields) {
  const auto both = fields.number<std::uint64_t>("time");
  if (!both) return std::nullopt;
  return ros::Time{static_cast<std::uint32_t>(*both), static_cast<std::uint32_t>(*both >> 32U)};
}

}  // namespace

Result<File> File::open(const std::filesystem::path& file) {
  auto bytes = FileBytes::open(file);
  if (!bytes) {
    bytes.error().message = "cannot read the recording: " + bytes.error().message;
    return error_of(bytes);
  }
  return File(file, std::move(*bytes));
}

tl::unexpected<Error> File::damaged(std::uint64_t position, const std::string& why) const {
  return fail(ErrorCode::kIo, "damaged at byte " + std::to_string(position) + ": " + why,
              file_.string());
}

Result<std::span<const std::byte>> File::read(std::uint64_t position, std::uint64_t count) {
  if (position > size() || count > size() - position) {
    return damaged(size(),
                   "the file ends here, before what begins at byte " + std::to_string(position));
  }
  read_.resize(count);
  if (!bytes_->read(position, read_)) {
    return damaged(position, "the file cannot be read here any more");
  }
  return std::as_bytes(std::span<const std::uint8_t>(read_));
}

Result<PlacedRecord> File::record(std::uint64_t position, std::uint64_t end) const {
  if (position > end) return damaged(position, "a record is cut off");
  auto read = read_record(*bytes_, position, end);
  if (!read) return damaged(position, read.error());
  if (!is_op(read->op)) {
    return damaged(position, "what should be a record's header is none");
  }
  PlacedRecord record{std::move(*read), position};
  if (record.op != Op::kChunk && record.end() > end) {
    return damaged(position, "a record goes on beyond what holds it");
  }
  return record;
}

Result<Reader> Reader::open(const std::filesystem::path& file) {
  auto opened = SIDESTEP_TRY(File::open(file));
  Reader reader(std::move(opened));
  SIDESTEP_TRY(reader.read_all());
  return reader;
}

Result<void> Reader::read_all() {
  const auto line = file_.read(0, kFirstLine.size());
  if (!line || std::memcmp(line->data(), kFirstLine.data(), kFirstLine.size()) != 0) {
    return file_.damaged(0, "this is no ROS bag of format 2.0");
  }
  const auto first = SIDESTEP_TRY(file_.record(kFirstLine.size(), file_.size()));
  if (first.op != Op::kFile) {
    return file_.damaged(first.position, "the bag does not begin as one");
  }
  const auto indexed = read_index(first);
  is_indexed_ = indexed.has_value();
  if (!indexed) {
    if (indexed.error().code == ErrorCode::kUnsupported) return indexed;
    connections_.clear();
    entries_.clear();
    const auto scanned = scan(first.end());
    if (!scanned && scanned.error().code == ErrorCode::kUnsupported) return scanned;
    if (!scanned) {
      damage_ = scanned.error();
    } else if (indexed.error().code != ErrorCode::kNotFound) {
      damage_ = indexed.error();
    }
  }
  std::ranges::stable_sort(entries_, {}, &Entry::time);
  return {};
}

/// Fails with kNotFound where there is none.
Result<void> Reader::read_index(const PlacedRecord& file_record) {
  const auto begin = file_record.fields.number<std::uint64_t>("index_pos");
  const auto connections = file_record.fields.number<std::uint32_t>("conn_count");
  const auto chunks = file_record.fields.number<std::uint32_t>("chunk_count");
  if (!begin || !connections || !chunks) {
    return file_.damaged(file_record.position, "it is not said where the index is");
  }
  if (*begin == 0) return fail(ErrorCode::kNotFound, "there is no index");
  std::uint64_t position = *begin;
  for (std::uint32_t i = 0; i < *connections; ++i) {
    const auto record = SIDESTEP_TRY(file_.record(position, file_.size()));
    SIDESTEP_TRY(note_connection(record));
    position = record.end();
  }
  for (std::uint32_t i = 0; i < *chunks; ++i) {
    const auto record = SIDESTEP_TRY(file_.record(position, file_.size()));
    SIDESTEP_TRY(read_chunk_index(record));
    position = record.end();
  }
  return {};
}

Result<void> Reader::note_connection(const PlacedRecord& record) {
  const auto id = record.fields.number<std::uint32_t>("conn");
  const auto topic = record.fields.find("topic");
  if (record.op != Op::kConnection || !id || !topic) {
    return file_.damaged(record.position, "here should be a connection");
  }
  const auto data = SIDESTEP_TRY(file_.read(record.data_offset, record.data_size));
  const auto fields = Fields::parse({reinterpret_cast<const char*>(data.data()), data.size()});
  const auto type = fields ? fields->find("type") : std::nullopt;
  const auto md5sum = fields ? fields->find("md5sum") : std::nullopt;
  const auto definition = fields ? fields->find("message_definition") : std::nullopt;
  if (!type || !md5sum || !definition) {
    return file_.damaged(record.position, "a connection does not say what its messages are");
  }
  Connection connection{.id = *id,
                        .topic = std::string(*topic),
                        .type = std::string(*type),
                        .md5sum = std::string(*md5sum),
                        .definition = std::string(*definition),
                        .latching = fields->find("latching") == "1"};
  // Said again in every chunk that has its messages, and in the index: it remains as it was said
  // first.
  connections_.try_emplace(*id, std::move(connection));
  return {};
}

Result<void> Reader::check_chunk(const PlacedRecord& chunk) const {
  const auto compression = chunk.fields.find("compression");
  const auto size = chunk.fields.number<std::uint32_t>("size");
  if (chunk.op != Op::kChunk || !compression || !size) {
    return file_.damaged(chunk.position, "here should be a chunk");
  }
  if (*compression == "bz2" || *compression == "lz4") {
    return fail(ErrorCode::kUnsupported,
                "the bag's chunks are compressed (" + std::string(*compression) + ")", file_.name(),
                "make a plain copy with `rosbag decompress`");
  }
  if (*compression != "none" || *size != chunk.data_size) {
    return file_.damaged(chunk.position, "a chunk contradicts itself");
  }
  return {};
}

Result<void> Reader::read_chunk_index(const PlacedRecord& chunk_info) {
  const auto begin = chunk_info.fields.number<std::uint64_t>("chunk_pos");
  const auto connections = chunk_info.fields.number<std::uint32_t>("count");
  if (chunk_info.op != Op::kChunkInfo || !begin || !connections ||
      chunk_info.data_size != *connections * kChunkCount_bytes) {
    return file_.damaged(chunk_info.position, "here should be what there is in a chunk");
  }
  const auto data = SIDESTEP_TRY(file_.read(chunk_info.data_offset, chunk_info.data_size));
  std::map<std::uint32_t, std::uint32_t> counts;
  for (std::uint32_t i = 0; i < *connections; ++i) {
    counts[number_at<std::uint32_t>(data, i * kChunkCount_bytes)] =
        number_at<std::uint32_t>(data, i * kChunkCount_bytes + sizeof(std::uint32_t));
  }
  const auto chunk = SIDESTEP_TRY(file_.record(*begin, file_.size()));
  SIDESTEP_TRY(check_chunk(chunk));
  std::uint64_t position = chunk.end();
  for (std::uint32_t i = 0; i < *connections; ++i) {
    const auto index = SIDESTEP_TRY(file_.record(position, file_.size()));
    const auto connection = SIDESTEP_TRY(read_entries(index, chunk));
    const auto said = counts.find(connection);
    if (said == counts.end() || said->second * kIndexEntry_bytes != index.data_size) {
      return file_.damaged(index.position, "a chunk's index is not what is said of the chunk");
    }
    counts.erase(said);
    position = index.end();
  }
  return {};
}

/// Returns the connection whose messages they are.
Result<std::uint32_t> Reader::read_entries(const PlacedRecord& index, const PlacedRecord& chunk) {
  const auto version = index.fields.number<std::uint32_t>("ver");
  const auto connection = index.fields.number<std::uint32_t>("conn");
  const auto count = index.fields.number<std::uint32_t>("count");
  if (index.op != Op::kIndex || version != kIndexVersion || !connection || !count ||
      !connections_.contains(*connection) ||
      index.data_size != std::uint64_t{*count} * kIndexEntry_bytes) {
    return file_.damaged(index.position, "here should be a chunk's index");
  }
  // Else damage that names one chunk again and again would cost memory.
  if (entries_.size() + *count > file_.size() / kSmallestMessage_bytes) {
    return file_.damaged(index.position, "the index names more messages than there can be");
  }
  const auto data = SIDESTEP_TRY(file_.read(index.data_offset, index.data_size));
  for (std::size_t i = 0; i < *count; ++i) {
    const auto time = number_at<ros::Time>(data, i * kIndexEntry_bytes);
    const auto offset = number_at<std::uint32_t>(data, i * kIndexEntry_bytes + sizeof(ros::Time));
    if (offset >= chunk.data_size) {
      return file_.damaged(index.position, "a chunk's index names a place outside the chunk");
    }
    entries_.push_back({time, *connection, chunk.data_offset + offset});
  }
  return *connection;
}

Result<void> Reader::scan(std::uint64_t position) {
  while (position < file_.size()) {
    const auto record = SIDESTEP_TRY(file_.record(position, file_.size()));
    if (record.op == Op::kConnection) {
      SIDESTEP_TRY(note_connection(record));
    } else if (record.op == Op::kChunk) {
      SIDESTEP_TRY(check_chunk(record));
      SIDESTEP_TRY(scan_chunk(record));
    } else if (record.op != Op::kIndex && record.op != Op::kChunkInfo) {
      return file_.damaged(position, "here should be a chunk");
    }
    position = record.end();
  }
  return {};
}

Result<void> Reader::scan_chunk(const PlacedRecord& chunk) {
  std::uint64_t position = chunk.data_offset;
  const std::uint64_t end = std::min(chunk.end(), file_.size());
  while (position < end) {
    const auto record = SIDESTEP_TRY(file_.record(position, end));
    if (record.op == Op::kConnection) {
      SIDESTEP_TRY(note_connection(record));
    } else {
      const auto connection = record.fields.number<std::uint32_t>("conn");
      const auto time = time_of(record.fields);
      if (record.op != Op::kMessage || !connection || !time ||
          !connections_.contains(*connection)) {
        return file_.damaged(position, "here should be a message");
      }
      entries_.push_back({*time, *connection, position});
    }
    position = record.end();
  }
  if (end == chunk.end()) return {};
  return file_.damaged(end, "the file ends within a chunk");
}

void Reader::select(const std::vector<std::string>& topics) {
  selected_.reset();
  if (topics.empty()) return;
  selected_.emplace();
  for (const auto& [id, connection] : connections_) {
    if (std::ranges::find(topics, connection.topic) != topics.end()) selected_->push_back(id);
  }
}

Result<std::optional<Message>> Reader::next() {
  while (next_ < entries_.size()) {
    const Entry& entry = entries_[next_++];
    if (selected_ && std::ranges::find(*selected_, entry.connection) == selected_->end()) continue;
    const auto record = SIDESTEP_TRY(file_.record(entry.position, file_.size()));
    if (record.op != Op::kMessage ||
        record.fields.number<std::uint32_t>("conn") != entry.connection ||
        time_of(record.fields) != entry.time) {
      return file_.damaged(entry.position, "here is not the message that the index names");
    }
    const auto data = SIDESTEP_TRY(file_.read(record.data_offset, record.data_size));
    return Message{&connections_.at(entry.connection), entry.time, data};
  }
  return std::nullopt;
}

}  // namespace sidestep::bag
