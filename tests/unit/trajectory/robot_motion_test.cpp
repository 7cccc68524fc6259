#include <sidestep/trajectory/robot_motion.hpp>

#include <cmath>
#include <thread>

#include <gtest/gtest.h>

namespace sidestep {
namespace {

constexpr std::int64_t kMillisecond = 1'000'000;

Stamp ms(std::int64_t milliseconds) { return {milliseconds * kMillisecond}; }

/// Two joints on cubics of time.
RobotState cubic(double t) {
  return {Eigen::Vector2d(1.0 + 2.0 * t - 3.0 * t * t + 0.5 * t * t * t, -4.0 * t * t * t),
          Eigen::Vector2d(2.0 - 6.0 * t + 1.5 * t * t, -12.0 * t * t)};
}

TEST(RobotMotion, InterpolatesCubicsExactlyBetweenUnevenSamples) {
  RobotMotion motion;
  for (const std::int64_t t : {0, 90, 110, 700, 1000}) {
    motion.record(cubic(static_cast<double>(t) * 1e-3), ms(t));
  }
  for (std::int64_t t = 0; t <= 1000; t += 10) {
    const auto state = motion.measured(ms(t));
    ASSERT_TRUE(state) << t;
    const RobotState exact = cubic(static_cast<double>(t) * 1e-3);
    EXPECT_LT((state->q - exact.q).norm(), 1e-12) << t;
    EXPECT_LT((state->qdot - exact.qdot).norm(), 1e-12) << t;
  }
}

TEST(RobotMotion, KnowsNothingBeforeTheFirstAndAfterTheNewest) {
  RobotMotion motion;
  EXPECT_FALSE(motion.newest());
  EXPECT_FALSE(motion.measured(ms(0)));
  motion.record(cubic(0.1), ms(100));
  motion.record(cubic(0.2), ms(200));
  EXPECT_EQ(motion.newest(), ms(200));
  EXPECT_FALSE(motion.measured({ms(100).ns - 1}));
  EXPECT_TRUE(motion.measured(ms(100)));
  EXPECT_TRUE(motion.measured(ms(200)));
  EXPECT_FALSE(motion.measured({ms(200).ns + 1}));
}

TEST(RobotMotion, KnowsWhereTheHeadWas) {
  RobotMotion motion(2.0);
  EXPECT_FALSE(motion.head(Stamp::from_seconds(1.0)));
  for (const double time_s : {1.0, 1.5, 3.0}) {
    motion.record_head({time_s, -2.0 * time_s}, Stamp::from_seconds(time_s));
  }
  motion.record_head({9.0, 9.0}, Stamp::from_seconds(2.0));  // is not newer
  EXPECT_FALSE(motion.head(Stamp::from_seconds(0.9)));
  for (const double time_s : {1.0, 1.2, 1.5, 2.4, 3.0}) {
    const auto head = motion.head(Stamp::from_seconds(time_s));
    ASSERT_TRUE(head) << time_s;
    EXPECT_NEAR(head->pan_rad, time_s, 1e-9);
    EXPECT_NEAR(head->tilt_rad, -2.0 * time_s, 1e-9);
  }
  EXPECT_EQ(motion.head(Stamp::from_seconds(7.0))->pan_rad, 3.0);
  motion.record_head({6.0, 0.0}, Stamp::from_seconds(6.0));
  EXPECT_FALSE(motion.head(Stamp::from_seconds(2.0))) << "longer ago than it keeps";
}

TEST(RobotMotion, DropsWhatIsNotNewerOrOfAnotherRobot) {
  RobotMotion motion;
  motion.record(cubic(0.1), ms(100));
  motion.record(cubic(0.9), ms(100));
  motion.record(cubic(0.9), ms(50));
  motion.record({Eigen::Vector3d::Zero(), {}}, ms(200));
  EXPECT_EQ(motion.newest(), ms(100));
  EXPECT_EQ(motion.measured(ms(100))->q, cubic(0.1).q);
  EXPECT_FALSE(motion.measured(ms(50)));
}

TEST(RobotMotion, TakesAStateWithoutVelocitiesAsAtRest) {
  RobotMotion motion;
  motion.record({Eigen::Vector2d(0.0, 1.0), {}}, ms(0));
  motion.record({Eigen::Vector2d(1.0, 1.0), {}}, ms(100));
  EXPECT_EQ(motion.measured(ms(0))->qdot, Eigen::Vector2d(0.0, 0.0));
  // Rest to rest over T: half way after half the time, at 1.5 / T.
  const auto half = motion.measured(ms(50));
  EXPECT_NEAR(half->q[0], 0.5, 1e-12);
  EXPECT_NEAR(half->qdot[0], 15.0, 1e-9);
}

TEST(RobotMotion, KeepsItsHistoryAndNoMore) {
  RobotMotion motion(0.5);
  for (std::int64_t t = 0; t <= 2000; t += 10) {
    motion.record(cubic(static_cast<double>(t) * 1e-3), ms(t));
  }
  EXPECT_TRUE(motion.measured(ms(1500)));
  EXPECT_TRUE(motion.measured(ms(1505)));
  EXPECT_FALSE(motion.measured(ms(1480)));
}

TEST(RobotMotion, TellsTheTruthApartFromWhatIsMeasured) {
  RobotMotion motion;
  motion.record(cubic(0.1), ms(100));
  EXPECT_EQ(motion.truth(ms(100))->q, cubic(0.1).q);
  motion.record_truth(cubic(0.2), ms(100));
  EXPECT_EQ(motion.truth(ms(100))->q, cubic(0.2).q);
  EXPECT_EQ(motion.measured(ms(100))->q, cubic(0.1).q);
}

TEST(RobotMotion, PlansByWhatIsFollowedAndRestsBeyondItsEnds) {
  RobotMotion motion;
  EXPECT_FALSE(motion.planned(ms(0)));
  Trajectory way = make_trajectory(1, 2, 1.0);
  way.positions = {0.0, 2.0};
  way.velocities = {2.0, 2.0};
  motion.follow(way, ms(500));
  EXPECT_EQ(motion.planned(ms(0))->q[0], 0.0);
  EXPECT_EQ(motion.planned(ms(0))->qdot[0], 0.0);
  EXPECT_NEAR(motion.planned(ms(750))->q[0], 0.5, 1e-12);
  EXPECT_NEAR(motion.planned(ms(750))->qdot[0], 2.0, 1e-12);
  EXPECT_EQ(motion.planned(ms(9000))->q[0], 2.0);
  EXPECT_EQ(motion.planned(ms(9000))->qdot[0], 0.0);
  motion.follow({}, ms(600));
  EXPECT_FALSE(motion.planned(ms(750)));
}

/// What one thread reads while another writes is always a state on the line, whole.
TEST(RobotMotion, IsSharedByThreads) {
  RobotMotion motion(0.2);
  constexpr std::int64_t kSamples = 2000;
  motion.record({Eigen::Vector2d(0.0, 0.0), Eigen::Vector2d(1.0, -1.0)}, ms(0));
  std::jthread writer([&] {
    for (std::int64_t t = 1; t <= kSamples; ++t) {
      const double s = static_cast<double>(t) * 1e-3;
      motion.record({Eigen::Vector2d(s, -s), Eigen::Vector2d(1.0, -1.0)}, ms(t));
      motion.follow(make_trajectory(2, 3, 0.1), ms(t));
    }
  });
  while (*motion.newest() < ms(kSamples)) {
    const Stamp stamp{motion.newest()->ns - kMillisecond / 2};
    const auto planned = motion.planned(stamp);
    if (planned) {
      EXPECT_EQ(planned->q.size(), 2);
    }
    const auto state = motion.measured(stamp);
    if (!state) continue;
    EXPECT_NEAR(state->q[0], stamp.seconds(), 1e-9);
    EXPECT_EQ(state->q[0], -state->q[1]);
  }
  writer.join();
  EXPECT_TRUE(motion.measured(ms(kSamples)));
}

}  // namespace
}  // namespace sidestep
