#include <array>
#include <limits>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include <gmock/gmock.h>

#include <sidestep/runtime/episode_clock.hpp>
#include <sidestep/runtime/sensor_set.hpp>
#include "conformance/test_host.hpp"

namespace sidestep {
namespace {

using ::testing::Each;
using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::IsEmpty;

/// Has a scan of a corner, other at each time, every `period_s`; each comes `latency_s` late.
class Lidar final : public Source {
 public:
  Lidar(const Clock& clock, double period_s, double latency_s = 0.0)
      : clock_(clock), period_s_(period_s), latency_s_(latency_s) {}

  Result<std::optional<Frame>> next(const Deadline& deadline) override {
    for (;;) {
      if (fault) return tl::make_unexpected(*fault);
      const double due_s = first_s + static_cast<double>(at_) * period_s_;
      const double now_s = clock_.now().seconds();
      if (!is_silent && due_s + latency_s_ <= now_s + 1e-9) return frame(due_s);
      if (is_silent) at_ = static_cast<std::int64_t>((now_s - first_s) / period_s_) + 1;
      if (deadline.expired()) return fail(ErrorCode::kDeadlineExceeded, "nothing yet");
    }
  }
  std::optional<std::int64_t> frame_count() const override { return {}; }

  double first_s = 0.0;
  bool is_silent = false;
  std::optional<Error> fault;

 private:
  std::optional<Frame> frame(double stamp_s) {
    std::optional<Frame> made(std::in_place);
    made->sequence = at_++;
    made->stamp = Stamp::from_seconds(stamp_s);
    PointCloud scan;
    for (int i = 0; i < 100; ++i) {
      const auto noise_m = 1e-3F * static_cast<float>((7 * at_ + 13 * i) % 11);
      scan.points_m.emplace_back(2.0F + noise_m, 0.02F * static_cast<float>(i), 0.0F);
    }
    made->measurement = std::move(scan);
    return made;
  }

  const Clock& clock_;
  double period_s_;
  double latency_s_;
  std::int64_t at_ = 0;
};

class TwoSensors : public ::testing::Test {
 protected:
  [[nodiscard]] SensorSet set(bool is_needed, bool waits = false) {
    return SensorSet({{camera_, "camera"}, {laser_, "laser", is_needed}}, clock_, waits, 0.0,
                     nullptr, log_);
  }
  /// Everything that is there at a time: the sensors of what was passed on, and what was refused.
  std::vector<int> at(SensorSet& sensors, double time_s) {
    clock_.set(Stamp::from_seconds(time_s));
    refused_.clear();
    std::vector<int> passed;
    for (;;) {
      const auto frame = sensors.next(Deadline());
      if (frame && *frame) {
        passed.push_back((*frame)->sensor);
      } else if (!frame && frame.error().code == ErrorCode::kBadFrame) {
        refused_.push_back(frame.error().describe());
      } else {
        ended_ = frame ? "end" : std::string(to_string(frame.error().code));
        return passed;
      }
    }
  }

  EpisodeClock clock_;
  conformance::RecordingLog log_;
  Lidar camera_{clock_, 0.1}, laser_{clock_, 0.05};
  std::vector<std::string> refused_;
  std::string ended_;
};

TEST_F(TwoSensors, GiveTheirFramesInTheOrderOfTheirStamps) {
  laser_.first_s = 0.02;
  SensorSet sensors = set(false);
  EXPECT_THAT(at(sensors, 0.0), ElementsAre(0));
  EXPECT_THAT(at(sensors, 0.21), ElementsAre(1, 1, 0, 1, 1, 0));  // 0.02 0.07 0.1 0.12 0.17 0.2
  EXPECT_THAT(refused_, IsEmpty());
  EXPECT_EQ(sensors.take_span(), 7);
}

TEST_F(TwoSensors, GoOnWithoutOneThatIsNotNeeded) {
  SensorSet sensors = set(false);
  for (int i = 0; i < 10; ++i) at(sensors, 0.1 * i);
  laser_.is_silent = true;
  for (int i = 10; i < 20; ++i) {
    EXPECT_THAT(at(sensors, 0.1 * i), ElementsAre(0));
    EXPECT_THAT(refused_, IsEmpty());
  }
  EXPECT_THAT(
      log_.messages(),
      ElementsAre(HasSubstr("goes on without laser, which has given no frame since that of")));
  laser_.is_silent = false;
  for (int i = 20; i < 25; ++i) at(sensors, 0.1 * i);
  EXPECT_THAT(log_.messages().back(), HasSubstr("laser is back"));
  EXPECT_EQ(log_.messages().size(), 2u);
}

TEST_F(TwoSensors, GiveNoFrameWithoutOneThatIsNeeded) {
  SensorSet sensors = set(true);
  for (int i = 0; i <= 10; ++i) at(sensors, 0.1 * i);
  laser_.is_silent = true;  // its last frame was of 1.0 s
  for (const double time_s : {1.1, 1.2}) {
    EXPECT_THAT(at(sensors, time_s), ElementsAre(0));
  }
  for (const double time_s : {1.4, 1.5}) {
    EXPECT_THAT(at(sensors, time_s), IsEmpty());
    EXPECT_FALSE(refused_.empty());
    EXPECT_THAT(refused_, Each(HasSubstr("no map without laser, which has given no frame")));
  }
  laser_.is_silent = false;
  at(sensors, 1.6);
  EXPECT_THAT(at(sensors, 1.7), ElementsAre(1, 0, 1));  // 1.65, and both of 1.7
}

/// A robot that waits for its next goal maps nothing meanwhile.
TEST_F(TwoSensors, GoOnAfterACancelledWait) {
  SensorSet sensors = set(true);
  at(sensors, 0.0);
  camera_.fault = laser_.fault = Error{ErrorCode::kCancelled, "waiting was cancelled", {}, {}, {}};
  EXPECT_THAT(at(sensors, 0.1), IsEmpty());
  EXPECT_EQ(ended_, to_string(ErrorCode::kCancelled));
  camera_.fault = laser_.fault = std::nullopt;
  EXPECT_THAT(at(sensors, 0.1), ElementsAre(1, 0, 1));
  EXPECT_THAT(refused_, IsEmpty());
}

TEST_F(TwoSensors, GiveNoFrameBeforeTheFirstOfOneThatIsNeeded) {
  laser_.first_s = 0.42;
  SensorSet sensors = set(true);
  for (int i = 0; i <= 4; ++i) EXPECT_THAT(at(sensors, 0.1 * i), IsEmpty());
  EXPECT_THAT(refused_, Each(HasSubstr("no map without laser, which has given no frame")));
  EXPECT_THAT(at(sensors, 0.5), ElementsAre(1, 1, 0));
}

/// A long outage says nothing of how often frames come.
TEST_F(TwoSensors, NoticeASecondOutageAsSoonAsTheFirst) {
  SensorSet sensors = set(true);
  for (int i = 0; i <= 10; ++i) at(sensors, 0.1 * i);
  laser_.is_silent = true;
  for (int i = 11; i <= 400; ++i) at(sensors, 0.1 * i);
  laser_.is_silent = false;
  at(sensors, 40.1);
  EXPECT_FALSE(at(sensors, 40.2).empty());
  laser_.is_silent = true;
  at(sensors, 40.3);
  at(sensors, 40.4);
  at(sensors, 40.5);
  EXPECT_THAT(at(sensors, 40.6), IsEmpty());
}

TEST_F(TwoSensors, WaitForASlowOne) {
  Lidar slow(clock_, 0.5);
  SensorSet sensors({{camera_, "camera"}, {slow, "slow"}}, clock_, false, 0.0, nullptr, log_);
  for (int i = 0; i <= 40; ++i) {
    EXPECT_FALSE(at(sensors, 0.1 * i).empty()) << i;
    EXPECT_THAT(refused_, IsEmpty()) << i;
  }
}

/// Sixty a second, for hours.
TEST_F(TwoSensors, TellOnceOfARowOfBadFrames) {
  SensorSet sensors = set(false);
  for (int i = 0; i <= 10; ++i) at(sensors, 0.1 * i);
  laser_.fault = Error{ErrorCode::kBadFrame, "no beam returned", {}, {}, nullptr};
  for (int i = 11; i <= 40; ++i) {
    EXPECT_THAT(at(sensors, 0.1 * i), ElementsAre(0));
    EXPECT_THAT(refused_, IsEmpty());
  }
  EXPECT_THAT(log_.messages(), ElementsAre(HasSubstr("left out: laser: no beam returned"),
                                           HasSubstr("goes on without laser: no beam returned")));
}

TEST_F(TwoSensors, NameTheFaultOfOneThatIsNeeded) {
  SensorSet sensors = set(true);
  for (int i = 0; i <= 10; ++i) at(sensors, 0.1 * i);
  laser_.fault = Error{ErrorCode::kIo, "the cable is broken", {}, {}, nullptr};
  for (int i = 11; i < 16; ++i) at(sensors, 0.1 * i);
  EXPECT_THAT(refused_, ElementsAre(HasSubstr("without laser: the cable is broken")));
  EXPECT_EQ(ended_, to_string(ErrorCode::kDeadlineExceeded));
}

/// Nothing could be mapped any more.
TEST_F(TwoSensors, FailWithTheLastOfThem) {
  SensorSet sensors = set(false);
  at(sensors, 0.0);
  laser_.fault = Error{ErrorCode::kIo, "the cable is broken", {}, {}, nullptr};
  EXPECT_THAT(at(sensors, 0.1), ElementsAre(0));
  camera_.fault = Error{ErrorCode::kIo, "the lens is broken", {}, {}, nullptr};
  EXPECT_THAT(at(sensors, 0.2), IsEmpty());
  EXPECT_EQ(ended_, to_string(ErrorCode::kIo));
}

/// By a clock that runs: the camera's frames take 40 ms longer than the laser's.
TEST(SensorSetTest, AFrameWaitsForOnesFromBeforeItThatTakeLonger) {
  EpisodeClock clock;
  conformance::RecordingLog log;
  Lidar camera(clock, 0.03, 0.05), laser(clock, 0.01, 0.01);
  SensorSet sensors({{camera, "camera"}, {laser, "laser"}}, clock, true, 0.0, nullptr, log);
  clock.start();
  Stamp last{std::numeric_limits<std::int64_t>::min()};
  int passed = 0, refused = 0;
  std::array<int, 2> of{};
  const Deadline deadline = Deadline::after_s(1.0);
  while (!deadline.expired()) {
    const auto frame = sensors.next(Deadline::after_s(0.1));
    if (!frame) {
      refused += frame.error().code == ErrorCode::kBadFrame ? 1 : 0;
      continue;
    }
    ASSERT_TRUE(*frame);
    EXPECT_GE((*frame)->stamp, last);
    last = (*frame)->stamp;
    ++passed;
    ++of[static_cast<std::size_t>((*frame)->sensor)];
  }
  EXPECT_GT(of[0], 10);
  EXPECT_GT(of[1], 20);
  // Those that came before it was known how long the camera's take, and where the machine stood.
  EXPECT_LT(refused, passed / 5);
}

}  // namespace
}  // namespace sidestep
