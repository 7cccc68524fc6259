#include "node.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

namespace sidestep::ros1_node {
namespace {

using ::testing::HasSubstr;

Stamp at_s(double seconds) { return Stamp::from_seconds(seconds); }

TEST(RunTime, TellsInstantsOfTheOneClockOnTheOther) {
  RunTime time(0.1);
  ASSERT_TRUE(time.update(at_s(2.0), at_s(1002.0)));
  EXPECT_EQ(time.to_run(at_s(1001.5)), at_s(1.5));
  EXPECT_EQ(time.to_ros(at_s(-3.0)), at_s(997.0));
}

TEST(RunTime, GoesAlongWhileTheRunStandsAtItsZero) {
  RunTime time(0.1);
  ASSERT_TRUE(time.update(at_s(0.0), at_s(1000.0)));
  ASSERT_TRUE(time.update(at_s(0.0), at_s(1007.0)));
  // The run begins somewhere between two readings.
  ASSERT_TRUE(time.update(at_s(0.2), at_s(1009.0)));
  EXPECT_EQ(time.to_run(at_s(1009.0)), at_s(0.2));
  EXPECT_FALSE(time.update(at_s(0.3), at_s(1009.5)));
}

TEST(RunTime, FollowsClocksThatAreSlewed) {
  RunTime time(0.1);
  for (int second = 1; second <= 3600; ++second) {
    // 500 ppm, the fastest that a kernel slews: 1.8 s in an hour.
    const double ros_s = 1000.0 + 1.0005 * second;
    ASSERT_TRUE(time.update(at_s(second), at_s(ros_s)));
    EXPECT_EQ(time.to_run(at_s(ros_s)), at_s(second));
  }
}

class Jump : public ::testing::TestWithParam<double> {};

TEST_P(Jump, IsAnErrorForGoodThatNamesBothClocks) {
  RunTime time(0.1);
  ASSERT_TRUE(time.update(at_s(5.0), at_s(1005.0)));
  const auto jumped = time.update(at_s(5.5), at_s(1005.5 + GetParam()));
  ASSERT_FALSE(jumped);
  EXPECT_THAT(jumped.error().message, HasSubstr("ROS time jumped against the run's clock"));
  EXPECT_THAT(jumped.error().message, HasSubstr("the run's clock went on by 0.500 s"));
  EXPECT_THAT(jumped.error().message,
              HasSubstr("it went on by " + std::to_string(0.5 + GetParam()).substr(0, 4)));
  EXPECT_FALSE(time.update(at_s(6.0), at_s(1006.0))) << "whatever the clocks say next";
}

INSTANTIATE_TEST_SUITE_P(EitherWay, Jump, ::testing::Values(-2.0, 2.0));

TEST(RunTime, TakesWhatIsWithinTheToleranceForNoJump) {
  RunTime time(0.1);
  ASSERT_TRUE(time.update(at_s(5.0), at_s(1005.0)));
  EXPECT_TRUE(time.update(at_s(6.0), at_s(1006.09)));
  EXPECT_FALSE(time.update(at_s(7.0), at_s(1006.95)));
}

}  // namespace
}  // namespace sidestep::ros1_node
