#include <stop_token>
#include <thread>

#include <gtest/gtest.h>

#include "../simulator.hpp"
#include "hsr_on_its_way.hpp"

namespace sidestep::simulator {
namespace {

TEST(FrameTiming, LastUntilIsTheInverseOfStamp) {
  for (const double rate_hz : {30.0, 10.0, 29.97, 1000.0 / 3.0}) {
    const FrameTiming timing(rate_hz);
    for (std::int64_t k = 0; k < 2000; ++k) {
      EXPECT_EQ(timing.last_until(timing.stamp(k)), k);
      EXPECT_EQ(timing.last_until({timing.stamp(k).ns - 1}), k - 1);
    }
  }
  EXPECT_EQ(FrameTiming(30.0).last_until({-1}), -1);
}

class PacedSource : public ::testing::Test {
 protected:
  PacedSource() {
    options_ = testing::room_options();
    options_.camera = {16, 12, 13.9, 13.9, 7.5, 5.5};
    options_.frames = 0;
    options_.rate_hz = 10.0;
    options_.pace = "clock";
  }
  void mount() {
    options_.camera_path.clear();
    options_.mount = MountOptions{.link = "head_rgbd_sensor_link"};
  }
  void know_until(double to_s) {
    const auto newest = hsr_.motion().newest();
    const double from_s = newest ? newest->seconds() + 0.01 : 0.0;
    hsr_.move(hsr_.pose("go"), Eigen::VectorXd::Zero(8), from_s, to_s);
  }
  void make() {
    auto made = create_source(options_, hsr_.context());
    if (!made) throw std::runtime_error(made.error().describe());
    source_ = std::move(*made);
  }
  /// The number of the frame that there is at a time; -1 where there is none, -2 at the end, -3
  /// where one is bad.
  std::int64_t at(double time_s) {
    hsr_.clock().set_s(time_s);
    const auto frame = source_->next(Deadline(Deadline::SteadyClock::now()));
    if (!frame) return frame.error().code == ErrorCode::kDeadlineExceeded ? -1 : -3;
    if (!*frame) return -2;
    EXPECT_EQ((*frame)->stamp,
              Stamp::from_seconds(static_cast<double>((*frame)->sequence) / options_.rate_hz));
    return (*frame)->sequence;
  }

  testing::HsrOnItsWay hsr_;
  Options options_;
  std::unique_ptr<Source> source_;
};

TEST_F(PacedSource, GivesEachFrameOnceWhenItIsDue) {
  make();
  EXPECT_FALSE(source_->frame_count());
  EXPECT_EQ(at(0.0), 0);
  EXPECT_EQ(at(0.0), -1);
  EXPECT_EQ(at(0.0999), -1);
  EXPECT_EQ(at(0.1), 1);
  EXPECT_EQ(at(0.1999), -1);
  EXPECT_EQ(at(0.2001), 2);
}

TEST_F(PacedSource, SkipsWhatHasBeenOvertaken) {
  make();
  EXPECT_EQ(at(0.75), 7);
  EXPECT_EQ(at(0.79), -1);
  EXPECT_EQ(at(1.31), 13);
  EXPECT_EQ(at(0.5), -1);  // the clock jumps back
  EXPECT_EQ(at(1.4), 14);
}

TEST_F(PacedSource, WaitsForTheRobotsStateAtTheStamp) {
  mount();
  make();
  EXPECT_EQ(at(0.35), -1);
  know_until(0.29);
  EXPECT_EQ(at(0.35), 2);
  know_until(0.30);
  EXPECT_EQ(at(0.35), 3);
  EXPECT_EQ(at(0.39), -1);
  know_until(0.60);
  EXPECT_EQ(at(0.45), 4);
}

TEST_F(PacedSource, EndsAfterItsFrames) {
  options_.frames = 5;
  make();
  EXPECT_EQ(at(0.2), 2);
  EXPECT_EQ(at(9.0), 4);
  EXPECT_EQ(at(9.1), -2);
}

TEST_F(PacedSource, EndsAWaitWhenAskedTo) {
  make();
  EXPECT_EQ(at(0.0), 0);
  std::stop_source stop;
  stop.request_stop();
  EXPECT_EQ(source_->next(Deadline(stop.get_token())).error().code, ErrorCode::kCancelled);
  // Due in no time at all by this clock: waits until the deadline.
  EXPECT_EQ(source_->next(Deadline::after_s(0.002)).error().code, ErrorCode::kDeadlineExceeded);
}

TEST_F(PacedSource, WaitsForAClockThatMovesBesideIt) {
  make();
  EXPECT_EQ(at(0.0), 0);
  const std::jthread other([&] { hsr_.clock().set_s(0.1); });
  const auto frame = source_->next(Deadline());
  ASSERT_TRUE(frame && *frame);
  EXPECT_EQ((*frame)->sequence, 1);
}

TEST_F(PacedSource, AsFastAsPossibleGivesEveryFrameWhoseStateIsKnown) {
  mount();
  options_.pace = "as_fast_as_possible";
  options_.frames = 4;
  make();
  EXPECT_EQ(source_->frame_count(), 4);
  know_until(0.25);
  for (int k = 0; k < 3; ++k) EXPECT_EQ((*source_->next(Deadline()))->sequence, k);
  EXPECT_EQ(source_->next(Deadline::after_s(0.002)).error().code, ErrorCode::kDeadlineExceeded);
  know_until(0.3);
  EXPECT_EQ((*source_->next(Deadline()))->sequence, 3);
  EXPECT_FALSE(source_->next(Deadline())->has_value());
}

TEST_F(PacedSource, AFrameBeforeAllThatIsKnownOfTheRobotIsABadOne) {
  mount();
  options_.pace = "as_fast_as_possible";
  make();
  hsr_.move(hsr_.pose("go"), Eigen::VectorXd::Zero(8), 0.15, 0.5);
  EXPECT_EQ(source_->next(Deadline()).error().code, ErrorCode::kBadFrame);
  EXPECT_EQ(source_->next(Deadline()).error().code, ErrorCode::kBadFrame);
  EXPECT_EQ((*source_->next(Deadline()))->sequence, 2);
}

TEST_F(PacedSource, IsOnAPathOrOnTheRobot) {
  EXPECT_TRUE(options_.check().empty());
  options_.mount = MountOptions{.link = "head_rgbd_sensor_link"};
  ASSERT_EQ(options_.check().size(), 1U);
  EXPECT_EQ(options_.check()[0].parameters[0], "mount");
  options_.camera_path.clear();
  EXPECT_TRUE(options_.check().empty());
  options_.mount.reset();
  ASSERT_EQ(options_.check().size(), 1U);
  EXPECT_EQ(options_.check()[0].parameters[0], "camera_path");
}

}  // namespace
}  // namespace sidestep::simulator
