#include <limits>
#include <stdexcept>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "closed_loop.hpp"

namespace sidestep {
namespace {

using testing::HasSubstr;
using testing_support::ClosedLoop;
using testing_support::DetourPlanner;
using Kind = ReplannerEvent::Kind;
using Reason = ReplannerEvent::Reason;
using Status = Replanner::Status;

/// After a fault the robot stood, it went on once the fault was mended, and hit nothing.
void expect_stop_and_recovery(const ClosedLoop& loop, Reason reason, const std::string& cause) {
  const ReplannerEvent* stopped = loop.first(Kind::kStopped);
  ASSERT_NE(stopped, nullptr) << loop.story();
  EXPECT_EQ(stopped->reason, reason) << loop.story();
  EXPECT_THAT(stopped->cause, HasSubstr(cause));
  EXPECT_EQ(loop.count(Kind::kStopped), 1) << loop.story();
  const ReplannerEvent* recovered = loop.first(Kind::kRecovered);
  ASSERT_NE(recovered, nullptr) << loop.story();
  EXPECT_EQ(recovered->reason, reason);
  EXPECT_EQ(loop.status, Status::kReached) << loop.story();
  EXPECT_GT(loop.least_clearance_m, 0.0);
  EXPECT_LE(loop.largest_velocity_step,
            ClosedLoop::kAcceleration * ClosedLoop::kStep_s * (1.0 + 1e-3));
}

TEST(ReplannerFaults, AnOldMapStopsTheRobotUntilNewOnesCome) {
  ClosedLoop loop;
  double speed = 1.0;
  loop.run(30.0, [&](double t) {
    loop.maps = t < 1.0 || t >= 5.0;
    if (t > 4.0 && t < 5.0) speed = loop.executor.state().qdot.norm();
  });
  EXPECT_EQ(speed, 0.0);
  expect_stop_and_recovery(loop, Reason::kMap, "the map is 0.5");
  EXPECT_NEAR(loop.first(Kind::kStopped)->stamp.seconds(), 1.5, 0.05);
}

TEST(ReplannerFaults, WhatKeepsMapsFromComingIsNamed) {
  ClosedLoop loop;
  loop.map_trouble = [] { return "source fake: the lens is fogged"; };
  loop.run(30.0, [&](double t) { loop.maps = t < 1.0 || t >= 5.0; });
  expect_stop_and_recovery(loop, Reason::kMap, "more than 0.5 s: source fake: the lens is fogged");
}

TEST(ReplannerFaults, NoMapAtAllIsToldOnce) {
  ClosedLoop loop;
  loop.maps = false;
  loop.run(0.4);
  EXPECT_EQ(loop.events.size(), 0u) << loop.story();
  loop.run(5.0);
  ASSERT_EQ(loop.count(Kind::kStopped), 1) << loop.story();
  EXPECT_EQ(loop.first(Kind::kStopped)->reason, Reason::kMap);
  EXPECT_THAT(loop.first(Kind::kStopped)->cause, HasSubstr("there is no map yet"));
  loop.maps = true;
  loop.run(30.0);
  EXPECT_EQ(loop.status, Status::kReached) << loop.story();
}

TEST(ReplannerFaults, AMapWhoseTimeJumpsBackStopsTheRobot) {
  ClosedLoop loop;
  loop.run(30.0, [&](double t) { loop.map_age_s = t >= 1.0 && t < 4.0 ? 0.3 : 0.0; });
  // 0.3 s later the same stamps have been seen: the jump is over.
  expect_stop_and_recovery(loop, Reason::kMap, "jumped back by 0.2");
}

TEST(ReplannerFaults, AMapAheadOfTheClockIsNotPlannedIn) {
  ClosedLoop loop;
  loop.map_age_s = -3.0;
  loop.run(1.0);
  EXPECT_EQ(loop.status, Status::kWaiting);
  ASSERT_NE(loop.first(Kind::kStopped), nullptr);
  EXPECT_THAT(loop.first(Kind::kStopped)->cause, HasSubstr("ahead of the clock"));
  EXPECT_EQ(loop.count(Kind::kPlanned), 0);
}

TEST(ReplannerFaults, AClockThatGoesBackStopsTheRobot) {
  ClosedLoop loop;
  loop.run(2.0);
  loop.clock_offset_s = -1.0;
  loop.run(3.5);
  const ReplannerEvent* stopped = loop.first(Kind::kStopped);
  ASSERT_NE(stopped, nullptr) << loop.story();
  EXPECT_EQ(stopped->reason, Reason::kClock);
  EXPECT_GE(loop.executor.stops, 1);
  loop.run(30.0);
  EXPECT_EQ(loop.status, Status::kReached) << loop.story();
}

TEST(ReplannerFaults, AnExecutorThatDoesNotKnowItsStateIsToldToStop) {
  for (const bool throws : {false, true}) {
    ClosedLoop loop;
    loop.run(30.0, [&](double t) {
      (throws ? loop.executor.is_throwing : loop.executor.is_silent) = t >= 1.0 && t < 3.0;
    });
    EXPECT_GE(loop.executor.stops, 1);
    expect_stop_and_recovery(loop, Reason::kExecutor,
                             throws ? "the cable is loose" : "no message from the robot");
    EXPECT_THAT(loop.first(Kind::kStopped)->cause, HasSubstr("executor fake"));
  }
}

TEST(ReplannerFaults, AStopThatFailedIsAskedForAgainOnceTheExecutorAnswers) {
  ClosedLoop loop;
  double speed = 1.0;
  loop.run(30.0, [&](double t) {
    loop.executor.is_throwing = loop.executor.refuses_to_stop = t >= 1.0 && t < 1.1;
    loop.maps = t < 1.0 || t >= 5.0;  // so that it stays where it is
    if (t > 4.0 && t < 5.0) speed = loop.executor.state().qdot.norm();
  });
  EXPECT_EQ(speed, 0.0);
  const ReplannerEvent* stopped = loop.first(Kind::kStopped);
  ASSERT_NE(stopped, nullptr) << loop.story();
  EXPECT_EQ(stopped->reason, Reason::kExecutor);
  EXPECT_THAT(stopped->cause, HasSubstr("own stop failed: executor fake: no brakes"));
  EXPECT_EQ(loop.status, Status::kReached) << loop.story();
  EXPECT_LE(loop.largest_velocity_step,
            ClosedLoop::kAcceleration * ClosedLoop::kStep_s * (1.0 + 1e-3));
}

TEST(ReplannerFaults, AnEndIsAStopAlongThePath) {
  ClosedLoop loop;
  loop.run(2.0);
  loop.judged->stop(*loop.replanner, loop.executor.now, "enough", loop.events);
  ASSERT_NE(loop.first(Kind::kStopped), nullptr);
  EXPECT_EQ(loop.first(Kind::kStopped)->reason, Reason::kEnd);
  EXPECT_EQ(loop.first(Kind::kStopped)->cause, "enough");
  EXPECT_EQ(loop.executor.stops, 0);
  loop.executor.now = Stamp::from_seconds(4.0);
  EXPECT_EQ(loop.executor.state().qdot.norm(), 0.0);
  EXPECT_LT(loop.executor.state().q.x(), 3.0);
  const std::size_t told = loop.events.size();
  loop.judged->stop(*loop.replanner, loop.executor.now, "again", loop.events);
  EXPECT_EQ(loop.events.size(), told);
}

TEST(ReplannerFaults, AnExecutorThatRefusesIsAskedAgain) {
  ClosedLoop loop;
  loop.executor.refusals = 3;
  loop.run(20.0);
  EXPECT_EQ(loop.count(Kind::kReplanFailed), 3) << loop.story();
  EXPECT_THAT(loop.first(Kind::kReplanFailed)->cause, HasSubstr("the brakes are on"));
  EXPECT_THAT(loop.first(Kind::kReplanFailed)->cause, HasSubstr("executor fake"));
  EXPECT_EQ(loop.status, Status::kReached);
}

TEST(ReplannerFaults, AnExecutorThatRefusesEvenAStopIsToldToStopByItself) {
  ClosedLoop loop;
  loop.run(5.0, [&](double t) {
    if (t < 1.0) return;
    loop.obstacles = {{{2.5, 0.0, 0.0}, 0.3}};
    loop.executor.refusals = 1000;
  });
  EXPECT_GE(loop.executor.stops, 1);
  EXPECT_GT(loop.least_clearance_m, 0.0);
  EXPECT_EQ(loop.executor.state().qdot.norm(), 0.0);
  ASSERT_NE(loop.first(Kind::kStopped), nullptr) << loop.story();
  EXPECT_THAT(loop.first(Kind::kStopped)->cause, HasSubstr("refused the stop"));
}

TEST(ReplannerFaults, ARobotThatDoesNotFollowIsStopped) {
  ClosedLoop loop;
  loop.run(30.0, [&](double t) {
    loop.executor.offset = {0.0, t >= 1.0 && t < 3.0 ? 0.3 : 0.0, 0.0};
    loop.maps = t < 1.0 || t >= 3.0;  // nothing is planned from where the robot is not
  });
  ASSERT_NE(loop.first(Kind::kStopped), nullptr) << loop.story();
  EXPECT_EQ(loop.first(Kind::kStopped)->reason, Reason::kNotFollowing);
  EXPECT_THAT(loop.first(Kind::kStopped)->cause, HasSubstr("joint 'y' is 0.3 m from"));
  EXPECT_GE(loop.executor.stops, 1);
  EXPECT_EQ(loop.status, Status::kReached) << loop.story();
}

Trajectory proper(const Problem& problem) {
  return DetourPlanner::through({problem.start.q, problem.goal.q}, problem.start.qdot);
}

Result<Solution> found(Trajectory trajectory) {
  Solution solution;
  solution.status = SolveStatus::kConverged;
  solution.trajectory = std::move(trajectory);
  return solution;
}

struct Misdeed {
  std::string name;
  std::string cause;
  std::function<Result<Solution>(const Problem&)> answer;
};

class FaultyOptimiser : public testing::TestWithParam<Misdeed> {};

TEST_P(FaultyOptimiser, IsNamedAndTheRobotStopsUntilItIsMended) {
  ClosedLoop loop;
  loop.planner.misbehave = [&](const Problem& problem, const Trajectory&,
                               const Deadline&) -> std::optional<Result<Solution>> {
    const double t = loop.executor.now.seconds();
    if (t < 1.0 || t >= 5.0) return std::nullopt;
    return GetParam().answer(problem);
  };
  loop.run(30.0, [&](double t) {
    if (t >= 1.0) loop.obstacles = {{{3.0, 0.0, 0.0}, 0.3}};
  });
  expect_stop_and_recovery(loop, Reason::kPlugin, GetParam().cause);
  EXPECT_THAT(loop.first(Kind::kStopped)->cause, HasSubstr("optimiser detour"));
  EXPECT_EQ(loop.executor.stops, 0) << "a stop of ours could be verified";
}

INSTANTIATE_TEST_SUITE_P(
    ReplannerFaults, FaultyOptimiser,
    testing::Values(Misdeed{"ThrowsAnException", "out of luck",
                            [](const Problem&) -> Result<Solution> {
                              throw std::runtime_error("out of luck");
                            }},
                    Misdeed{"ThrowsANumber", "threw",
                            [](const Problem&) -> Result<Solution> { throw 7; }},
                    Misdeed{"Fails", "not my kind",
                            [](const Problem&) -> Result<Solution> {
                              return fail(ErrorCode::kInvalidArgument, "not my kind of problem");
                            }},
                    Misdeed{"ReturnsNaN", "is not a finite number",
                            [](const Problem& problem) {
                              Trajectory broken = proper(problem);
                              broken.positions.back() = std::numeric_limits<double>::quiet_NaN();
                              return found(broken);
                            }},
                    Misdeed{"ReturnsNothingAndSaysItConverged", "has no joints",
                            [](const Problem&) { return found({}); }},
                    Misdeed{"ReturnsAnotherRobotsMotion", "it moves 2 joints, the robot has 3",
                            [](const Problem&) { return found(make_trajectory(2, 5, 0.3)); }},
                    Misdeed{"ReturnsTimesThatGoBack", "times do not increase",
                            [](const Problem& problem) {
                              Trajectory broken = proper(problem);
                              broken.times_s.back() = -1.0;
                              return found(broken);
                            }},
                    Misdeed{"ReturnsTooFewNumbers", "needs 6 positions",
                            [](const Problem& problem) {
                              Trajectory broken = proper(problem);
                              broken.velocities.pop_back();
                              return found(broken);
                            }},
                    Misdeed{"StartsElsewhere", "starts with joint 'y' 0.5 m",
                            [](const Problem& problem) {
                              Trajectory broken = proper(problem);
                              broken.q(0)[1] += 0.5;
                              return found(broken);
                            }}),
    [](const auto& misdeed) { return misdeed.param.name; });

TEST(ReplannerFaults, APlanThatEndsElsewhereOrBreaksPositionLimitsIsNoPlan) {
  for (const double beyond : {0.5, 12.0}) {
    ClosedLoop loop;
    loop.planner.misbehave = [&](const Problem& problem, const Trajectory&,
                                 const Deadline&) -> std::optional<Result<Solution>> {
      if (beyond < 1.0) {
        Trajectory off = proper(problem);
        off.q(1)[2] += beyond;
        return found(off);
      }
      return found(DetourPlanner::through(
          {problem.start.q, Eigen::Vector3d(2.0, beyond, 0.0), problem.goal.q},
          problem.start.qdot));
    };
    loop.run(1.0);
    EXPECT_EQ(loop.executor.follows, 0);
    ASSERT_NE(loop.first(Kind::kReplanFailed), nullptr);
    EXPECT_THAT(loop.first(Kind::kReplanFailed)->cause,
                HasSubstr(beyond < 1.0 ? "it ends with" : "beyond its upper limit"));
  }
}

TEST(ReplannerFaults, ABreakerOfSpeedLimitsIsSlowedDown) {
  ClosedLoop loop;
  loop.planner.misbehave = [](const Problem& problem, const Trajectory&,
                              const Deadline&) -> std::optional<Result<Solution>> {
    Trajectory fast = proper(problem);
    for (double& t : fast.times_s) t *= 0.1;
    return found(fast);
  };
  loop.run(20.0);
  EXPECT_EQ(loop.status, Status::kReached);
  EXPECT_LE(loop.largest_velocity_step,
            ClosedLoop::kAcceleration * ClosedLoop::kStep_s * (1.0 + 1e-3));
}

TEST(ReplannerFaults, AnOptimiserPastItsDeadlineStopsTheRobot) {
  ReplannerSettings settings = ClosedLoop::defaults();
  settings.limit_wall_time = true;
  settings.solve_limit_s = 1e-3;
  settings.takeover_s = 2e-3;
  ClosedLoop loop(settings);
  loop.planner.misbehave = [](const Problem&, const Trajectory&,
                              const Deadline& deadline) -> std::optional<Result<Solution>> {
    const Stopwatch watch;
    while (!deadline.expired() || watch.elapsed_ms() < 5.0) {
    }
    Solution late;
    late.status = SolveStatus::kDeadline;
    return late;
  };
  loop.run(0.1);
  ASSERT_NE(loop.first(Kind::kStopped), nullptr) << loop.story();
  EXPECT_EQ(loop.first(Kind::kStopped)->reason, Reason::kPlugin);
  EXPECT_THAT(loop.first(Kind::kStopped)->cause, HasSubstr("optimiser detour took"));
  EXPECT_EQ(loop.executor.follows, 0);
}

TEST(ReplannerFaults, ASearchAtRestLastsLongerThanOneOnTheMove) {
  ReplannerSettings settings = ClosedLoop::defaults();
  settings.limit_wall_time = true;
  settings.solve_limit_s = 0.02;
  settings.takeover_s = 0.4;
  ClosedLoop loop(settings);
  double most_at_rest_s = 0.0, most_moving_s = 0.0;
  loop.planner.misbehave = [&](const Problem& problem, const Trajectory&,
                               const Deadline& deadline) -> std::optional<Result<Solution>> {
    double& most_s = problem.start.qdot.isZero() ? most_at_rest_s : most_moving_s;
    most_s = std::max(most_s, deadline.remaining_s());
    return std::nullopt;
  };
  loop.run(1.0);
  loop.obstacles = {{{3.0, 0.0, 0.0}, 0.3}};
  loop.run(3.0);
  EXPECT_GT(most_at_rest_s, 0.1);
  EXPECT_LE(most_at_rest_s, 0.2);
  EXPECT_GT(most_moving_s, 0.0);
  EXPECT_LE(most_moving_s, 0.02);
}

TEST(ReplannerFaults, WhatThrowsElsewhereStopsTheRobotToo) {
  ClosedLoop loop;
  const auto pose = loop.pose;
  bool is_broken = false;
  loop.pose = [&, pose](std::shared_ptr<const DistanceField> field, const RobotState& start,
                        const RobotState& goal) {
    if (is_broken) throw std::runtime_error("no such goal");
    return pose(std::move(field), start, goal);
  };
  loop.run(30.0, [&](double t) {
    is_broken = t >= 1.0 && t < 4.0;
    if (t >= 1.0) loop.obstacles = {{{3.0, 0.0, 0.0}, 0.3}};
  });
  expect_stop_and_recovery(loop, Reason::kPlugin, "no such goal");
  EXPECT_GE(loop.executor.stops, 1);
}

}  // namespace
}  // namespace sidestep
