#include <limits>
#include <set>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "closed_loop.hpp"

namespace sidestep {
namespace {

using testing::HasSubstr;
using testing_support::ClosedLoop;
using Kind = ReplannerEvent::Kind;
using Measured = Executor::Measured;
using Reason = ReplannerEvent::Reason;
using Status = Replanner::Status;

constexpr double kNan = std::numeric_limits<double>::quiet_NaN();

TEST(ReplannerInputs, AStateThatIsNotOfTheRobotStopsIt) {
  const std::vector<std::function<void(Measured&)>> faults{
      [](Measured& m) { m.state.q.conservativeResize(2); },
      [](Measured& m) { m.state.qdot.conservativeResize(2); },
      [](Measured& m) { m.state.q[1] = kNan; },
      [](Measured& m) { m.state.qdot[2] = std::numeric_limits<double>::infinity(); }};
  for (const auto& fault : faults) {
    ClosedLoop loop;
    double speed = 1.0;
    loop.run(30.0, [&](double t) {
      loop.executor.distort = t >= 1.0 && t < 4.0 ? fault : nullptr;
      if (t >= 3.9 && t < 4.0) speed = loop.executor.state().qdot.norm();
    });
    EXPECT_EQ(speed, 0.0);
    const ReplannerEvent* stopped = loop.first(Kind::kStopped);
    ASSERT_NE(stopped, nullptr) << loop.story();
    EXPECT_EQ(stopped->reason, Reason::kExecutor);
    EXPECT_NEAR(stopped->stamp.seconds(), 1.0, 0.01);
    EXPECT_THAT(stopped->cause,
                HasSubstr("executor fake measured a state that is not of the robot"));
    EXPECT_EQ(loop.count(Kind::kStopped), 1) << loop.story();
    EXPECT_EQ(loop.status, Status::kReached) << loop.story();
  }
}

TEST(ReplannerInputs, AnExecutorNeedNotMeasureVelocities) {
  ClosedLoop loop;
  loop.executor.distort = [](Measured& m) { m.state.qdot.resize(0); };
  loop.run(30.0);
  EXPECT_EQ(loop.status, Status::kReached) << loop.story();
  EXPECT_EQ(loop.count(Kind::kStopped), 0) << loop.story();
  EXPECT_LT((loop.executor.state().q - ClosedLoop::goal().q).norm(), 0.05);
}

class BallAboveZero final : public testing_support::BallRobot {
 public:
  BallAboveZero() : BallRobot(ClosedLoop::kRadius_m) { description_.joints[1].lower = 0.0; }
};

/// Encoders say a little more than a joint can be; plans begin where it can.
TEST(ReplannerInputs, AMeasurementALittleBeyondALimitIsWithin) {
  for (const double beyond : {0.005, 0.015}) {
    ClosedLoop loop;
    loop.robot = std::make_shared<BallAboveZero>();
    std::vector<double> starts;
    loop.planner.misbehave = [&](const Problem& problem, const Trajectory&, const Deadline&) {
      starts.push_back(problem.start.q[1]);
      return std::nullopt;
    };
    loop.executor.offset.y() = -beyond;
    loop.run(0.2);
    if (beyond < 0.01) {
      ASSERT_FALSE(starts.empty()) << loop.story();
      EXPECT_EQ(starts.front(), 0.0);
    } else {
      EXPECT_TRUE(starts.empty());
      EXPECT_THAT(loop.story(), HasSubstr("joint y of the start is at -0.015, outside its limits"));
    }
  }
}

TEST(ReplannerInputs, AStateThatIsOldStopsTheRobotAndOneThatIsNotDoesNot) {
  for (const double age_s : {0.19, 0.21}) {
    ClosedLoop loop;
    loop.executor.distort = [&](Measured& m) {
      m.stamp = Stamp::from_seconds(m.stamp.seconds() - age_s);
    };
    loop.run(0.08);  // it stands: the old state is the new one
    EXPECT_EQ(loop.count(Kind::kPlanned), age_s < 0.2 ? 1 : 0) << loop.story();
    ASSERT_EQ(loop.count(Kind::kStopped), age_s < 0.2 ? 0 : 1) << loop.story();
    if (age_s < 0.2) continue;
    EXPECT_EQ(loop.first(Kind::kStopped)->reason, Reason::kExecutor);
    EXPECT_THAT(loop.first(Kind::kStopped)->cause,
                HasSubstr("the newest state of executor fake is 0.21 s old"));
  }
}

// Ten times a second, until it succeeds; once more would change nothing.
TEST(ReplannerInputs, AStopThatFailsIsAskedForAgainEveryPeriod) {
  ClosedLoop loop;
  int requests_by_2_s = 0, requests_by_4_s = 0;
  loop.run(4.1, [&](double t) {
    loop.executor.is_silent = t >= 1.0;
    loop.executor.refuses_to_stop = t < 2.0;
    if (t < 2.0) requests_by_2_s = loop.executor.stop_requests;
    if (t < 4.0) requests_by_4_s = loop.executor.stop_requests;
  });
  EXPECT_GE(requests_by_2_s, 9);
  EXPECT_LE(requests_by_2_s, 11);
  EXPECT_EQ(loop.executor.stops, 1);
  EXPECT_EQ(requests_by_4_s, requests_by_2_s + 1);
  EXPECT_EQ(loop.executor.state().qdot.norm(), 0.0);
}

TEST(ReplannerInputs, AnEndJustBeforeTheGoalSendsNoStop) {
  ReplannerSettings settings = ClosedLoop::defaults();
  settings.stop_lead_s = 0.1;
  double end_s = 0.0;
  {
    ClosedLoop whole(settings);
    whole.run(0.1);
    ASSERT_GT(whole.replanner->followed().size(), 0);
    end_s = whole.replanner->followed_start().seconds() + whole.replanner->followed().duration_s();
  }
  for (const double before_s : {0.06, 0.4}) {
    ClosedLoop loop(settings);
    loop.run(end_s - before_s);
    ASSERT_EQ(loop.status, Status::kMoving) << loop.story();
    const int follows = loop.executor.follows;
    loop.judged->stop(*loop.replanner, loop.executor.now, "enough", loop.events);
    // A stop begins 0.1 s later, when the motion is over anyhow, or is not.
    EXPECT_EQ(loop.executor.follows - follows, before_s < settings.stop_lead_s ? 0 : 1)
        << loop.story();
    EXPECT_EQ(loop.executor.stops, 0);
    EXPECT_EQ(loop.count(Kind::kStopped), 1);
    loop.executor.now = Stamp::from_seconds(end_s + 2.0);
    EXPECT_EQ(loop.executor.state().qdot.norm(), 0.0);
  }
}

TEST(ReplannerInputs, AnEndIsNothingToARobotThatStands) {
  ClosedLoop loop;
  loop.maps = false;
  loop.run(0.1);
  loop.judged->stop(*loop.replanner, loop.executor.now, "enough", loop.events);
  EXPECT_TRUE(loop.events.empty()) << loop.story();
  EXPECT_EQ(loop.executor.stop_requests, 0);
}

// At 0.5 m/s and 1 m/s^2 it needs 0.125 m and finds 0.06 m.
TEST(ReplannerInputs, WhereNoStopIsClearTheExecutorStopsByItself) {
  ClosedLoop loop;
  double gap_m = 1.0;
  loop.run(2.5, [&](double t) {
    if (t < 2.0 || !loop.obstacles.empty()) return;
    const double front_m = loop.executor.state().q.x() + ClosedLoop::kRadius_m;
    loop.obstacles = {{{front_m + 0.06 + 1.0, 0.0, 0.0}, 1.0}};
    gap_m = loop.obstacles[0].distance_m(loop.executor.state().q) - ClosedLoop::kRadius_m;
  });
  EXPECT_NEAR(gap_m, 0.06, 1e-9);
  const ReplannerEvent* stopped = loop.first(Kind::kStopped);
  ASSERT_NE(stopped, nullptr) << loop.story();
  EXPECT_EQ(stopped->reason, Reason::kBlocked);
  EXPECT_THAT(stopped->cause, HasSubstr("no stop is clear of obstacles"));
  EXPECT_EQ(loop.executor.stops, 1);
}

TEST(ReplannerInputs, NoMotionBeginsThatIsObjectedTo) {
  ClosedLoop loop;
  bool is_objecting = true;
  int asked = 0;
  loop.objection = [&](const Trajectory& motion) -> std::string {
    EXPECT_GT(motion.size(), 0);
    ++asked;
    return is_objecting ? "the head is not at rest" : "";
  };
  loop.run(1.0);
  EXPECT_GT(asked, 0);
  EXPECT_EQ(loop.executor.follows, 0) << loop.story();
  ASSERT_NE(loop.first(Kind::kReplanFailed), nullptr) << loop.story();
  EXPECT_THAT(loop.first(Kind::kReplanFailed)->cause, HasSubstr("the head is not at rest"));
  is_objecting = false;
  loop.run(30.0);
  EXPECT_EQ(loop.status, Status::kReached) << loop.story();
}

TEST(ReplannerEvents, HaveNamesOfTheirOwn) {
  std::set<std::string_view> kinds, reasons;
  for (int kind = 0; kind <= static_cast<int>(Kind::kReached); ++kind) {
    EXPECT_TRUE(kinds.insert(to_string(static_cast<Kind>(kind))).second) << kind;
  }
  for (int reason = 0; reason <= static_cast<int>(Reason::kEnd); ++reason) {
    EXPECT_TRUE(reasons.insert(to_string(static_cast<Reason>(reason))).second) << reason;
  }
  EXPECT_FALSE(kinds.contains(""));
  EXPECT_FALSE(reasons.contains(""));
}

}  // namespace
}  // namespace sidestep
