#include <random>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "bag_by_hand.hpp"
#include "bag_reader.hpp"
#include "bag_writer.hpp"
#include "support/temporary_folder.hpp"

namespace sidestep::testing {
namespace {

/// A small bag of several chunks, and what it holds in the order in which that was written.
class BagDamageTest : public ::testing::Test {
 protected:
  BagDamageTest() {
    auto writer = bag::Writer::create(folder_.path() / "whole.bag", 400);
    const std::uint32_t a = writer->add_connection("/a", ros::type_of<ros::String>());
    const std::uint32_t b = writer->add_connection("/b", ros::type_of<ros::UInt8MultiArray>());
    for (std::uint32_t i = 0; i < 60; ++i) {
      messages_.push_back(std::to_string(i) + std::string(i % 40, 'm'));
      const auto bytes = std::as_bytes(std::span(messages_.back()));
      EXPECT_TRUE(writer->write(i % 3 == 0 ? a : b, {1 + i, 7 * i}, bytes));
    }
    EXPECT_TRUE(writer->close());
    bytes_ = bytes_of_file(folder_.path() / "whole.bag");
    for (const PlainRecord& record : plain_records(bytes_, 13)) {
      if (record.op() != 5) continue;
      for (const PlainRecord& inner : plain_records(record.data, 0)) {
        if (inner.op() != 2) continue;
        message_begins_.push_back(record.data_begin + inner.begin);
        message_ends_.push_back(record.data_begin + inner.end);
      }
    }
  }

  struct Outcome {
    bool is_open = false;
    std::vector<std::string> messages;
    std::vector<std::string> errors;
  };
  /// Reads a damaged bag to its end; what matters is that there is one.
  Outcome read(const std::string& bytes) {
    return read_file(folder_.write("damaged.bag", bytes), bytes.size());
  }
  static Outcome read_file(const std::filesystem::path& file, std::size_t size) {
    Outcome outcome;
    auto reader = bag::Reader::open(file);
    if (!reader) {
      outcome.errors.push_back(reader.error().describe());
      return outcome;
    }
    outcome.is_open = true;
    if (reader->damage()) outcome.errors.push_back(reader->damage()->describe());
    // Each call takes one message at least from a list that is no longer than the file.
    for (std::size_t calls = 0; calls <= size; ++calls) {
      const auto message = reader->next();
      if (!message) {
        outcome.errors.push_back(message.error().describe());
      } else if (!*message) {
        return outcome;
      } else {
        const auto data = (*message)->data;
        outcome.messages.emplace_back(reinterpret_cast<const char*>(data.data()), data.size());
      }
    }
    ADD_FAILURE() << "the reader does not come to an end";
    return outcome;
  }

  testing_support::TemporaryFolder folder_;
  std::vector<std::string> messages_;
  std::string bytes_;
  std::vector<std::size_t> message_begins_, message_ends_;  ///< In the file.
};

TEST_F(BagDamageTest, CutOffAnywhereGivesEveryMessageThatIsWhole) {
  ASSERT_EQ(message_ends_.size(), messages_.size());
  const auto file = folder_.write("damaged.bag", bytes_);
  for (std::size_t size = bytes_.size(); size-- > 0;) {
    std::filesystem::resize_file(file, size);
    const Outcome outcome = read_file(file, size);
    EXPECT_FALSE(outcome.errors.empty()) << size;
    const auto whole = static_cast<std::size_t>(
        std::ranges::count_if(message_ends_, [&](std::size_t end) { return end <= size; }));
    ASSERT_EQ(outcome.messages.size(), whole) << "cut off at " << size;
    for (std::size_t i = 0; i < whole; ++i) EXPECT_EQ(outcome.messages[i], messages_[i]);
    if (!outcome.is_open || size < message_ends_.front()) continue;
    EXPECT_THAT(outcome.errors.front(), ::testing::HasSubstr("damaged at byte ")) << size;
  }
}

TEST_F(BagDamageTest, TheErrorNamesTheByteWhereItBroke) {
  // In the middle of the tenth message.
  const Outcome outcome = read(bytes_.substr(0, message_ends_[9] - 1));
  ASSERT_EQ(outcome.errors.size(), 1U);
  EXPECT_EQ(outcome.messages.size(), 9U);
  EXPECT_THAT(outcome.errors[0],
              ::testing::HasSubstr("damaged at byte " + std::to_string(message_begins_[9])));
}

TEST_F(BagDamageTest, FlippedBytesNeverLeadAstray) {
  std::mt19937 random(7);
  const auto any = [&](std::size_t below) { return random() % below; };
  std::size_t with_errors = 0;
  constexpr std::size_t kTries = 2000;
  for (std::size_t i = 0; i < kTries; ++i) {
    std::string bytes = bytes_;
    for (std::size_t flips = 1 + any(4); flips > 0; --flips) {
      // Every second one past the padding of the first record, where there is more to break.
      const std::size_t at = any(2) == 0 ? any(bytes.size()) : 4117 + any(bytes.size() - 4117);
      // The largest and smallest values are those that lengths go wrong with.
      const int choice = static_cast<int>(any(3));
      bytes[at] = choice == 0 ? '\xff' : choice == 1 ? '\0' : static_cast<char>(random());
    }
    if (any(4) == 0) bytes.resize(any(bytes.size()));
    const Outcome outcome = read(bytes);
    with_errors += outcome.errors.empty() ? 0 : 1;
    EXPECT_LE(outcome.messages.size(), bytes.size() / 46) << "more messages than there is room for";
  }
  EXPECT_GT(with_errors, kTries / 4) << "hardly anything was damaged";
}

TEST_F(BagDamageTest, ADamagedIndexIsDoneWithout) {
  std::string bytes = bytes_;
  const std::size_t index = plain_record(bytes, 13).number("index_pos");
  bytes[index + 5] = '\xff';
  const Outcome outcome = read(bytes);
  // All messages are before it.
  EXPECT_EQ(outcome.messages, messages_);
  ASSERT_EQ(outcome.errors.size(), 1U);
  EXPECT_THAT(outcome.errors[0], ::testing::HasSubstr("damaged at byte " + std::to_string(index)));
}

TEST_F(BagDamageTest, AMessageThatIsNotWhatTheIndexSaysCostsNoOther) {
  std::string bytes = bytes_;
  const std::size_t begin = message_begins_[20];
  ASSERT_EQ(bytes.substr(begin + 8, 3), "op=");
  bytes[begin + 11] = '\x07';
  const Outcome outcome = read(bytes);
  auto others = messages_;
  others.erase(others.begin() + 20);
  EXPECT_EQ(outcome.messages, others);
  ASSERT_EQ(outcome.errors.size(), 1U);
  EXPECT_THAT(outcome.errors[0], ::testing::HasSubstr("byte " + std::to_string(begin)));
}

// One chunk named again and again by the index would, read on trust, take memory without bounds.
TEST_F(BagDamageTest, AnIndexThatRepeatsAChunkIsNotBelieved) {
  const PlainRecord head = plain_record(bytes_, 13);
  std::string info;
  for (const PlainRecord& record : plain_records(bytes_, head.number("index_pos"))) {
    if (record.op() == 6) info = bytes_.substr(record.begin, record.end - record.begin);
  }
  std::string bytes = bytes_;
  constexpr int kTimes = 5000;
  for (int i = 0; i < kTimes; ++i) bytes += info;
  const auto chunks = static_cast<std::uint32_t>(head.number("chunk_count") + kTimes);
  std::memcpy(bytes.data() + bytes.find("chunk_count=") + 12, &chunks, sizeof chunks);
  const Outcome outcome = read(bytes);
  EXPECT_LE(outcome.messages.size(), bytes.size() / 46);
}

}  // namespace
}  // namespace sidestep::testing
