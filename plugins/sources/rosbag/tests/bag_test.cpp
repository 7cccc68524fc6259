// The reader of bags against ROS's own, on bags that ROS's own library wrote.

#include <algorithm>
#include <map>

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <rosbag/view.h>

#include "../bag.hpp"
#include "bag_writing.hpp"

namespace sidestep::rosbag::testing {
namespace {

using ::testing::HasSubstr;
using ::testing::IsEmpty;

/// A message with everything that both readers tell of it.
struct Told {
  std::string topic;
  std::string type;
  std::string md5sum;
  std::int64_t received_ns = 0;
  std::vector<std::uint8_t> bytes;
  friend bool operator==(const Told&, const Told&) = default;
};

void sort_by_time(std::vector<Told>& told) {
  std::ranges::stable_sort(told, {},
                           [](const Told& t) { return std::pair(t.received_ns, t.topic); });
}

std::vector<Told> read_with_ros(const std::filesystem::path& file) {
  ::rosbag::Bag bag(file.string());
  ::rosbag::View view(bag);
  std::vector<Told> all;
  for (const ::rosbag::MessageInstance& message : view) {
    Told told{message.getTopic(), message.getDataType(), message.getMD5Sum(),
              ros_messages::to_stamp(message.getTime()).ns,
              std::vector<std::uint8_t>(message.size())};
    ::ros::serialization::OStream stream(told.bytes.data(), message.size());
    message.write(stream);
    all.push_back(std::move(told));
  }
  sort_by_time(all);
  return all;
}

class EveryMessage final : public BagVisitor {
 public:
  std::size_t wants(const Connection&) override { return kWhole; }
  void message(const Connection& connection, const MessageRef& ref,
               std::span<const std::uint8_t> bytes) override {
    refs.push_back(ref);
    told.push_back({connection.topic,
                    connection.type,
                    connection.md5sum,
                    ref.received.ns,
                    {bytes.begin(), bytes.end()}});
  }
  std::vector<MessageRef> refs;
  std::vector<Told> told;
};

/// Messages of many sizes on many topics, not all in the order of time.
void write_mixed_bag(const std::filesystem::path& file, const BagWriter::Settings& settings) {
  BagWriter bag(file, settings);
  for (int i = 0; i < 60; ++i) {
    const Stamp now = after_s(0.01 * (i % 7 == 0 ? i - 3 : i));
    const std::string suffix = std::to_string(i % 5);
    bag.write("/tf", now, tf_message(Transform::Identity(), now, "map", "frame" + suffix));
    if (i % 3 == 0) bag.write("/image" + suffix, now, flat_image(i, now));
    if (i % 4 == 0) {
      bag.write("/joint_states", now, ros_messages::to_joint_state({}, {}, now));
    }
  }
}

struct Writing {
  const char* name;
  BagWriter::Settings settings;
};

class EveryCompression : public ::testing::TestWithParam<Writing> {};

TEST_P(EveryCompression, GivesWhatRosReads) {
  const testing_support::TemporaryFolder folder;
  const auto file = folder.path() / "mixed.bag";
  write_mixed_bag(file, GetParam().settings);
  auto bag = Bag::open(file);
  ASSERT_TRUE(bag) << bag.error().describe();
  EveryMessage all;
  (*bag)->scan(all);
  EXPECT_THAT((*bag)->damages(), IsEmpty());

  // Again, one by one, in an order that changes the chunk every time.
  for (std::size_t i = 0; i < all.refs.size(); ++i) {
    const std::size_t at = i * 37 % all.refs.size();
    const auto bytes = (*bag)->read(all.refs[at]);
    ASSERT_TRUE(bytes) << bytes.error().describe();
    EXPECT_TRUE(std::ranges::equal(*bytes, all.told[at].bytes));
  }
  sort_by_time(all.told);
  EXPECT_EQ(all.told, read_with_ros(file));
  EXPECT_EQ(all.told.size(), 95U);
}

INSTANTIATE_TEST_SUITE_P(
    Bags, EveryCompression,
    ::testing::Values(Writing{"none", {}}, Writing{"none_small_chunks", {.chunk_bytes = 5000}},
                      Writing{"bz2", {::rosbag::compression::BZ2, 20000}},
                      Writing{"lz4", {::rosbag::compression::LZ4, 20000}},
                      Writing{"lz4_one_chunk", {::rosbag::compression::LZ4, 1U << 30}}),
    [](const auto& tested) { return std::string(tested.param.name); });

class OnlyTf final : public BagVisitor {
 public:
  std::size_t wants(const Connection& connection) override {
    return connection.topic == "/tf" ? 12 : 0;
  }
  void message(const Connection& connection, const MessageRef& ref,
               std::span<const std::uint8_t> bytes) override {
    EXPECT_EQ(connection.topic, "/tf");
    EXPECT_EQ(bytes.size(), 12U);
    EXPECT_GT(ref.size_bytes, 12U);
    ++count;
  }
  int count = 0;
};

TEST(Bags, GiveNoMoreThanIsWanted) {
  const testing_support::TemporaryFolder folder;
  write_mixed_bag(folder.path() / "mixed.bag", {});
  auto bag = Bag::open(folder.path() / "mixed.bag");
  ASSERT_TRUE(bag) << bag.error().describe();
  OnlyTf visitor;
  (*bag)->scan(visitor);
  EXPECT_EQ(visitor.count, 60);
  EXPECT_EQ((*bag)->connections().size(), 7U) << "those of no interest are known, too";
}

TEST(Bags, ThatAreNoneAreRefused) {
  const testing_support::TemporaryFolder folder;
  const auto refusal = [&](const std::string& content) {
    const auto bag = Bag::open(folder.write("file.bag", content));
    EXPECT_FALSE(bag);
    return bag ? Error{} : bag.error();
  };
  EXPECT_EQ(Bag::open(folder.path() / "absent.bag").error().code, ErrorCode::kNotFound);
  EXPECT_EQ(Bag::open(folder.path()).error().code, ErrorCode::kNotFound);
  EXPECT_EQ(refusal("").code, ErrorCode::kIo);
  EXPECT_THAT(refusal("#ROSBAG").message, HasSubstr("at byte 7"));
  EXPECT_EQ(refusal("SQLite format 3, a bag of ROS 2").code, ErrorCode::kUnsupported);
  EXPECT_THAT(refusal("#ROSBAG V1.2\n and more").hint, HasSubstr("rosbag fix"));
  EXPECT_EQ(refusal("#ROSBAG V2.0\n").code, ErrorCode::kIo);
  EXPECT_EQ(refusal("#ROSBAG V2.0\n" + std::string(5000, '\0')).code, ErrorCode::kIo);
}

TEST(Bags, ThatAreEncryptedAreRefused) {
  const testing_support::TemporaryFolder folder;
  write_mixed_bag(folder.path() / "plain.bag", {});
  std::string content = file_content(folder.path() / "plain.bag");
  // A field more in the first header, as the encrypting recorder writes it.
  const std::string field = std::string("\x13\0\0\0", 4) + "encryptor=rosbag/Ae";
  std::uint32_t length = 0;
  std::memcpy(&length, content.data() + 13, 4);
  content.insert(13 + 4 + length, field);
  length += static_cast<std::uint32_t>(field.size());
  std::memcpy(content.data() + 13, &length, 4);
  const auto bag = Bag::open(folder.write("file.bag", content));
  ASSERT_FALSE(bag);
  EXPECT_EQ(bag.error().code, ErrorCode::kUnsupported);
  EXPECT_THAT(bag.error().message, HasSubstr("rosbag/Ae"));
}

}  // namespace
}  // namespace sidestep::rosbag::testing
