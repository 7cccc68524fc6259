#include <algorithm>

#include <gtest/gtest.h>
#include <nlohmann/json.hpp>

#include "bag_writer.hpp"
#include "conformance/test_host.hpp"
#include "recorded_view.hpp"
#include "run_bag.hpp"
#include "run_recorder.hpp"
#include "support/chain_robot.hpp"
#include "support/temporary_folder.hpp"

namespace sidestep::testing {
namespace {

using Json = nlohmann::json;

constexpr double kEpisode_s = 2.0;

class RecordedViewTest : public ::testing::Test {
 protected:
  /// Two episodes of a robot that is stepped 250 times a second, on a clock that takes no time.
  void record() {
    conformance::RecordingLog log;
    auto recorder = RunRecorder::start(file_, log);
    ASSERT_TRUE(recorder) << recorder.error().describe();
    for (int episode = 0; episode < 2; ++episode) {
      (*recorder)->begin({"title", episode, testing_support::flying_ball(0.2), nullptr,
                          Eigen::Vector3d::Zero(), Eigen::Vector3d::Ones()});
      for (int i = 0; i < static_cast<int>(250 * kEpisode_s); ++i) {
        ObservedStep step;
        step.stamp = Stamp::from_seconds(0.004 * i);
        step.q = Eigen::Vector3d(0.001 * i, 0.0, 0.0);
        (*recorder)->stepped(step);
      }
      (*recorder)->end({Stamp::from_seconds(kEpisode_s), true, "there"});
    }
    (*recorder)->finish();
  }

  std::vector<ViewMessage> read() {
    std::vector<ViewMessage> messages;
    const auto recording = open_recording(file_);
    EXPECT_TRUE(recording) << recording.error().describe();
    while (recording) {
      auto next = (*recording)->next();
      EXPECT_TRUE(next) << next.error().describe();
      if (!next || !*next) break;
      messages.push_back(std::move(**next));
    }
    return messages;
  }

  testing_support::TemporaryFolder folder_;
  std::filesystem::path file_ = folder_.path() / "run.bag";
};

TEST_F(RecordedViewTest, ShowsARunByItsOwnClock) {
  record();
  const auto messages = read();
  const auto count = [&](ViewKind kind) {
    return std::ranges::count(messages, kind, &ViewMessage::kind);
  };
  EXPECT_EQ(count(ViewKind::kWorld), 2);
  EXPECT_EQ(count(ViewKind::kEnd), 2);
  // 30 Hz at most, and no fewer than 25, for the steps come by fours of milliseconds.
  EXPECT_GE(count(ViewKind::kState), 2 * 25 * kEpisode_s);
  EXPECT_LE(count(ViewKind::kState), 2 * (34 * kEpisode_s + 2));
  ASSERT_FALSE(messages.empty());
  EXPECT_EQ(messages.front().kind, ViewKind::kWorld);
  EXPECT_EQ(messages.back().kind, ViewKind::kEnd);
  const auto second =
      std::find_if(messages.begin() + 1, messages.end(),
                   [](const ViewMessage& one) { return one.kind == ViewKind::kWorld; });
  ASSERT_NE(second, messages.end());
  EXPECT_EQ((second - 1)->kind, ViewKind::kEnd) << "one episode after the other";
}

TEST_F(RecordedViewTest, ABagOfSomethingElseCannotBeViewed) {
  {
    auto writer = bag::Writer::create(file_);
    ASSERT_TRUE(writer);
    const auto id = writer->add_connection("/other", ros::type_of<ros::String>());
    ASSERT_TRUE(writer->write(id, {1, 0}, std::vector<std::byte>(4)));
    ASSERT_TRUE(writer->close());
  }
  const auto recording = open_recording(file_);
  ASSERT_FALSE(recording);
  EXPECT_EQ(recording.error().code, ErrorCode::kUnsupported);
  const auto none = open_recording(folder_.path() / "none.bag");
  ASSERT_FALSE(none);
  EXPECT_EQ(none.error().code, ErrorCode::kNotFound);
}

TEST_F(RecordedViewTest, ABrokenMessageIsAnErrorAndNoMore) {
  // Lengths that promise more than there is, in the array and in the message's own header.
  const std::vector<std::vector<unsigned char>> broken = {
      {},
      {1, 0, 0, 0},
      {0, 0, 0, 0, 0, 0, 0, 0, 9, 0, 0, 0, 1},
      {0, 0, 0, 0, 0, 0, 0, 0, 5, 0, 0, 0, 200, 0, 0, 0, '{'}};
  {
    auto writer = bag::Writer::create(file_);
    ASSERT_TRUE(writer);
    const auto id = writer->add_connection(topics::kView, ros::type_of<ros::UInt8MultiArray>());
    std::uint32_t second = 1;
    for (const auto& bytes : broken) {
      ASSERT_TRUE(writer->write(id, {second++, 0}, std::as_bytes(std::span(bytes))));
    }
    ASSERT_TRUE(writer->close());
  }
  const auto recording = open_recording(file_);
  ASSERT_TRUE(recording) << recording.error().describe();
  for (std::size_t i = 0; i < broken.size(); ++i) {
    const auto next = (*recording)->next();
    ASSERT_FALSE(next) << i;
    EXPECT_EQ(next.error().code, ErrorCode::kIo);
  }
  const auto end = (*recording)->next();
  ASSERT_TRUE(end);
  EXPECT_FALSE(*end);
}

/// What the page's messages never are: a million levels deep. Neither the parser nor what destroys
/// a header may recurse, on a stack of a few MiB.
TEST_F(RecordedViewTest, ADeeplyNestedHeaderIsNoReasonToRecurse) {
  constexpr std::size_t kDepth = 1'000'000;
  for (const auto& [open, close] : {std::pair("[", "]"), {"{\"a\":", "}"}, {"[", ""}}) {
    std::string header = "{\"kind\":\"state\",\"time_s\":1,\"x\":";
    for (std::size_t i = 0; i < kDepth; ++i) header += open;
    header += "1";
    for (std::size_t i = 0; i < kDepth; ++i) header += close;
    header += "}";
    std::string data(4, '\0');  // as UInt8MultiArray: no dimensions, an offset, a length, bytes
    const auto put = [&](std::uint32_t number) {
      data.append(reinterpret_cast<const char*>(&number), sizeof number);
    };
    put(0);
    put(static_cast<std::uint32_t>(header.size()) + 4);
    put(static_cast<std::uint32_t>(header.size()));
    data += header;
    std::filesystem::remove(file_);
    {
      auto writer = bag::Writer::create(file_);
      ASSERT_TRUE(writer);
      const auto id = writer->add_connection(topics::kView, ros::type_of<ros::UInt8MultiArray>());
      ASSERT_TRUE(writer->write(id, {1, 0}, std::as_bytes(std::span(data))));
      ASSERT_TRUE(writer->close());
    }
    const auto recording = open_recording(file_);
    ASSERT_TRUE(recording) << recording.error().describe();
    EXPECT_EQ((*recording)->next().has_value(), *close != '\0') << "all brackets are closed";
  }
}

}  // namespace
}  // namespace sidestep::testing
