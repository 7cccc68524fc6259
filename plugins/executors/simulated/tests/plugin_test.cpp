#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "conformance/manual_clock.hpp"
#include "support/host_fixture.hpp"

namespace sidestep {
namespace {

using ::testing::HasSubstr;
using testing_support::HostFixture;

TEST(SimulatedPlugin, MovesARobotOfTheHostsOnTheClockThatTheRunLends) {
  HostFixture fixture({SIDESTEP_PLUGIN_FOLDER});
  auto made_robot = fixture.host.create<RobotModel>(HostFixture::block("{plugin: point}"));
  ASSERT_TRUE(made_robot) << made_robot.error().describe();
  const std::shared_ptr<const RobotModel> robot = std::move(*made_robot);
  conformance::ManualClock clock;
  clock.set_s(2.0);
  const auto motion = std::make_shared<RobotMotion>();
  auto executor =
      fixture.host.create<Executor>(HostFixture::block("{plugin: simulated, start: {x: 1.5}}"),
                                    RunLoan{.robot = robot, .motion = motion, .clock = &clock});
  ASSERT_TRUE(executor) << executor.error().describe();
  EXPECT_NE(dynamic_cast<TrueRobot*>(executor->get()), nullptr);
  EXPECT_EQ(motion->newest(), Stamp::from_seconds(2.0));
  EXPECT_EQ(motion->measured(Stamp::from_seconds(2.0))->q, Eigen::Vector2d(1.5, 0.0));
  clock.set_s(2.1);
  EXPECT_EQ((*executor)->current()->stamp, Stamp::from_seconds(2.1));
}

TEST(SimulatedPlugin, ChecksItsParameters) {
  HostFixture fixture({SIDESTEP_PLUGIN_FOLDER});
  std::vector<Error> errors;
  fixture.host.check(PluginKind::kExecutor,
                     HostFixture::block("{plugin: simulated, delay_s: -1, lagg_s: 0.1}"), errors);
  std::string all;
  for (const Error& error : errors) all += error.describe() + "\n";
  EXPECT_EQ(errors.size(), 2U) << all;
  EXPECT_THAT(all, HasSubstr("delay_s"));
  EXPECT_THAT(all, HasSubstr("did you mean 'lag_s'"));
}

}  // namespace
}  // namespace sidestep
