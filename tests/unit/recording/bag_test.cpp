#include <set>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "bag_by_hand.hpp"
#include "bag_reader.hpp"
#include "bag_writer.hpp"
#include "file_limit.hpp"
#include "support/temporary_folder.hpp"

namespace sidestep::testing {
namespace {

namespace fs = std::filesystem;
using ::testing::HasSubstr;

std::span<const std::byte> as_message(const std::string& text) {
  return std::as_bytes(std::span(text));
}
std::string as_text(std::span<const std::byte> bytes) {
  return {reinterpret_cast<const char*>(bytes.data()), bytes.size()};
}

class BagTest : public ::testing::Test {
 protected:
  struct Written {
    std::string topic, message;
    ros::Time time;
  };

  /// Messages of three topics, whose times go to and fro, in chunks of about 1 KB.
  std::vector<Written> write_some(bag::Writer& writer, int count = 200) {
    const char* const topics[] = {"/a", "/b", "/c"};
    std::vector<std::uint32_t> connections;
    connections.push_back(writer.add_connection(topics[0], ros::type_of<ros::String>()));
    connections.push_back(writer.add_connection(topics[1], ros::type_of<ros::Image>(), true));
    std::vector<Written> written;
    for (int i = 0; i < count; ++i) {
      if (i == count / 2) {
        connections.push_back(writer.add_connection(topics[2], ros::type_of<ros::String>()));
      }
      const std::size_t which = static_cast<std::size_t>(i * i) % connections.size();
      const auto time_ms = static_cast<std::uint32_t>(1000 + 10 * i + 37 * (i * 7 % 11));
      const ros::Time time{time_ms / 1000, time_ms % 1000 * 1'000'000};
      written.push_back(
          {topics[which], "message " + std::to_string(i) + std::string(i % 90, '.'), time});
      EXPECT_TRUE(writer.write(connections[which], time, as_message(written.back().message)));
    }
    return written;
  }
  /// All that a bag holds, in the reader's order.
  static std::vector<Written> read_all(bag::Reader& reader) {
    std::vector<Written> read;
    for (;;) {
      const auto message = reader.next();
      if (!message) {
        ADD_FAILURE() << message.error().describe();
        return read;
      }
      if (!*message) return read;
      read.push_back({(*message)->connection->topic, as_text((*message)->data), (*message)->time});
    }
  }
  static std::vector<Written> in_order(std::vector<Written> all) {
    std::ranges::stable_sort(all, {}, &Written::time);
    return all;
  }
  static void expect_same(const std::vector<Written>& a, const std::vector<Written>& b) {
    ASSERT_EQ(a.size(), b.size());
    for (std::size_t i = 0; i < a.size(); ++i) {
      EXPECT_EQ(a[i].topic, b[i].topic) << i;
      EXPECT_EQ(a[i].message, b[i].message) << i;
      EXPECT_EQ(a[i].time, b[i].time) << i;
    }
  }

  [[nodiscard]] fs::path file(const std::string& name = "a.bag") const {
    return folder_.path() / name;
  }

  testing_support::TemporaryFolder folder_;
};

TEST_F(BagTest, ReadsInTheOrderOfTimeWhatItWrote) {
  auto writer = bag::Writer::create(file(), 1000);
  ASSERT_TRUE(writer) << writer.error().describe();
  const auto written = in_order(write_some(*writer));
  ASSERT_TRUE(writer->close());
  auto reader = bag::Reader::open(file());
  ASSERT_TRUE(reader) << reader.error().describe();
  EXPECT_TRUE(reader->is_indexed());
  EXPECT_FALSE(reader->damage());
  EXPECT_EQ(reader->message_count(), written.size());
  expect_same(read_all(*reader), written);
  const bag::Connection& b = reader->connections().at(1);
  EXPECT_EQ(b.type, "sensor_msgs/Image");
  EXPECT_EQ(b.md5sum, ros::type_of<ros::Image>().md5sum);
  EXPECT_EQ(b.definition, ros::type_of<ros::Image>().definition);
  EXPECT_TRUE(b.latching);
  EXPECT_FALSE(reader->connections().at(0).latching);
}

TEST_F(BagTest, Selects) {
  auto writer = bag::Writer::create(file(), 1000);
  ASSERT_TRUE(writer);
  auto written = in_order(write_some(*writer));
  ASSERT_TRUE(writer->close());
  auto reader = bag::Reader::open(file());
  ASSERT_TRUE(reader);
  std::erase_if(written, [&](const Written& one) { return one.topic != "/a"; });
  ASSERT_GT(written.size(), 10U);
  reader->select({"/a"});
  expect_same(read_all(*reader), written);
  auto again = bag::Reader::open(file());
  ASSERT_TRUE(again);
  again->select({"/none"});
  EXPECT_TRUE(read_all(*again).empty());
}

// The layout, record by record, found by walking through the bytes.
TEST_F(BagTest, SaysInItsIndexWhatItsBytesAre) {
  auto writer = bag::Writer::create(file(), 1000);
  ASSERT_TRUE(writer);
  const auto written = write_some(*writer);
  ASSERT_TRUE(writer->close());
  const std::string bytes = bytes_of_file(file());
  ASSERT_EQ(bytes.substr(0, 13), "#ROSBAG V2.0\n");
  const auto records = plain_records(bytes, 13);
  const PlainRecord& head = records.front();
  EXPECT_EQ(head.op(), 3);
  EXPECT_EQ(head.end, 13U + 8U + 4096U);

  struct Chunk {
    std::map<std::uint64_t, std::multiset<std::pair<std::string, std::uint64_t>>> by_connection;
    std::string first, last;  // Times, most significant byte first.
  };
  const auto sortable = [](std::string time) {
    std::string seconds = time.substr(0, 4), rest = time.substr(4);
    return std::string(seconds.rbegin(), seconds.rend()) + std::string(rest.rbegin(), rest.rend());
  };
  std::map<std::uint64_t, Chunk> chunks;  // By place.
  std::set<std::uint64_t> said_in_chunks, said_in_index;
  Chunk* chunk = nullptr;
  std::size_t messages = 0, infos = 0;
  for (std::size_t i = 1; i < records.size(); ++i) {
    const PlainRecord& record = records[i];
    const bool is_in_index = record.begin >= head.number("index_pos");
    switch (record.op()) {
      case 5: {
        EXPECT_FALSE(is_in_index);
        EXPECT_EQ(record.fields.at("compression"), "none");
        EXPECT_EQ(record.number("size"), record.data.size());
        chunk = &chunks[record.begin];
        for (const PlainRecord& inner : plain_records(record.data, 0)) {
          if (inner.op() == 7) {
            said_in_chunks.insert(inner.number("conn"));
            continue;
          }
          ASSERT_EQ(inner.op(), 2);
          EXPECT_TRUE(said_in_chunks.contains(inner.number("conn")));
          EXPECT_EQ(inner.data, written[messages++].message);
          const std::string time = sortable(inner.fields.at("time"));
          chunk->by_connection[inner.number("conn")].insert({time, inner.begin});
          if (chunk->first.empty() || time < chunk->first) chunk->first = time;
          if (time > chunk->last) chunk->last = time;
        }
        break;
      }
      case 4: {
        ASSERT_NE(chunk, nullptr);
        EXPECT_EQ(record.number("ver"), 1U);
        const auto& expected = chunk->by_connection.at(record.number("conn"));
        ASSERT_EQ(record.number("count"), expected.size());
        ASSERT_EQ(record.data.size(), 12 * expected.size());
        std::multiset<std::pair<std::string, std::uint64_t>> said;
        std::string before;
        for (std::size_t at = 0; at < record.data.size(); at += 12) {
          const std::string time = sortable(record.data.substr(at, 8));
          EXPECT_LE(before, time);
          before = time;
          said.insert({time, PlainRecord::little_endian(record.data.substr(at + 8, 4))});
        }
        EXPECT_EQ(said, expected);
        break;
      }
      case 7:
        EXPECT_TRUE(is_in_index);
        said_in_index.insert(record.number("conn"));
        EXPECT_EQ(plain_fields(record.data).at("topic"), record.fields.at("topic"));
        break;
      case 6: {
        ++infos;
        EXPECT_TRUE(is_in_index);
        const Chunk& of = chunks.at(record.number("chunk_pos"));
        EXPECT_EQ(sortable(record.fields.at("start_time")), of.first);
        EXPECT_EQ(sortable(record.fields.at("end_time")), of.last);
        ASSERT_EQ(record.number("count"), of.by_connection.size());
        for (std::size_t at = 0; at < record.data.size(); at += 8) {
          const auto& expected =
              of.by_connection.at(PlainRecord::little_endian(record.data.substr(at, 4)));
          EXPECT_EQ(PlainRecord::little_endian(record.data.substr(at + 4, 4)), expected.size());
        }
        break;
      }
      default: FAIL() << "record of kind " << record.op();
    }
  }
  EXPECT_EQ(messages, written.size());
  EXPECT_GT(chunks.size(), 5U);
  EXPECT_EQ(infos, chunks.size());
  EXPECT_EQ(head.number("chunk_count"), chunks.size());
  EXPECT_EQ(head.number("conn_count"), 3U);
  EXPECT_EQ(said_in_index, said_in_chunks);
}

TEST_F(BagTest, WithoutAnIndexReadsAllThatWasFlushed) {
  auto writer = bag::Writer::create(file());
  ASSERT_TRUE(writer);
  const auto flushed = in_order(write_some(*writer));
  ASSERT_TRUE(writer->flush());
  // What a process that is killed leaves behind.
  fs::copy_file(file(), file("killed.bag"));
  auto reader = bag::Reader::open(file("killed.bag"));
  ASSERT_TRUE(reader) << reader.error().describe();
  EXPECT_FALSE(reader->is_indexed());
  EXPECT_FALSE(reader->damage());
  expect_same(read_all(*reader), flushed);
}

TEST_F(BagTest, AnEmptyBagIsABag) {
  {
    auto writer = bag::Writer::create(file());
    ASSERT_TRUE(writer);
  }
  auto reader = bag::Reader::open(file());
  ASSERT_TRUE(reader) << reader.error().describe();
  EXPECT_EQ(reader->message_count(), 0U);
  EXPECT_FALSE(reader->damage());
}

TEST_F(BagTest, LeavesAFileThatExistsAlone) {
  folder_.write("a.bag", "precious");
  const auto writer = bag::Writer::create(file());
  ASSERT_FALSE(writer);
  EXPECT_EQ(writer.error().code, ErrorCode::kInvalidArgument);
  EXPECT_THAT(writer.error().describe(), HasSubstr(file().string() + ": the file exists"));
  EXPECT_EQ(bytes_of_file(file()), "precious");
}

TEST_F(BagTest, SaysWhyAFileCannotBeMade) {
  const auto writer = bag::Writer::create(file("no_folder/a.bag"));
  ASSERT_FALSE(writer);
  EXPECT_EQ(writer.error().code, ErrorCode::kIo);
  EXPECT_THAT(writer.error().describe(), HasSubstr("no_folder/a.bag"));
  EXPECT_THAT(writer.error().describe(), HasSubstr("No such file or directory"));
}

TEST_F(BagTest, WhereNoMoreCanBeWrittenSaysSoAndKeepsWhatIsThere) {
  constexpr std::size_t kChunk_bytes = 16 * 1024, kLimit_bytes = 100'000;
  const std::string message(1000, 'x');
  auto writer = bag::Writer::create(file(), kChunk_bytes);
  ASSERT_TRUE(writer);
  const std::uint32_t connection = writer->add_connection("/a", ros::type_of<ros::String>());
  std::uint32_t count = 0;
  {
    const FileLimit limit(kLimit_bytes);
    Result<void> written;
    while (written && count < 1000) {
      written = writer->write(connection, {1 + count++, 0}, as_message(message));
    }
    ASSERT_FALSE(written);
    EXPECT_EQ(written.error().code, ErrorCode::kIo);
    EXPECT_THAT(written.error().describe(), HasSubstr(file().string()));
    EXPECT_THAT(written.error().describe(), HasSubstr("File too large"));
    EXPECT_TRUE(writer->close()) << "there is room for the index";
  }
  EXPECT_LE(fs::file_size(file()), kLimit_bytes);
  auto reader = bag::Reader::open(file());
  ASSERT_TRUE(reader) << reader.error().describe();
  EXPECT_TRUE(reader->is_indexed());
  EXPECT_FALSE(reader->damage());
  // All but the last chunk, which did not fit.
  EXPECT_GE(reader->message_count() * message.size() + 2 * kChunk_bytes + 5000, kLimit_bytes);
  EXPECT_EQ(read_all(*reader).size(), reader->message_count());
}

TEST_F(BagTest, OtherFilesAreNoBags) {
  const auto error_of = [&](const std::string& name) {
    const auto reader = bag::Reader::open(file(name));
    return reader ? std::string() : reader.error().describe();
  };
  EXPECT_THAT(error_of("none.bag"), HasSubstr("there is no such file"));
  EXPECT_THAT(error_of("."), HasSubstr("this is no file"));
  folder_.write("empty.bag", "");
  EXPECT_THAT(error_of("empty.bag"), HasSubstr("this is no ROS bag of format 2.0"));
  folder_.write("old.bag", "#ROSBAG V1.2\n" + std::string(5000, '\0'));
  EXPECT_THAT(error_of("old.bag"), HasSubstr("this is no ROS bag of format 2.0"));
  folder_.write("short.bag", "#ROSBAG V2.0\n");
  EXPECT_THAT(error_of("short.bag"), HasSubstr("damaged at byte 13"));
}

TEST_F(BagTest, CompressedChunksAreRefusedWithAWayOut) {
  {
    auto writer = bag::Writer::create(file());
    ASSERT_TRUE(writer);
    write_some(*writer);
  }
  std::string bytes = bytes_of_file(file());
  const std::string plain = "compression=none", packed = "compression=bz2";
  // The field and the header become a byte shorter, the record's data a byte longer in front.
  const std::size_t at = bytes.find(plain);
  const PlainRecord chunk = plain_record(bytes, 13 + 8 + 4096);
  ASSERT_EQ(chunk.op(), 5);
  bytes.replace(at, plain.size(), packed);
  --bytes[at - 4];
  --bytes[chunk.begin];
  folder_.write("packed.bag", bytes);
  const auto reader = bag::Reader::open(file("packed.bag"));
  ASSERT_FALSE(reader);
  EXPECT_EQ(reader.error().code, ErrorCode::kUnsupported);
  EXPECT_THAT(reader.error().describe(), HasSubstr("rosbag decompress"));
}

}  // namespace
}  // namespace sidestep::testing
