#include <numbers>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "closed_loop.hpp"

namespace sidestep {
namespace {

using testing::HasSubstr;
using testing_support::Ball;
using testing_support::ClosedLoop;
using Kind = ReplannerEvent::Kind;
using Reason = ReplannerEvent::Reason;
using Status = Replanner::Status;

constexpr double kSpeed_mps = 0.5;
constexpr double kHunterRadius_m = 0.3;

ReplannerSettings anticipating(double speed_mps) {
  ReplannerSettings settings = ClosedLoop::defaults();
  settings.obstacle_speed_mps = speed_mps;
  return settings;
}

/// Makes straight for wherever the robot is, as fast as it may.
struct Hunt {
  explicit Hunt(const ReplannerSettings& settings, Eigen::Vector3d from_m) : loop(settings) {
    loop.limits.acceleration = {0.25, 0.25, 0.25};
    loop.limits.velocity = {0.4, 0.4, 0.4};
    loop.tells_what_moves = true;
    loop.obstacles = {Ball{from_m, kHunterRadius_m}};
  }

  /// Until the robot is touched, or for so long.
  void run(double until_s, const std::function<void()>& before = {}) {
    loop.run(until_s, [&](double) {
      if (before) before();
      if (touched) return;
      Ball& hunter = loop.obstacles.front();
      const RobotState robot = loop.executor.state();
      const Eigen::Vector3d way = robot.q - hunter.centre_m;
      hunter.centre_m += kSpeed_mps * ClosedLoop::kStep_s * way.normalized();
      if (hunter.distance_m(robot.q) > ClosedLoop::kRadius_m) return;
      touched = true;
      speed_when_touched = robot.qdot.norm();
    });
  }

  ClosedLoop loop;
  bool touched = false;
  double speed_when_touched = 0.0;
};

class HuntedRobot : public testing::TestWithParam<double> {};

TEST_P(HuntedRobot, IsAtRestBeforeItIsReached) {
  const double angle = GetParam();
  for (const double distance_m : {1.0, 1.8, 3.0}) {
    Hunt hunt(anticipating(kSpeed_mps),
              distance_m * Eigen::Vector3d(std::cos(angle), std::sin(angle), 0.0));
    hunt.run(20.0);
    // It cannot get away, but at its goal, where it rests, it is done.
    ASSERT_TRUE(hunt.touched || hunt.loop.status == Status::kReached) << distance_m;
    EXPECT_LT(hunt.speed_when_touched, 1e-6) << distance_m << "\n" << hunt.loop.story();
  }
}
INSTANTIATE_TEST_SUITE_P(FromAround, HuntedRobot,
                         testing::Values(0.0, 0.4, 0.8, 0.5 * std::numbers::pi, 2.5,
                                         std::numbers::pi, -0.3, -1.2));

TEST(ReplannerMoving, KeepsSpeedAndSeparationFromWhoeverIsTracked) {
  // He stands still for 3 s beside the way, and then walks up at 1.6 m/s.
  ReplannerSettings settings = anticipating(0.0);
  settings.safety = "ssm";
  settings.intrusion_m = 0.25;
  ClosedLoop loop(settings);
  loop.limits.braking = {2.0, 2.0, 2.0};
  Eigen::Vector3d person_m(2.0, 1.5, 0.0);
  loop.tracks = [&](Stamp stamp) {
    Track track;
    track.id = 1;
    track.position_m = person_m.head<2>();
    track.covariance.setZero();
    track.radius_m = kHunterRadius_m;
    track.bottom_m = -0.1;
    track.top_m = 0.1;
    track.last_seen = stamp;
    return std::make_shared<const Tracks>(Tracks{{track}, stamp});
  };
  double apart_m = std::numeric_limits<double>::infinity();
  double farthest_m = 0.0;
  loop.run(12.0, [&](double t) {
    const RobotState robot = loop.executor.state();
    const Eigen::Vector3d way = robot.q - person_m;
    if (t > 3.0 && way.norm() > 0.01) {
      person_m += kWalkingSpeed_mps * ClosedLoop::kStep_s * way.normalized();
    }
    farthest_m = std::max(farthest_m, robot.q.x());
    if (robot.qdot.norm() < 1e-6) return;
    apart_m = std::min(apart_m, way.norm() - kHunterRadius_m - ClosedLoop::kRadius_m);
  });
  EXPECT_GT(farthest_m, 0.3) << loop.story();
  EXPECT_GT(apart_m, settings.intrusion_m) << loop.story();
  EXPECT_LT(apart_m, 1.5) << "he never came near\n" << loop.story();
}

/// A meeting on the robot's way, which is straight whatever stands on it.
struct HeadOn {
  double apart_m = 0.0;             ///< When the robot is first slowed down.
  double gained = 0.0, lost = 0.0;  ///< The most of speed, per s.
};

HeadOn meet_head_on(double planned, std::vector<double> braking) {
  Hunt hunt(anticipating(kSpeed_mps), {5.0, 0.0, 0.0});
  ClosedLoop& loop = hunt.loop;
  loop.limits.acceleration = {planned, planned, planned};
  loop.limits.braking = std::move(braking);
  loop.planner.misbehave = [](const Problem& problem, const Trajectory&, const Deadline&) {
    return std::optional<Result<Solution>>(testing_support::DetourPlanner::straight(problem));
  };
  HeadOn meeting;
  double before = 0.0;
  hunt.run(20.0, [&] {
    const double v = loop.executor.state().qdot.x();
    meeting.gained = std::max(meeting.gained, (v - before) / ClosedLoop::kStep_s);
    meeting.lost = std::max(meeting.lost, (before - v) / ClosedLoop::kStep_s);
    before = v;
    if (meeting.apart_m > 0.0 || loop.count(Kind::kSlowed) == 0) return;
    meeting.apart_m = (loop.obstacles.front().centre_m - loop.executor.state().q).norm();
  });
  EXPECT_LT(hunt.speed_when_touched, 1e-6) << loop.story();
  EXPECT_GT(meeting.apart_m, 0.0) << loop.story();
  return meeting;
}

// A robot of the same planning limits that brakes harder slows down later, and sets out no faster.
TEST(ReplannerMoving, BrakesByTheLimitOfStopsAndSetsOutByThatOfMotions) {
  constexpr double kPlanned = 0.25, kHard = 2.0, kCruise = 0.4;
  const HeadOn soft = meet_head_on(kPlanned, {}),
               hard = meet_head_on(kPlanned, {kHard, kHard, kHard});
  for (const auto& [meeting, brakes] : {std::pair(soft, kPlanned), {hard, kHard}}) {
    EXPECT_LE(meeting.gained, kPlanned * 1.001);
    EXPECT_NEAR(meeting.lost, brakes, 1e-2 * brakes);
  }
  // While the robot stops it comes v^2 / 2b nearer, and what walks up by what it walks in v / b.
  const auto nearer_m = [](double b) {
    return 0.5 * kCruise * kCruise / b + kSpeed_mps * kCruise / b;
  };
  EXPECT_NEAR(soft.apart_m - hard.apart_m, nearer_m(kPlanned) - nearer_m(kHard), 0.05);
}

TEST(ReplannerMoving, WouldBeReachedAtSpeedIfItDidNotAnticipate) {
  Hunt hunt(anticipating(0.0), {3.0, 0.0, 0.0});
  hunt.run(20.0);
  ASSERT_TRUE(hunt.touched);
  EXPECT_GT(hunt.speed_when_touched, 0.05) << hunt.loop.story();
}

TEST(ReplannerMoving, SlowsDownForWhatPassesAndGoesOn) {
  ClosedLoop loop(anticipating(kSpeed_mps));
  loop.tells_what_moves = true;
  loop.limits.acceleration = {0.25, 0.25, 0.25};
  loop.limits.velocity = {0.4, 0.4, 0.4};
  loop.obstacles = {Ball{{2.5, -3.0, 0.0}, kHunterRadius_m}};
  loop.run(60.0, [&](double t) { loop.obstacles.front().centre_m.y() = -3.0 + 0.4 * t; });
  EXPECT_EQ(loop.status, Status::kReached) << loop.story();
  EXPECT_GT(loop.least_clearance_m, 0.0) << loop.story();
  const ReplannerEvent* slowed = loop.first(Kind::kSlowed);
  ASSERT_NE(slowed, nullptr) << loop.story();
  EXPECT_EQ(slowed->reason, Reason::kMoving);
  EXPECT_THAT(slowed->cause, HasSubstr("could reach"));
  EXPECT_LE(loop.largest_velocity_step, 0.25 * ClosedLoop::kStep_s * (1.0 + 1e-3));
}

TEST(ReplannerMoving, DoesNotSetOutWhileItCouldBeReachedAtOnce) {
  ClosedLoop loop(anticipating(kSpeed_mps));
  loop.tells_what_moves = true;
  loop.obstacles = {Ball{{0.0, 0.6, 0.0}, kHunterRadius_m}};
  loop.run(3.0);
  EXPECT_EQ(loop.status, Status::kWaiting) << loop.story();
  EXPECT_EQ(loop.planner.solves, 0);
  EXPECT_EQ(loop.count(Kind::kStopped), 1) << loop.story();
  loop.obstacles.clear();
  loop.run(20.0);
  EXPECT_EQ(loop.status, Status::kReached) << loop.story();
}

}  // namespace
}  // namespace sidestep
