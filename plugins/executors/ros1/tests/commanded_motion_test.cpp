#include "commands.hpp"

#include <algorithm>
#include <limits>

#include <gtest/gtest.h>

namespace sidestep::ros1_executor {
namespace {

constexpr double kSpeed = 0.4, kBraking = 0.25;
constexpr double kWayToStop = kSpeed * kSpeed / (2.0 * kBraking);
constexpr double kTolerance = 0.1;

MotionLimits limits_of_one() { return {{0.5}, {kBraking}, {}}; }

/// One joint from 0 to 4 in 10 s, at speed from its first state to its last.
Trajectory cruise_of_one() {
  Trajectory trajectory = make_trajectory(1, 41, 0.25);
  for (int i = 0; i < trajectory.size(); ++i) {
    trajectory.q(i)[0] = kSpeed * trajectory.times_s[static_cast<std::size_t>(i)];
    trajectory.qdot(i)[0] = kSpeed;
  }
  return trajectory;
}

RobotState state_of_one(double q, double qdot) {
  return {Eigen::VectorXd::Constant(1, q), Eigen::VectorXd::Constant(1, qdot)};
}

/// Begins at 100 s of the run.
class CommandedMotionTest : public ::testing::Test {
 protected:
  CommandedMotionTest() { told_.set(cruise_of_one(), at(0.0)); }

  [[nodiscard]] static Stamp at(double since_start_s) {
    return Stamp::from_seconds(100.0 + since_start_s);
  }
  /// Where the robot comes to rest if told to stop then, when it was measured at `q`.
  [[nodiscard]] double end_of_stop(double since_start_s, double q, double qdot,
                                   double tolerance = kTolerance) const {
    const Stamp now = at(since_start_s);
    const Trajectory motion = stopping(told_, Executor::Measured{state_of_one(q, qdot), now},
                                       tolerance, limits_of_one(), now);
    EXPECT_GT(motion.size(), 0);
    EXPECT_EQ(motion.qdot(motion.size() - 1)[0], 0.0);
    return motion.q(motion.size() - 1)[0];
  }

  CommandedMotion told_;
};

TEST_F(CommandedMotionTest, IsUnderWayFromWhenItIsToldUntilItsEnd) {
  EXPECT_TRUE(told_.is_under_way(at(-1.0)));
  EXPECT_TRUE(told_.is_under_way(at(9.9)));
  EXPECT_FALSE(told_.is_under_way(at(10.0)));
  told_.clear();
  EXPECT_FALSE(told_.is_under_way(at(5.0)));
  EXPECT_FALSE(told_.at(at(5.0)));
}

TEST_F(CommandedMotionTest, HoldsTheRobotAtItsEnds) {
  const auto before = told_.at(at(-1.0)), on_the_way = told_.at(at(2.5)),
             after = told_.at(at(11.0));
  ASSERT_TRUE(before && on_the_way && after);
  EXPECT_EQ(before->q[0], 0.0);
  EXPECT_EQ(before->qdot[0], 0.0);
  EXPECT_NEAR(on_the_way->q[0], 1.0, 1e-6);
  EXPECT_NEAR(on_the_way->qdot[0], kSpeed, 1e-6);
  EXPECT_NEAR(after->q[0], 4.0, 1e-12);
  EXPECT_EQ(after->qdot[0], 0.0);
}

TEST_F(CommandedMotionTest, StopsAlongWhatItWasToldWhereItIsThere) {
  EXPECT_NEAR(end_of_stop(5.0, 2.05, 0.1), 2.0 + kWayToStop, 1e-3);
  // It ends before a robot at that speed can stop: straight on.
  EXPECT_NEAR(end_of_stop(9.75, 3.9, kSpeed), 3.9 + kWayToStop, 1e-3);
  // It has ended.
  EXPECT_NEAR(end_of_stop(11.0, 4.0, 0.0), 4.0, 1e-9);
}

TEST_F(CommandedMotionTest, StopsFromWhereItIsWhereThatIsElsewhere) {
  EXPECT_NEAR(end_of_stop(5.0, 1.5, 0.2), 1.5 + 0.2 * 0.2 / (2.0 * kBraking), 1e-3);
  constexpr double kAnywhere = std::numeric_limits<double>::infinity();
  EXPECT_NEAR(end_of_stop(5.0, 1.5, 0.2, kAnywhere), 2.0 + kWayToStop, 1e-3);
}

TEST_F(CommandedMotionTest, StopsWithoutAMeasurementFromWhatItWasTold) {
  const Trajectory motion = stopping(told_, {}, kTolerance, limits_of_one(), at(5.0));
  ASSERT_GT(motion.size(), 0);
  EXPECT_NEAR(motion.q(motion.size() - 1)[0], 2.0 + kWayToStop, 1e-3);
  told_.clear();
  EXPECT_EQ(stopping(told_, {}, kTolerance, limits_of_one(), at(5.0)).size(), 0);
}

}  // namespace
}  // namespace sidestep::ros1_executor
