#include "../recording.hpp"

#include <thread>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "bag_writing.hpp"
#include "conformance/manual_clock.hpp"

namespace sidestep::rosbag::testing {
namespace {

using conformance::ManualClock;

Stamp s(double seconds) { return Stamp::from_seconds(seconds); }

TEST(Playback, IsDueAtTheRecordedDistancesAtTheRate) {
  Playback playback({s(100.0), s(100.5), s(100.5), s(102.0)}, 2.0);
  playback.start(s(7.0));
  playback.start(s(8.0));  // too late to count
  EXPECT_EQ(playback.due(0), s(7.0));
  EXPECT_EQ(playback.due(1), s(7.25));
  EXPECT_EQ(playback.due(3), s(8.0));
  EXPECT_FALSE(playback.newest_due(s(6.9)));
  EXPECT_EQ(playback.newest_due(s(7.0)), 0U);
  EXPECT_EQ(playback.newest_due(s(7.24)), 0U);
  EXPECT_EQ(playback.newest_due(s(7.25)), 2U);
  EXPECT_EQ(playback.newest_due(s(7.99)), 2U);
  EXPECT_EQ(playback.newest_due(s(1e6)), 3U);
}

class PacedBag : public ::testing::Test {
 protected:
  void SetUp() override {
    write_flat_bag(folder_.path() / "paced.bag", 10, {});
    Options options = options_of(folder_.path() / "paced.bag");
    options.pace = "clock";
    options.rate = 0.5;
    clock_.set_s(3.0);
    auto source = create_source(options, host_.context());
    ASSERT_TRUE(source) << source.error().describe();
    source_ = std::move(*source);
  }

  /// The pixels of a frame tell which one it is.
  static float depth_m(const Frame& frame) {
    return std::get<DepthImage>(frame.measurement).depth_m.front();
  }

  testing_support::TemporaryFolder folder_;
  ManualClock clock_;
  conformance::TestHost host_{1, {.clock = &clock_}};
  std::unique_ptr<Source> source_;
};

TEST_F(PacedBag, HandsOutTheNewestFrameThatIsDue) {
  EXPECT_FALSE(source_->frame_count());
  const auto first = source_->next(Deadline());
  ASSERT_TRUE(first && *first);
  EXPECT_EQ((*first)->stamp, s(3.0));
  EXPECT_EQ(depth_m(**first), 1.0F);
  // Frames are 0.2 s of the run apart: at 3.7 s numbers 1 to 3 are due.
  clock_.set_s(3.7);
  const auto later = source_->next(Deadline());
  ASSERT_TRUE(later && *later);
  EXPECT_EQ((*later)->stamp, s(3.6));
  EXPECT_EQ((*later)->sequence, 3);
  EXPECT_EQ(depth_m(**later), 1.003F);
  clock_.set_s(100.0);
  const auto last = source_->next(Deadline());
  ASSERT_TRUE(last && *last);
  EXPECT_EQ((*last)->sequence, 9);
  const auto end = source_->next(Deadline());
  ASSERT_TRUE(end);
  EXPECT_FALSE(*end);
}

TEST_F(PacedBag, WaitsForAFrameUntilTheDeadline) {
  ASSERT_TRUE(source_->next(Deadline()));
  EXPECT_EQ(source_->next(Deadline::after_s(0.001)).error().code, ErrorCode::kDeadlineExceeded);
  clock_.set_s(3.2);
  const auto frame = source_->next(Deadline());
  ASSERT_TRUE(frame && *frame);
  EXPECT_EQ((*frame)->sequence, 1);
}

TEST_F(PacedBag, IsWokenByTheClock) {
  ASSERT_TRUE(source_->next(Deadline()));
  std::jthread tick([&] { clock_.set_s(3.2); });
  const auto frame = source_->next(Deadline());
  ASSERT_TRUE(frame && *frame);
  EXPECT_EQ((*frame)->sequence, 1);
}

}  // namespace
}  // namespace sidestep::rosbag::testing
