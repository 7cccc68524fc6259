#include <chrono>
#include <random>
#include <thread>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "closed_loop.hpp"

namespace sidestep {
namespace {

using testing::ElementsAre;
using testing::HasSubstr;
using testing_support::Ball;
using testing_support::BallField;
using testing_support::Balls;
using testing_support::ClosedLoop;
using testing_support::DetourPlanner;
using testing_support::expect_goal;
using Kind = ReplannerEvent::Kind;
using Reason = ReplannerEvent::Reason;
using Status = Replanner::Status;

const Ball kInTheWay{{2.5, 0.0, 0.0}, 0.3};
/// As wide as the map is.
const Ball kWall{{5.0, 0.0, 0.0}, 2.2};

/// No joint may change its speed by more than the limit allows in a step.
void expect_continuous(const ClosedLoop& loop) {
  EXPECT_LE(loop.largest_velocity_step,
            ClosedLoop::kAcceleration * ClosedLoop::kStep_s * (1.0 + 1e-3));
}

TEST(Replanner, GoesToAGoalAndStays) {
  ClosedLoop loop;
  loop.run(20.0);
  expect_goal(loop);
  expect_continuous(loop);
  EXPECT_THAT(loop.events, ElementsAre(testing::Field(&ReplannerEvent::kind, Kind::kPlanned),
                                       testing::Field(&ReplannerEvent::kind, Kind::kReached)))
      << loop.story();
  // 4 m from rest to rest at no more than 1 m/s and 1 m/s^2 take 5 s, and the start a takeover.
  EXPECT_NEAR(loop.events.back().stamp.seconds(), 5.1, 0.1);
  EXPECT_EQ(loop.replanner->step(Stamp::from_seconds(30.0), loop.events), Status::kReached);
  EXPECT_EQ(loop.events.size(), 2U);
}

TEST(Replanner, WaitsForAMap) {
  ClosedLoop loop;
  loop.maps = false;
  loop.run(0.4);
  EXPECT_EQ(loop.status, Status::kWaiting);
  EXPECT_TRUE(loop.events.empty()) << loop.story();
  EXPECT_EQ(loop.replanner->followed().size(), 0);
}

TEST(Replanner, AvoidsWhatAppearsWithoutASlowStep) {
  ClosedLoop loop;
  loop.run(20.0, [&](double t) {
    if (t >= 1.0) loop.obstacles = {kInTheWay};
  });
  expect_goal(loop);
  expect_continuous(loop);
  EXPECT_GT(loop.least_clearance_m, 0.0);
  const ReplannerEvent* replanned = loop.first(Kind::kReplanned);
  ASSERT_NE(replanned, nullptr) << loop.story();
  EXPECT_EQ(replanned->reason, Reason::kBlocked);
  EXPECT_THAT(replanned->cause, HasSubstr("ball is"));
  EXPECT_THAT(replanned->cause, HasSubstr("an obstacle at (2."));
  EXPECT_THAT(replanned->cause, HasSubstr(" s"));
  EXPECT_LE(replanned->splice_velocity_jump, 1e-5);
  EXPECT_NEAR(replanned->takeover.seconds() - replanned->stamp.seconds(), 0.1, 1e-9);
  EXPECT_EQ(loop.count(Kind::kStopped), 0) << loop.story();
}

TEST(Replanner, GoesStraightOnceWhatItGoesAroundHasGone) {
  const Ball wide{{2.0, 0.0, 0.0}, 0.7};
  const auto arrival_s = [&](double gone_s) {
    ClosedLoop loop;
    loop.limits.velocity = {1.0, 0.4, 1.0};  // sideways is slow
    loop.run(30.0, [&](double t) { loop.obstacles = t < gone_s ? Balls{wide} : Balls{}; });
    expect_goal(loop);
    expect_continuous(loop);
    EXPECT_GT(loop.least_clearance_m, 0.0);
    const bool is_sooner = std::ranges::any_of(loop.events, [](const ReplannerEvent& event) {
      return event.kind == Kind::kReplanned && event.reason == Reason::kSooner;
    });
    EXPECT_EQ(is_sooner, gone_s < 30.0) << loop.story();
    return loop.events.back().stamp.seconds();
  };
  EXPECT_LT(arrival_s(1.0), arrival_s(30.0) - 1.0);
}

TEST(Replanner, StopsBeforeWhatItCannotPassAndGoesOnWhenItIsGone) {
  ClosedLoop loop;
  loop.planner.misbehave = [&](const Problem&, const Trajectory&,
                               const Deadline&) -> std::optional<Result<Solution>> {
    if (loop.mapped.empty()) return std::nullopt;
    Solution none;
    none.status = SolveStatus::kNoPath;
    none.reason = "walled in";
    return none;
  };
  bool was_at_rest = false;
  loop.run(30.0, [&](double t) {
    if (t >= 1.0 && t < 10.0) loop.obstacles = {kWall};
    if (t >= 10.0) loop.obstacles.clear();
    if (t > 9.0 && t < 10.0) was_at_rest = loop.executor.state().qdot.norm() == 0.0;
  });
  EXPECT_TRUE(was_at_rest);
  EXPECT_GT(loop.least_clearance_m, 0.0);
  expect_goal(loop);
  expect_continuous(loop);
  EXPECT_EQ(loop.executor.stops, 0);
  const ReplannerEvent* stopped = loop.first(Kind::kStopped);
  ASSERT_NE(stopped, nullptr) << loop.story();
  EXPECT_EQ(stopped->reason, Reason::kBlocked);
  EXPECT_THAT(stopped->cause, HasSubstr("ball is"));
  EXPECT_EQ(loop.count(Kind::kStopped), 1) << loop.story();
  const ReplannerEvent* failed = loop.first(Kind::kReplanFailed);
  ASSERT_NE(failed, nullptr);
  EXPECT_THAT(failed->cause, HasSubstr("walled in"));
  const ReplannerEvent* recovered = loop.first(Kind::kRecovered);
  ASSERT_NE(recovered, nullptr);
  EXPECT_GE(recovered->stamp.seconds(), 10.0);
}

TEST(Replanner, TellsTheWayToItsGoalAlsoWhileItStandsBeforeAWall) {
  ClosedLoop loop;
  loop.make();
  EXPECT_EQ(loop.replanner->way().trajectory, nullptr);
  const auto expect_way = [&] {
    const Replanner::Way way = loop.replanner->way();
    ASSERT_NE(way.trajectory, nullptr);
    std::array<double, 3> here{}, end{};
    way.trajectory->sample(way.from_s, here, {});
    way.trajectory->sample(way.trajectory->duration_s(), end, {});
    EXPECT_NEAR(here[0], loop.executor.state().q[0], 0.02);
    EXPECT_NEAR(end[0], 4.0, 1e-6);
  };
  loop.run(0.9);
  expect_way();
  EXPECT_EQ(loop.replanner->way().followed, &loop.replanner->followed());
  EXPECT_EQ(loop.replanner->way().followed_s, loop.replanner->way().from_s);
  loop.planner.misbehave = [](const Problem&, const Trajectory&,
                              const Deadline&) -> std::optional<Result<Solution>> {
    Solution none;
    none.status = SolveStatus::kNoPath;
    none.reason = "walled in";
    return none;
  };
  loop.obstacles = {kWall};
  loop.run(9.0);
  EXPECT_EQ(loop.executor.state().qdot.norm(), 0.0);
  expect_way();
  EXPECT_EQ(loop.replanner->way().followed, nullptr);
}

TEST(Replanner, DoesNotStopLongBeforeItMust) {
  // Half a metre per second: 0.5 s to stop, 1.5 times that in reserve, a period and a lead.
  ClosedLoop loop;
  loop.limits.velocity = {0.5, 0.5, 0.5};
  loop.planner.misbehave = [&](const Problem& problem, const Trajectory&,
                               const Deadline&) -> std::optional<Result<Solution>> {
    if (loop.mapped.empty()) return std::nullopt;
    (void)problem;
    Solution none;
    none.status = SolveStatus::kNoPath;
    return none;
  };
  loop.run(20.0, [&](double t) {
    if (t >= 1.0) loop.obstacles = {kWall};
  });
  // The wall begins at 2.8 m, the ball's centre may come to 2.6 m.
  EXPECT_GT(loop.least_clearance_m, 0.0);
  EXPECT_LT(loop.least_clearance_m, 0.5 * (0.75 + 0.1 + 0.1 + 0.02) - 0.125 + 0.02);
}

TEST(Replanner, StopsForWhatAppearsTooNearToReplan) {
  ClosedLoop loop;
  // At 1 m/s from 1.1 s on, at about 1.4 m at 2 s: 0.5 m to stop.
  loop.run(6.0, [&](double t) {
    if (t >= 2.0) loop.obstacles = {{{3.0, 0.0, 0.0}, 0.75}};
  });
  EXPECT_GT(loop.least_clearance_m, 0.0);
  expect_continuous(loop);
}

/// Whatever appears, wherever the robot goes just then: a straight stop from speed v takes v^2 / 2a
/// at most, after a map's period, a step and the lead.
TEST(Replanner, NeverHitsWhatAppearsFartherThanItNeedsToStop) {
  int appeared = 0, reached = 0;
  for (std::uint64_t seed = 1; seed <= 16; ++seed) {
    std::mt19937_64 random(seed);
    std::uniform_real_distribution<double> x(0.0, 4.5), y(-1.0, 1.0), radius(0.1, 0.6),
        when(0.0, 6.0);
    ClosedLoop loop;
    std::vector<std::pair<double, Ball>> planned;
    for (int i = 0; i < 4; ++i)
      planned.push_back({when(random), {{x(random), y(random), 0}, radius(random)}});
    loop.run(15.0, [&](double t) {
      const RobotState at = loop.executor.state();
      const double speed = at.qdot.norm();
      const double needed_m = speed * (0.032 + 0.004 + 0.02) + 0.5 * speed * speed;
      for (auto& [time_s, ball] : planned) {
        if (t < time_s) continue;
        time_s = 1e9;
        if (ball.distance_m(at.q) - ClosedLoop::kRadius_m < needed_m + 1e-3) continue;
        loop.obstacles.push_back(ball);
        ++appeared;
      }
    });
    EXPECT_GT(loop.least_clearance_m, 0.0) << "seed " << seed << "\n" << loop.story();
    expect_continuous(loop);
    if (loop.status == Status::kReached) ++reached;
  }
  EXPECT_GE(appeared, 32);
  EXPECT_GE(reached, 1);  // the planner of these tests knows one detour only
}

TEST(Replanner, NeverFollowsAPlanInCollision) {
  ClosedLoop loop;
  loop.obstacles = {kInTheWay};
  loop.planner.misbehave = [&](const Problem& problem, const Trajectory& initial,
                               const Deadline&) -> std::optional<Result<Solution>> {
    Solution straight;  // and a lie
    straight.status = SolveStatus::kConverged;
    straight.trajectory = straight_line(problem.start, problem.goal, initial.size(), problem.dt_s);
    return straight;
  };
  loop.run(2.0);
  EXPECT_EQ(loop.status, Status::kWaiting);
  EXPECT_EQ(loop.executor.follows, 0);
  EXPECT_EQ(loop.count(Kind::kPlanned), 0);
  ASSERT_NE(loop.first(Kind::kReplanFailed), nullptr);
  EXPECT_THAT(loop.first(Kind::kReplanFailed)->cause, HasSubstr("obstacle"));
}

/// Something stands on the goal: every motion is free for a while only.
TEST(Replanner, TakesWhatIsFreeForAWhileOnceASearchHasTakenLong) {
  for (const double stopgap_after_s : {10.0, 0.001}) {
    ReplannerSettings settings;
    settings.horizon_s = 2.0;
    settings.stopgap_after_s = stopgap_after_s;
    ClosedLoop loop(settings);
    loop.obstacles = {{{4, 0, 0}, 0.2}};
    loop.planner.misbehave = [](auto&&...) -> std::optional<Result<Solution>> {
      std::this_thread::sleep_for(std::chrono::milliseconds(2));
      return std::nullopt;
    };
    loop.run(1.0);
    const ReplannerEvent* first = loop.first(ReplannerEvent::Kind::kPlanned);
    ASSERT_NE(first, nullptr) << loop.story();
    EXPECT_GT(loop.executor.state().q.x(), 0.05);
    const bool is_cut = stopgap_after_s < 1.0;
    const std::vector<std::string> all{"straight_line", "base_path", "perturbed"};
    EXPECT_EQ(first->tried, is_cut ? std::vector<std::string>{"straight_line"} : all);
    // What was not tried then is tried next.
    for (const auto& count : loop.replanner->guess_counts())
      EXPECT_GT(count.tried, 0) << count.guess;
  }
}

/// Of two motions that lead to a goal on which something stands, the one that is there sooner: not
/// that which is free for longer, for its way round.
TEST(Replanner, GoesNoLongWayRoundToAGoalOnWhichSomethingStands) {
  ReplannerSettings settings = ClosedLoop::defaults();
  settings.horizon_s = 2.0;
  ClosedLoop loop(settings);
  loop.obstacles = {{{4, 0, 0}, 0.2}};
  loop.planner.misbehave = [](const Problem& problem, const Trajectory& initial,
                              const Deadline&) -> std::optional<Result<Solution>> {
    const double bent_m = std::abs(initial.q(initial.size() / 2)[1]);
    if (bent_m < 1e-6 || problem.start.qdot.norm() > 0.0) return std::nullopt;
    Solution round;
    round.status = SolveStatus::kConverged;
    round.trajectory = DetourPlanner::through(
        {problem.start.q, {-4.0, 0.0, 0.0}, {0.0, 4.0, 0.0}, problem.goal.q}, {0.0, 0.0, 0.0});
    return round;
  };
  loop.run(5.0);
  for (const Eigen::Vector3d& p : loop.path) ASSERT_GT(p.x(), -0.01) << loop.story();
  EXPECT_GT(loop.path.back().x(), 2.0) << loop.story();
}

/// A wall that is bent around the start. The optimiser makes nothing of any guess.
TEST(Replanner, LeavesADeadEndByTheWayOfItsBase) {
  for (const bool knows_ways : {true, false}) {
    ReplannerSettings settings = ClosedLoop::defaults();
    settings.escalation = {"refit", "straight_line", knows_ways ? "base_path" : "after_stop"};
    ClosedLoop loop(settings);
    for (int i = -8; i <= 8; ++i) loop.obstacles.push_back({{2.0, 0.25 * i, 0.0}, 0.2});
    for (int i = 1; i <= 8; ++i) {
      for (const double side : {-2.0, 2.0}) {
        loop.obstacles.push_back({{2.0 - 0.25 * i, side, 0.0}, 0.2});
      }
    }
    loop.planner.misbehave = [](const Problem&, const Trajectory& initial,
                                const Deadline&) -> std::optional<Result<Solution>> {
      Solution same;
      same.status = SolveStatus::kConverged;
      same.trajectory = initial;
      return same;
    };
    loop.run(60.0);
    EXPECT_GT(loop.least_clearance_m, 0.0);
    EXPECT_EQ(loop.status == Status::kReached, knows_ways) << loop.story();
  }
}

TEST(Replanner, ChecksEachMapOnce) {
  ClosedLoop loop;
  loop.run(2.0);
  // A map every 8 steps of 500; the first one was checked as part of planning.
  EXPECT_EQ(loop.replanner->checks(), 500 / 8);
}

TEST(Replanner, LetsTheStopComeFirstForAPlannerThatStartsAtRest) {
  ClosedLoop loop;
  loop.planner.keeps_velocity = false;
  loop.run(30.0, [&](double t) {
    if (t >= 1.0) loop.obstacles = {{{3.5, 0.0, 0.0}, 0.2}};
    if (t >= 4.0) loop.obstacles.clear();
  });
  expect_goal(loop);
  expect_continuous(loop);
  EXPECT_GT(loop.least_clearance_m, 0.0);
  const ReplannerEvent* replanned = loop.first(Kind::kReplanned);
  ASSERT_NE(replanned, nullptr) << loop.story();
  EXPECT_EQ(replanned->guess, "after_stop");
  EXPECT_THAT(replanned->tried, ElementsAre("refit", "straight_line", "perturbed", "after_stop"));
  EXPECT_EQ(loop.count(Kind::kStopped), 0) << loop.story();
}

TEST(Replanner, CountsItsGuesses) {
  ClosedLoop loop;
  // Only what is bent leads anywhere.
  loop.planner.misbehave = [](const Problem& problem, const Trajectory& initial,
                              const Deadline&) -> std::optional<Result<Solution>> {
    const auto line = straight_line(problem.start, problem.goal, initial.size(), problem.dt_s);
    if (initial.positions != line.positions) return std::nullopt;
    Solution none;
    none.status = SolveStatus::kNoPath;
    return none;
  };
  loop.run(1.0);
  const ReplannerEvent* planned = loop.first(Kind::kPlanned);
  ASSERT_NE(planned, nullptr) << loop.story();
  EXPECT_EQ(planned->guess, "perturbed");
  EXPECT_EQ(planned->attempts, 2);
  std::vector<std::string> names;
  std::vector<std::int64_t> tried, led;
  for (const auto& count : loop.replanner->guess_counts()) {
    names.push_back(count.guess);
    tried.push_back(count.tried);
    led.push_back(count.led);
  }
  EXPECT_THAT(names, ElementsAre("refit", "straight_line", "perturbed", "after_stop"));
  EXPECT_THAT(tried, ElementsAre(0, 1, 1, 0));
  EXPECT_THAT(led, ElementsAre(0, 0, 1, 0));
}

TEST(Replanner, TakesTheSampledPathWhereTheOptimiserFindsNone) {
  ReplannerSettings settings = ClosedLoop::defaults();
  settings.escalation = {"straight_line", "sampled", "unheard_of"};
  ClosedLoop loop(settings);
  loop.obstacles = {kInTheWay};
  DetourPlanner sampler(loop.mapped);
  loop.sampler = &sampler;
  loop.planner.misbehave = [](const Problem&, const Trajectory&, const Deadline&) {
    Solution none;
    none.status = SolveStatus::kNoPath;
    return std::optional<Result<Solution>>(none);
  };
  loop.run(20.0);
  expect_goal(loop);
  EXPECT_GT(loop.least_clearance_m, 0.0);
  EXPECT_EQ(loop.first(Kind::kPlanned)->guess, "sampled");
}

TEST(Replanner, TheSameInputsGiveTheSameEventsAndMotion) {
  const auto run = [] {
    auto loop = std::make_unique<ClosedLoop>();
    loop->run(20.0, [&](double t) {
      if (t >= 1.0) loop->obstacles = {kInTheWay};
      if (t >= 2.5) loop->obstacles = {{{3.4, 0.5, 0.0}, 0.3}};
      if (t >= 4.0) loop->obstacles = {kWall};
      if (t >= 7.0) loop->obstacles.clear();
    });
    return loop;
  };
  const auto one = run(), other = run();
  EXPECT_EQ(one->story(), other->story());
  ASSERT_EQ(one->path.size(), other->path.size());
  for (std::size_t i = 0; i < one->path.size(); ++i) ASSERT_EQ(one->path[i], other->path[i]);
  EXPECT_GE(one->events.size(), 4U);
}

/// Planners that swerve to one side and then the other, by turns, through a map that a ball far
/// from both makes a little costlier each time.
int changes_of_mind(double hysteresis) {
  ReplannerSettings settings = ClosedLoop::defaults();
  settings.cost_tolerance = 0.05;
  settings.hysteresis = hysteresis;
  ClosedLoop loop(settings);
  const auto plain = loop.pose;
  loop.pose = [&, plain](std::shared_ptr<const DistanceField> field, const RobotState& start,
                         const RobotState& goal) {
    Problem problem = plain(std::move(field), start, goal);
    problem.terms = standard_terms(problem, {.epsilon_m = 1.0, .sigma_obstacle = 0.2});
    return problem;
  };
  loop.obstacles = {{{2.2, 0.0, 0.0}, 0.3}};
  double side = 1.0;
  loop.run(4.0, [&](double t) {
    // As much on the one side as on the other, now here, now there: costlier where the robot goes.
    side = static_cast<int>(t / 0.3) % 2 == 0 ? 1.0 : -1.0;
    loop.planner.side = -side;
    loop.obstacles = {{{2.2, 0.02 * side, 0.0}, 0.3}};
  });
  EXPECT_GT(loop.least_clearance_m, 0.0);
  EXPECT_EQ(loop.count(Kind::kStopped), 0) << loop.story();
  return loop.count(Kind::kReplanned);
}

TEST(Replanner, DoesNotAlternateBetweenEquallyGoodPlans) {
  EXPECT_EQ(changes_of_mind(0.5), 0);
  EXPECT_GE(changes_of_mind(0.0), 1);
}

TEST(Replanner, PutsOffNoSearchToCompareCosts) {
  const auto replanned_s = [](double cost_tolerance, double blocked_s) {
    ReplannerSettings settings = ClosedLoop::defaults();
    settings.cost_tolerance = cost_tolerance;
    ClosedLoop loop(settings);
    loop.run(2.0, [&](double t) {
      if (t >= blocked_s) loop.obstacles = {{{2.5, 0.0, 0.0}, 0.3}};
    });
    const ReplannerEvent* replanned = loop.first(Kind::kReplanned);
    return replanned == nullptr ? -1.0 : replanned->stamp.seconds();
  };
  for (const double blocked_s : {0.5, 0.53, 0.56, 0.59}) {
    EXPECT_GE(replanned_s(0.0, blocked_s), blocked_s);
    EXPECT_EQ(replanned_s(1e9, blocked_s), replanned_s(0.0, blocked_s));
  }
}

TEST(Replanner, TakesAMuchCheaperPlanThoughItsOwnIsValid) {
  ReplannerSettings settings = ClosedLoop::defaults();
  settings.cost_tolerance = 0.05;
  ClosedLoop loop(settings);
  const auto plain = loop.pose;
  loop.pose = [&, plain](std::shared_ptr<const DistanceField> field, const RobotState& start,
                         const RobotState& goal) {
    Problem problem = plain(std::move(field), start, goal);
    problem.terms = standard_terms(problem, {.epsilon_m = 1.0, .sigma_obstacle = 0.05});
    return problem;
  };
  loop.run(20.0, [&](double t) {
    // Beside the path: 0.1 m clear.
    if (t >= 0.5) loop.obstacles = {{{2.5, 0.6, 0.0}, 0.3}};
    loop.planner.side = -1.0;
  });
  expect_goal(loop);
  expect_continuous(loop);
  const ReplannerEvent* replanned = loop.first(Kind::kReplanned);
  ASSERT_NE(replanned, nullptr) << loop.story();
  EXPECT_EQ(replanned->reason, Reason::kCost);
  EXPECT_GT(loop.least_clearance_m, 0.15);
}

}  // namespace
}  // namespace sidestep
