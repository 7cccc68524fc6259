#include "mapping_parts.hpp"

#include <gtest/gtest.h>

#include "support/host_fixture.hpp"

namespace sidestep {
namespace {

using conformance::RecordingLog;

/// Ten frames, 0.1 s apart; frame 3 is bad.
class TenFrames final : public Source, public GroundTruth {
 public:
  Result<std::optional<Frame>> next(const Deadline&) override {
    const std::int64_t sequence = at_++;
    if (sequence == 3) return fail(ErrorCode::kBadFrame, "torn");
    if (sequence >= 10) return std::optional<Frame>();
    Frame frame;
    frame.sequence = sequence;
    frame.stamp = Stamp::from_seconds(0.1 * static_cast<double>(sequence));
    return std::optional<Frame>(std::move(frame));
  }
  std::optional<std::int64_t> frame_count() const override { return 10; }
  const Scene& scene() const override { return scene_; }

 private:
  std::int64_t at_ = 0;
  Scene scene_{{SceneObject{"ball", Sphere{0.1}, {Waypoint{}}}}};
};

class FrameFeedTest : public testing::Test {
 protected:
  [[nodiscard]] FrameFeed feed(FrameFeed::Limits limits) {
    const auto make = [this]() -> Result<PluginPtr<Source>> {
      ++made_;
      return PluginPtr<Source>(
          new TenFrames,
          {[](void* object) { delete static_cast<TenFrames*>(object); }, "source ten_frames"});
    };
    return {make, limits, log_, stop_.get_token()};
  }
  /// All frames from the first on.
  static std::vector<std::int64_t> sequences(FrameFeed& feed) {
    std::vector<std::int64_t> read;
    if (!feed.rewind()) return {-1};
    for (;;) {
      const auto ahead = feed.peek();
      const auto frame = feed.next();
      if (!frame || !ahead || *ahead != *frame) return {-1};
      if (*frame == nullptr) return read;
      read.push_back((*frame)->sequence);
    }
  }

  RecordingLog log_;
  std::stop_source stop_;
  int made_ = 0;
};

const std::vector<std::int64_t> kAllButTheBadOne = {0, 1, 2, 4, 5, 6, 7, 8, 9};

TEST_F(FrameFeedTest, ReadsAShortSequenceOnce) {
  FrameFeed frames = feed({0, 1, 100});
  for (int i = 0; i < 3; ++i) EXPECT_EQ(sequences(frames), kAllButTheBadOne);
  EXPECT_EQ(made_, 1);
  EXPECT_EQ(frames.bad_frames().size(), 1u);
  EXPECT_EQ(frames.frame_count(), 10);
}

TEST_F(FrameFeedTest, ReadsALongSequenceAnewEveryTime) {
  for (const int in_memory : {1, 2, 4, 9}) {
    FrameFeed frames = feed({0, 1, in_memory});
    made_ = 0;
    for (int i = 0; i < 3; ++i) EXPECT_EQ(sequences(frames), kAllButTheBadOne) << in_memory;
    EXPECT_EQ(made_, 3);
    EXPECT_EQ(frames.bad_frames().size(), 1u) << "told once";
  }
}

TEST_F(FrameFeedTest, TakesEveryNthFrameUpToALimit) {
  FrameFeed every_second = feed({0, 2, 100});
  EXPECT_EQ(sequences(every_second), (std::vector<std::int64_t>{0, 2, 4, 6, 8}));
  EXPECT_EQ(every_second.frame_count(), 5);
  FrameFeed three = feed({3, 4, 2});
  EXPECT_EQ(sequences(three), (std::vector<std::int64_t>{0, 4, 8}));
  FrameFeed first_two = feed({2, 1, 100});
  EXPECT_EQ(sequences(first_two), (std::vector<std::int64_t>{0, 1}));
  EXPECT_EQ(first_two.frame_count(), 2);
}

TEST_F(FrameFeedTest, KeepsTheSceneBehindTheFrames) {
  FrameFeed frames = feed({0, 1, 2});
  EXPECT_EQ(frames.scene(), nullptr);
  ASSERT_TRUE(frames.rewind());
  ASSERT_NE(frames.scene(), nullptr);
  EXPECT_EQ(frames.scene()->objects().front().name, "ball");
}

TEST_F(FrameFeedTest, PassesOverFramesThatHaveComeTooLate) {
  for (const int in_memory : {1, 3, 100}) {
    FrameFeed frames = feed({0, 1, in_memory});
    ASSERT_TRUE(frames.rewind());
    const auto take = [&](double now_s) { return frames.next_newest(now_s).value(); };
    auto taken = take(0.0);
    EXPECT_EQ(taken.frame->sequence, 0);
    EXPECT_EQ(taken.late, 0);
    taken = take(0.05);  // nothing has come: the next one
    EXPECT_EQ(taken.frame->sequence, 1);
    EXPECT_EQ(taken.late, 0);
    taken = take(0.55);  // 2, 4 and 5 have come
    EXPECT_EQ(taken.frame->sequence, 5);
    EXPECT_EQ(taken.late, 2);
    taken = take(99.0);
    EXPECT_EQ(taken.frame->sequence, 9);
    EXPECT_EQ(taken.late, 3);
    EXPECT_EQ(take(99.0).frame, nullptr);
  }
}

TEST_F(FrameFeedTest, EndsWhenAskedToStop) {
  FrameFeed frames = feed({0, 1, 2});
  ASSERT_TRUE(frames.rewind());
  stop_.request_stop();
  EXPECT_EQ((*frames.next())->sequence, 0);
  EXPECT_EQ((*frames.next())->sequence, 1);
  EXPECT_EQ(*frames.next(), nullptr);
}

}  // namespace
}  // namespace sidestep
