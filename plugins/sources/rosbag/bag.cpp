#include "bag.hpp"

#include <bzlib.h>
#include <lz4frame.h>

#include <algorithm>
#include <set>
#include <utility>

#include "bag_record.hpp"

namespace sidestep::rosbag {
namespace {

constexpr std::size_t kStep = std::size_t{1} << 18;

/// Room for more output behind what is there; none once there are `most` bytes.
std::span<std::uint8_t> more_room(std::vector<std::uint8_t>& bytes, std::size_t used,
                                  std::uint64_t most) {
  const auto room = static_cast<std::size_t>(
      std::min<std::uint64_t>(most - std::min<std::uint64_t>(most, used), kStep));
  bytes.resize(used + room);
  return {bytes.data() + used, room};
}

ChunkData decompress_bz2(std::span<const std::uint8_t> stored, std::uint64_t most) {
  ChunkData data;
  bz_stream stream{};
  if (BZ2_bzDecompressInit(&stream, 0, 0) != BZ_OK) return {{}, "bz2 has no memory"};
  const std::unique_ptr<bz_stream, int (*)(bz_stream*)> guard(&stream, &BZ2_bzDecompressEnd);
  // The library reads from what it takes as not const.
  stream.next_in = const_cast<char*>(reinterpret_cast<const char*>(stored.data()));
  stream.avail_in = static_cast<unsigned>(stored.size());
  std::size_t used = 0;
  while (data.damage.empty()) {
    const auto room = more_room(data.bytes, used, most);
    stream.next_out = reinterpret_cast<char*>(room.data());
    stream.avail_out = static_cast<unsigned>(room.size());
    const int code = BZ2_bzDecompress(&stream);
    used += room.size() - stream.avail_out;
    if (code == BZ_STREAM_END) break;
    if (code != BZ_OK) {
      data.damage = "its bz2 data are damaged";
    } else if (room.empty()) {
      data.damage = "its bz2 data are longer than it says";
    } else if (stream.avail_in == 0 && stream.avail_out > 0) {
      data.damage = "its bz2 data are cut off";
    }
  }
  data.bytes.resize(used);
  return data;
}

ChunkData decompress_lz4(std::span<const std::uint8_t> stored, std::uint64_t most) {
  ChunkData data;
  LZ4F_dctx* context = nullptr;
  if (LZ4F_isError(LZ4F_createDecompressionContext(&context, LZ4F_VERSION)) != 0U) {
    return {{}, "lz4 has no memory"};
  }
  const std::unique_ptr<LZ4F_dctx, decltype(&LZ4F_freeDecompressionContext)> guard(
      context, &LZ4F_freeDecompressionContext);
  std::size_t used = 0;
  while (data.damage.empty()) {
    const auto room = more_room(data.bytes, used, most);
    std::size_t written = room.size();
    std::size_t taken = stored.size();
    const std::size_t code =
        LZ4F_decompress(context, room.data(), &written, stored.data(), &taken, nullptr);
    stored = stored.subspan(std::min(taken, stored.size()));
    if (LZ4F_isError(code) != 0U) {
      data.damage = "its lz4 data are damaged";
      break;
    }
    used += written;
    if (code == 0) break;
    if (taken == 0 && written == 0) {
      data.damage =
          room.empty() ? "its lz4 data are longer than it says" : "its lz4 data are cut off";
    }
  }
  data.bytes.resize(used);
  return data;
}

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

using bag::ByteSource;
using bag::Fields;
using bag::MemoryBytes;
using bag::Op;
using bag::read_record;
using bag::Record;

/// For a chunk that was never finished, whose header does not say yet how long it is.
constexpr std::uint64_t kMostUnfinished = std::uint64_t{1} << 30;

std::string text_of(const std::optional<std::string_view>& field) {
  return std::string(field.value_or(""));
}

}  // namespace

std::optional<Compression> compression_of(std::string_view name) {
  if (name == "none") return Compression::kNone;
  if (name == "bz2") return Compression::kBz2;
  if (name == "lz4") return Compression::kLz4;
  return std::nullopt;
}

ChunkData decompress(Compression compression, std::span<const std::uint8_t> stored,
                     std::uint64_t most) {
  switch (compression) {
    case Compression::kNone: return {{stored.begin(), stored.end()}, {}};
    case Compression::kBz2: return decompress_bz2(stored, most);
    case Compression::kLz4: return decompress_lz4(stored, most);
  }
  return {};
}

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

/// One pass over a bag.
class BagScan {
 public:
  BagScan(Bag& bag, BagVisitor& visitor)
      : bag_(bag), file_(*bag.bytes_), end_(bag.bytes_->size()), visitor_(visitor) {}

  void run() {
    read_connections_of_index();
    std::uint64_t at = bag_.first_record_;
    while (at < end_) {
      const auto record = read_record(file_, at, end_);
      if (!record) return damage(at, record.error());
      if (record->op == Op::kChunk) {
        if (!scan_chunk(*record, at)) return;
      } else if (record->end() > end_) {
        return damage(at, "it is cut off in a record's data");
      } else if (const std::string wrong = take(*record, file_, -1); !wrong.empty()) {
        return damage(at, wrong);
      }
      at = unfinished_end_.value_or(record->end());
    }
    check_ending();
  }

 private:
  /// Connections stand in the chunk of their first message and, again, at the end of the bag: with
  /// these, a damaged first chunk costs no later messages.
  void read_connections_of_index() {
    if (bag_.index_offset_ < bag_.first_record_) return;
    for (std::uint64_t at = bag_.index_offset_; at < end_;) {
      const auto record = read_record(file_, at, end_);
      if (!record || record->end() > end_) return;
      if (record->op == Op::kConnection && !add_connection(*record, file_)) return;
      at = record->end();
    }
  }

  /// False where nothing behind the chunk can be read.
  bool scan_chunk(const Record& chunk, std::uint64_t at) {
    const auto compression = compression_of(text_of(chunk.fields.find("compression")));
    if (!compression) {
      damage(at, "a chunk's compression is unknown");
      return chunk.end() <= end_;
    }
    // A recorder fills in both sizes when it finishes the chunk.
    const bool is_unfinished = chunk.data_size == 0 &&
                               chunk.fields.number<std::uint32_t>("size") == 0U &&
                               bag_.index_offset_ == 0 && chunk.end() < end_;
    const bool is_cut_off = chunk.end() > end_;
    const std::uint64_t end = is_unfinished || is_cut_off ? end_ : chunk.end();
    if (*compression == Compression::kNone) {
      scan_records(file_, chunk.data_offset, end, -1);
      if (is_unfinished) unfinished_end_ = end_;
    } else {
      const std::uint64_t said = chunk.fields.number<std::uint32_t>("size").value_or(0);
      scan_compressed({chunk.data_offset, end - chunk.data_offset,
                       is_unfinished ? kMostUnfinished : said, *compression},
                      at);
    }
    if (is_cut_off && !chunk_was_damaged_) damage(end_, "it is cut off in a chunk");
    return !is_cut_off && !(is_unfinished && *compression != Compression::kNone);
  }

  void scan_compressed(const Bag::StoredChunk& chunk, std::uint64_t at) {
    const auto number = static_cast<std::int32_t>(bag_.chunks_.size());
    bag_.chunks_.push_back(chunk);
    std::string wrong = bag_.load(number);
    const bool is_short = bag_.chunk_bytes_.size() < chunk.most_bytes;
    if (wrong.empty() && is_short && chunk.most_bytes != kMostUnfinished) {
      wrong = "its data are shorter than it says";
    }
    chunk_was_damaged_ = false;
    if (bag_.loaded_ == number) {
      const MemoryBytes bytes(bag_.chunk_bytes_);
      in_chunk_at_ = at;
      scan_records(bytes, 0, bytes.size(), number, wrong.empty());
      in_chunk_at_.reset();
    }
    if (!wrong.empty()) damage(at, "a chunk is damaged: " + wrong);
  }

  /// The records of a chunk, up to where they cannot be read; tells of that if `tells`.
  void scan_records(const ByteSource& bytes, std::uint64_t from, std::uint64_t to,
                    std::int32_t chunk, bool tells = true) {
    chunk_was_damaged_ = false;
    for (std::uint64_t at = from; at < to;) {
      const auto record = read_record(bytes, at, to);
      std::string wrong = record ? "" : record.error();
      if (record && record->end() > to) wrong = "it is cut off in a record's data";
      if (record && wrong.empty()) wrong = take(*record, bytes, chunk);
      if (!wrong.empty()) {
        if (tells) damage(at, wrong);
        return;
      }
      at = record->end();
    }
  }

  /// A record that is no chunk, whole; what is wrong with it.
  std::string take(const Record& record, const ByteSource& bytes, std::int32_t chunk) {
    switch (record.op) {
      case Op::kConnection:
        return add_connection(record, bytes) ? "" : "a connection's record is damaged";
      case Op::kMessage: return take_message(record, bytes, chunk);
      case Op::kChunkInfo: ++chunk_infos_; return "";
      case Op::kIndex: return take_index(record);
      case Op::kFile: return "";
      case Op::kChunk: return "a chunk lies in a chunk";
    }
    return "there is no record";
  }

  /// The messages that a chunk should have had, for check_ending().
  std::string take_index(const Record& record) {
    const auto number = record.fields.number<std::uint32_t>("conn");
    const auto count = record.fields.number<std::uint32_t>("count");
    if (!number || !count) return "a chunk's index is damaged";
    indexed_[*number] += *count;
    return "";
  }

  bool add_connection(const Record& record, const ByteSource& bytes) {
    const auto number = record.fields.number<std::uint32_t>("conn");
    const auto topic = record.fields.find("topic");
    if (!number || !topic) return false;
    // Its data are fields, as a header's.
    std::string data(record.data_size, '\0');
    if (!bytes.read(record.data_offset,
                    {reinterpret_cast<std::uint8_t*>(data.data()), data.size()})) {
      return false;
    }
    const auto fields = Fields::parse(std::move(data));
    if (!fields) return false;
    const bool is_in_index = &bytes == &file_ && record.data_offset >= bag_.index_offset_;
    if (is_in_index) last_connections_.insert(*number);
    const Connection told{std::string(*topic), text_of(fields->find("type")),
                          text_of(fields->find("md5sum"))};
    const auto [known, is_new] = bag_.connections_.try_emplace(*number, told);
    return is_new || known->second == told;
  }

  std::string take_message(const Record& record, const ByteSource& bytes, std::int32_t chunk) {
    const auto number = record.fields.number<std::uint32_t>("conn");
    const auto received = record.fields.time("time");
    if (!number || !received) return "a message's record is damaged";
    last_ = *received;
    ++bag_.message_counts_[*number];
    const auto connection = bag_.connections_.find(*number);
    if (connection == bag_.connections_.end()) return "a message belongs to no topic";
    auto wanted = wanted_.find(*number);
    if (wanted == wanted_.end()) {
      wanted = wanted_.emplace(*number, visitor_.wants(connection->second)).first;
    }
    if (wanted->second == 0) return "";
    const std::size_t count = std::min<std::size_t>(wanted->second, record.data_size);
    message_.resize(count);
    if (!bytes.read(record.data_offset, message_)) return "the file cannot be read";
    visitor_.message(connection->second,
                     MessageRef{*received, record.data_offset, record.data_size, chunk}, message_);
    return "";
  }

  /// A file that ends between two records may have ended too early all the same.
  void check_ending() {
    if (bag_.index_offset_ == 0) {
      if (!bag_.damages_.empty()) return;
      damage(end_, "it was never closed: what came later, if anything, is not in it");
    } else if (bag_.index_offset_ > end_) {
      damage(end_, "it is cut off before its index");
    } else if (last_connections_.size() < bag_.connection_count_ ||
               chunk_infos_ < bag_.chunk_count_) {
      damage(end_, "it is cut off in its index; the messages are all there");
    } else if (bag_.damages_.empty()) {
      check_counts();
    }
  }

  void check_counts() {
    for (const auto& [number, connection] : bag_.connections_) {
      const std::uint64_t found = bag_.message_count(number);
      if (found >= indexed_[number]) continue;
      damage(end_, "its chunks should hold " + std::to_string(indexed_[number]) + " messages on " +
                       connection.topic + ", and hold " + std::to_string(found));
    }
  }

  void damage(std::uint64_t at, std::string what) {
    chunk_was_damaged_ = true;
    if (in_chunk_at_) {
      what += " (byte " + std::to_string(at) + " of what the chunk holds)";
      at = *in_chunk_at_;
    }
    bag_.damages_.push_back({at, std::move(what), last_});
  }

  Bag& bag_;
  const ByteSource& file_;
  std::uint64_t end_;
  BagVisitor& visitor_;
  std::map<std::uint32_t, std::size_t> wanted_;  ///< By connection.
  std::vector<std::uint8_t> message_;
  std::set<std::uint32_t> last_connections_;        ///< Met in the index.
  std::map<std::uint32_t, std::uint64_t> indexed_;  ///< Messages by connection, as chunks say.
  std::uint32_t chunk_infos_ = 0;
  std::optional<Stamp> last_;
  std::optional<std::uint64_t> in_chunk_at_;  ///< While a decompressed chunk is scanned.
  std::optional<std::uint64_t> unfinished_end_;
  bool chunk_was_damaged_ = false;
};

void Bag::scan(BagVisitor& visitor) {
  connections_.clear();
  message_counts_.clear();
  chunks_.clear();
  damages_.clear();
  loaded_ = -1;
  BagScan(*this, visitor).run();
}

}  // namespace sidestep::rosbag
