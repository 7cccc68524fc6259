#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "closed_loop.hpp"

namespace sidestep {
namespace {

using testing::HasSubstr;
using testing_support::Ball;
using testing_support::ClosedLoop;
using testing_support::DetourPlanner;
using testing_support::expect_goal;
using Kind = ReplannerEvent::Kind;
using Status = Replanner::Status;

TEST(Replanner, LeavesTheMarginOfWhatCameUpToItAndKeepsItAfterwards) {
  ReplannerSettings settings = ClosedLoop::defaults();
  settings.margin_m = 0.1;
  ClosedLoop loop(settings);
  const Ball behind{{-0.47, 0.0, 0.0}, 0.2};  // 0.07 m from the robot
  const Ball in_the_way{{2.5, 0.0, 0.0}, 0.3};
  double least_ahead_m = 1e9;
  loop.obstacles = {behind};
  loop.planner.misbehave = [&](const Problem& problem, const Trajectory&,
                               const Deadline&) -> std::optional<Result<Solution>> {
    if (loop.mapped.size() > 1) return std::nullopt;
    return DetourPlanner::straight(problem);
  };
  loop.run(20.0, [&](double t) {
    if (t >= 1.0) loop.obstacles = {behind, in_the_way};
    if (t < 1.0) return;
    least_ahead_m = std::min(
        least_ahead_m, in_the_way.distance_m(loop.executor.state().q) - ClosedLoop::kRadius_m);
  });
  expect_goal(loop);
  EXPECT_NEAR(loop.least_clearance_m, 0.07, 1e-9);
  EXPECT_GE(least_ahead_m, 0.1);
  EXPECT_THAT(loop.first(Kind::kPlanned)->cause, HasSubstr("within the margin"));
}

/// What a ball left in the map that came 0.05 m into the robot must not hold it for good; what it
/// is 0.15 m inside may be there. It goes straight away from it, or stands.
TEST(Replanner, LeavesWhatItStandsInUnlessThatIsDeep) {
  for (const double depth_m : {0.05, 0.15}) {
    ReplannerSettings settings = ClosedLoop::defaults();
    settings.margin_m = 0.1;
    ClosedLoop loop(settings);
    const Ball behind{{-0.4 + depth_m, 0.0, 0.0}, 0.2};
    loop.obstacles = {behind};
    loop.planner.misbehave = [&](const Problem& problem, const Trajectory&,
                                 const Deadline&) -> std::optional<Result<Solution>> {
      return DetourPlanner::straight(problem);
    };
    loop.run(20.0);
    if (depth_m > 0.1) {
      EXPECT_EQ(loop.executor.follows, 0);
      // It goes on saying so, every ten seconds.
      EXPECT_EQ(loop.count(Kind::kReplanFailed), 2) << loop.story();
      continue;
    }
    expect_goal(loop);
    EXPECT_NEAR(loop.least_clearance_m, -depth_m, 1e-9);
    EXPECT_THAT(loop.first(Kind::kPlanned)->cause, HasSubstr("and leaves it"));
  }
}

/// The centre of a small ball lies 0.01 m within an obstacle: a field without a sign cannot tell
/// how far.
TEST(Replanner, LeavesNothingWhoseDepthNobodyKnows) {
  for (const bool is_signed : {true, false}) {
    ClosedLoop loop;
    loop.robot = std::make_shared<testing_support::BallRobot>(0.05);
    loop.fields_are_signed = is_signed;
    loop.obstacles = {{{-0.19, 0.0, 0.0}, 0.2}};
    loop.planner.misbehave = [](const Problem& problem, const Trajectory&,
                                const Deadline&) -> std::optional<Result<Solution>> {
      return DetourPlanner::straight(problem);
    };
    loop.run(20.0);
    EXPECT_EQ(loop.status == Status::kReached, is_signed) << loop.story();
    EXPECT_EQ(loop.executor.follows > 0, is_signed) << loop.story();
    EXPECT_EQ(loop.story().find("and leaves it") != std::string::npos, is_signed);
  }
}

}  // namespace
}  // namespace sidestep
