#include <algorithm>
#include <cmath>
#include <numbers>
#include <optional>
#include <random>

#include <gtest/gtest.h>

#include <sidestep/trajectory/splice.hpp>

#include "reach_check.hpp"
#include "support/ball_robot.hpp"

namespace sidestep {
namespace {

constexpr double kCruise_mps = 0.4;
constexpr double kBrake_mps2 = 0.25;
constexpr double kWalk_mps = 0.5;
constexpr double kBody_m = 0.2;
constexpr double kMargin_m = 0.05;
/// Between two states that the check looks at: in it, both may come this much nearer.
constexpr double kLook_s = 0.05;
constexpr double kSlack_m = kLook_s * (kWalk_mps + kCruise_mps) + 1e-3;

/// Along x at cruising speed from its time 0 on; at rest in the end.
Trajectory cruise() {
  Trajectory motion = make_trajectory(3, 3, 0.0);
  const double stop_s = kCruise_mps / kBrake_mps2;
  motion.times_s = {0.0, 10.0, 10.0 + stop_s};
  motion.qdot(0)[0] = motion.qdot(1)[0] = kCruise_mps;
  motion.q(1)[0] = 10.0 * kCruise_mps;
  motion.q(2)[0] = (10.0 + 0.5 * stop_s) * kCruise_mps;
  return motion;
}

/// Where it is if it brakes from a time on.
double braking_x_m(double time_s, double brake_s) {
  const double braking_s = std::clamp(time_s - brake_s, 0.0, kCruise_mps / kBrake_mps2);
  return kCruise_mps * std::min(time_s, brake_s) +
         braking_s * (kCruise_mps - 0.5 * kBrake_mps2 * braking_s);
}

struct Meeting {
  MovingBall ball;
  double now_s, brake_s;

  /// By how much the ball, grown by its way since `now_s`, comes nearer than it may before the
  /// robot is at rest; negative where it does not.
  [[nodiscard]] double worst_m() const {
    double worst = -1e9;
    const double rest_s = brake_s + kCruise_mps / kBrake_mps2;
    for (double t = now_s; t <= rest_s; t += 1e-3) {
      const Eigen::Vector3d robot_m(braking_x_m(t, brake_s), 0.0, 0.0);
      const double grown_m = ball.radius_m + kBody_m + kMargin_m + kWalk_mps * (t - now_s);
      worst = std::max(worst, grown_m - (robot_m - ball.centre_m).norm());
    }
    return worst;
  }
};

Stamp at(double time_s) { return Stamp::from_seconds(time_s); }

detail::ReachCheck reach_check(std::vector<double> braking = {},
                               std::optional<double> acceleration_mps2 = {},
                               double out_of_view_s = 0.0) {
  ReplannerSettings settings;
  settings.obstacle_speed_mps = kWalk_mps;
  settings.obstacle_acceleration_mps2 = acceleration_mps2;
  settings.out_of_view_s = out_of_view_s;
  settings.margin_m = kMargin_m;
  return {std::make_shared<testing_support::BallRobot>(kBody_m),
          {{1.0, 1.0, 1.0}, {kBrake_mps2, kBrake_mps2, kBrake_mps2}, {}, std::move(braking)},
          settings};
}

std::shared_ptr<const MovingObstacles> seen(const MovingBall& ball, Stamp stamp) {
  auto moving = std::make_shared<MovingObstacles>();
  moving->balls = {ball};
  moving->stamp = stamp;
  return moving;
}

TEST(ReachCheck, OfContingencyHoldsFromAnyInstantOnUntilItBrakes) {
  detail::ReachCheck reach = reach_check();
  std::mt19937 random(5);
  std::uniform_real_distribution<double> along(-3.0, 5.0), beside(-2.0, 2.0), share(0.0, 1.0);
  int reached = 0, clear = 0;
  for (int trial = 0; trial < 400; ++trial) {
    const double begin_s = 4.0 * share(random);
    const double brake_s = begin_s + 0.05 + 2.0 * share(random);
    const auto contingency = reach.contingency(cruise(), begin_s, brake_s);
    ASSERT_TRUE(contingency);
    const double now_s = begin_s + share(random) * (brake_s - begin_s);
    const Meeting meeting{{{along(random), beside(random), 0.0}, 0.3}, now_s, brake_s};
    reach.look_at(seen(meeting.ball, at(now_s)).get(), nullptr);
    const auto cause = reach.first_reach(*contingency, at(begin_s), at(now_s));
    const double worst_m = meeting.worst_m();
    if (worst_m > 1e-3) {
      EXPECT_TRUE(cause) << trial << ": nearer by " << worst_m << " m";
      ++reached;
    } else if (worst_m < -kSlack_m) {
      EXPECT_FALSE(cause) << trial << ": " << *cause << ", but is off by " << -worst_m << " m";
      ++clear;
    }
  }
  EXPECT_GT(reached, 50);
  EXPECT_GT(clear, 50);
}

// At 0.4 m/s, 0.25 m/s^2 take 1.6 s and 0.32 m, 2 m/s^2 take 0.2 s and 0.04 m: what walks up at 0.5
// m/s comes 0.7 m less near.
TEST(ReachCheck, LooksNoLongerThanTheRobotBrakes) {
  const auto is_reached = [](double beyond_m, std::vector<double> braking) {
    detail::ReachCheck reach = reach_check(std::move(braking));
    const double ball_m = 0.3;
    const MovingBall ahead{{ball_m + kBody_m + kMargin_m + beyond_m, 0.0, 0.0}, ball_m};
    reach.look_at(seen(ahead, at(0.0)).get(), nullptr);
    return reach.first_reach(cruise(), 0.0, 0.0, at(0.0)).has_value();
  };
  // Until it is at rest, both have come nearer by so much in all.
  const double slow_m = 0.32 + 1.6 * kWalk_mps, fast_m = 0.04 + 0.2 * kWalk_mps;
  EXPECT_TRUE(is_reached(slow_m - 0.01, {}));
  EXPECT_FALSE(is_reached(slow_m + kSlack_m, {}));
  const std::vector<double> hard{2.0, 2.0, 2.0};
  EXPECT_TRUE(is_reached(fast_m - 0.01, hard));
  EXPECT_FALSE(is_reached(fast_m + kSlack_m, hard));
}

/// Before the robot's time 0: when a track was seen last, and that of the map that has it.
constexpr double kSeen_s = 0.6, kMapped_s = 0.2;

/// Seen at a place and a velocity, and out of sight since.
Tracks one_track(const Eigen::Vector2d& position_m, const Eigen::Vector2d& velocity_mps) {
  Tracks tracks;
  Track& track = tracks.tracks.emplace_back();
  track.id = 1;
  track.position_m = position_m + (kSeen_s - kMapped_s) * velocity_mps;
  track.velocity_mps = velocity_mps;
  track.radius_m = 0.2;
  track.bottom_m = -0.1;
  track.top_m = 0.1;
  tracks.stamp = Stamp::from_seconds(-kMapped_s);
  track.last_seen = Stamp::from_seconds(-kSeen_s);
  return tracks;
}

/// Whether somebody who was seen to walk as `track` does, and accelerates all the while in one of
/// 64 directions as hard as he can until he is as fast as he can be, comes too near a robot that
/// brakes at `brake_s`.
bool some_way_reaches(const Track& track, double brake_s, double acceleration_mps2) {
  constexpr double kDt_s = 5e-3;
  const double fastest_mps = std::max(kWalk_mps, track.velocity_mps.norm());
  for (int k = 0; k < 64; ++k) {
    const double angle = k * std::numbers::pi / 32.0;
    const Eigen::Vector2d push =
        acceleration_mps2 * Eigen::Vector2d(std::cos(angle), std::sin(angle));
    Eigen::Vector2d v = track.velocity_mps;
    Eigen::Vector2d p = track.position_m - (kSeen_s - kMapped_s) * v;
    for (int step = 0; step * kDt_s <= kSeen_s + brake_s + kCruise_mps / kBrake_mps2; ++step) {
      const double time_s = step * kDt_s - kSeen_s;
      const Eigen::Vector2d robot(braking_x_m(std::max(time_s, 0.0), brake_s), 0.0);
      const bool is_near = (p - robot).norm() < track.radius_m + kBody_m + kMargin_m;
      if (time_s >= 0.0 && is_near) return true;
      v += kDt_s * push;
      if (v.norm() > fastest_mps) v *= fastest_mps / v.norm();
      p += kDt_s * v;
    }
  }
  return false;
}

TEST(ReachCheck, OfTracksThatCannotTurnAtOnceMissesNobodyWhoTurns) {
  constexpr double kTurns_mps2 = 0.8;
  detail::ReachCheck reach = reach_check({}, kTurns_mps2), at_once = reach_check();
  std::mt19937 random(7);
  std::uniform_real_distribution<double> along(-2.0, 4.0), beside(-2.0, 2.0), speed(-1.2, 1.2);
  int reached = 0, spared = 0;
  for (int trial = 0; trial < 400; ++trial) {
    const Tracks tracks =
        one_track({along(random), beside(random)}, {speed(random), speed(random)});
    reach.look_at(nullptr, &tracks);
    const bool is_reached = reach.first_reach(cruise(), 0.0, 0.3, at(0.0)).has_value();
    if (some_way_reaches(tracks.tracks[0], 0.3, kTurns_mps2)) {
      EXPECT_TRUE(is_reached) << trial;
      ++reached;
    }
    at_once.look_at(nullptr, &tracks);
    if (!is_reached && at_once.first_reach(cruise(), 0.0, 0.3, at(0.0))) ++spared;
  }
  EXPECT_GT(reached, 50);
  EXPECT_GT(spared, 20) << "who walks away is feared no less than who may turn at once";
}

// Whoever is out of sight may have turned when he was seen last, and have come nearer since then.
TEST(ReachCheck, FearsWhoIsOutOfSightFromWhereHeWasSeenLast) {
  const auto is_reached = [](double beyond_m) {
    const Tracks tracks = one_track({kBody_m + kMargin_m + 0.2 + beyond_m, 0.0}, {0.0, 0.3});
    detail::ReachCheck reach = reach_check({}, {}, 1.0);
    reach.look_at(nullptr, &tracks);
    return reach.first_reach(cruise(), 0.0, 0.0, at(0.0)).has_value();
  };
  const double nearer_m = 0.32 + (1.6 + kSeen_s) * kWalk_mps;
  EXPECT_TRUE(is_reached(nearer_m - 0.02));
  EXPECT_FALSE(is_reached(nearer_m + kSlack_m + 0.03));
  // What moved and is out of view, likewise.
  const auto is_reached_untracked = [](double beyond_m) {
    const MovingBall ball{{0.3 + kBody_m + kMargin_m + beyond_m, 0.0, 0.0}, 0.3, at(-kSeen_s)};
    detail::ReachCheck reach = reach_check({}, {}, 1.0);
    reach.look_at(seen(ball, at(0.0)).get(), nullptr);
    return reach.first_reach(cruise(), 0.0, 0.0, at(0.0)).has_value();
  };
  EXPECT_TRUE(is_reached_untracked(nearer_m - 0.01));
  EXPECT_FALSE(is_reached_untracked(nearer_m + kSlack_m));
}

TEST(ReachCheck, ForgetsWhatHasBeenOutOfViewForLonger) {
  const MovingBall ball{{0.3 + kBody_m + kMargin_m, 0.0, 0.0}, 0.3, at(-kSeen_s)};
  for (const double out_of_view_s : {0.0, kSeen_s - 0.1, kSeen_s + 0.1}) {
    detail::ReachCheck reach = reach_check({}, {}, out_of_view_s);
    reach.look_at(seen(ball, at(0.0)).get(), nullptr);
    EXPECT_EQ(reach.first_reach(cruise(), 0.0, 0.0, at(0.0)).has_value(), out_of_view_s > kSeen_s);
  }
}

TEST(ReachCheck, OfTracksThatCannotTurnAtOnceCountsWhoStands) {
  const Tracks tracks = one_track({0.7, 0.0}, {0.0, 0.0});
  detail::ReachCheck reach = reach_check({}, 3.0), at_once = reach_check();
  reach.look_at(nullptr, &tracks);
  EXPECT_TRUE(reach.first_reach(cruise(), 0.0, 0.0, at(0.0)));
  at_once.look_at(nullptr, &tracks);
  EXPECT_FALSE(at_once.first_reach(cruise(), 0.0, 0.0, at(0.0)));
}

// Two metres off somebody walks away, and something with him: what sticks out of him may go
// anywhere.
TEST(ReachCheck, CountsWhatMovesBesideATrack) {
  const Tracks tracks = one_track({1.2, 0.0}, {1.0, 0.0});
  detail::ReachCheck reach = reach_check({}, 0.5);
  const auto is_reached = [&](double radius_m) {
    const Eigen::Vector2d& p = tracks.tracks[0].position_m;
    reach.look_at(seen({{p.x(), p.y(), 0.0}, radius_m}, at(0.0)).get(), &tracks);
    return reach.first_reach(cruise(), 0.0, 0.0, at(0.0)).has_value();
  };
  EXPECT_FALSE(is_reached(0.15));
  EXPECT_TRUE(is_reached(0.5));
}

TEST(ReachCheck, OfContingencySaysNothingOfWhatTheRobotHasPassed) {
  detail::ReachCheck reach = reach_check();
  const auto contingency = reach.contingency(cruise(), 0.0, 3.0);
  ASSERT_TRUE(contingency);
  const MovingBall at_begin{{-0.2, 0.0, 0.0}, 0.3};
  reach.look_at(seen(at_begin, at(0.0)).get(), nullptr);
  EXPECT_TRUE(reach.first_reach(*contingency, at(0.0), at(0.0)));
  reach.look_at(seen(at_begin, at(2.9)).get(), nullptr);
  EXPECT_FALSE(reach.first_reach(*contingency, at(0.0), at(2.9)));
}

TEST(ReachCheck, FearsATrackThatMakesNoSenseAnywhere) {
  detail::ReachCheck reach = reach_check();
  Tracks tracks = one_track({50.0, 0.0}, {0.3, 0.0});
  reach.look_at(nullptr, &tracks);
  EXPECT_TRUE(reach.sees_anything());
  EXPECT_FALSE(reach.first_reach(cruise(), 0.0, 0.5, at(0.0)));
  tracks.tracks[0].radius_m = std::nan("");
  reach.look_at(nullptr, &tracks);
  EXPECT_TRUE(reach.sees_anything());
  EXPECT_TRUE(reach.first_reach(cruise(), 0.0, 0.5, at(0.0)));
  reach.look_at(nullptr, nullptr);
  EXPECT_FALSE(reach.sees_anything());
  EXPECT_FALSE(reach.first_reach(cruise(), 0.0, 0.5, at(0.0)));
}

TEST(ReachCheck, OfThingsWithoutASpeedSeesNothing) {
  ReplannerSettings settings;
  settings.obstacle_speed_mps = 0.0;
  detail::ReachCheck reach(std::make_shared<testing_support::BallRobot>(kBody_m),
                           {{1.0, 1.0, 1.0}, {1.0, 1.0, 1.0}, {}}, settings);
  const Tracks tracks = one_track({0.1, 0.0}, {1.0, 0.0});
  reach.look_at(seen({{0.1, 0.0, 0.0}, 0.3}, at(0.0)).get(), &tracks);
  EXPECT_FALSE(reach.sees_anything());
  EXPECT_FALSE(reach.first_reach(cruise(), 0.0, 0.5, at(0.0)));
}

// The track is 1 m high, and 0.1 m more is as good as in it: what lies in it is a part of it, what
// sticks out at its top or bottom is not.
TEST(ReachCheck, CountsWhatMovesAboveOrBelowATrack) {
  Tracks tracks = one_track({1.2, 0.0}, {1.0, 0.0});
  Track& track = tracks.tracks[0];
  track.radius_m = 0.6;
  track.bottom_m = -0.5;
  track.top_m = 0.5;
  detail::ReachCheck reach = reach_check({}, 0.5);
  for (const double z_m : {0.0, 0.09, -0.09, 0.15, -0.15}) {
    const Eigen::Vector2d& p = track.position_m;
    reach.look_at(seen({{p.x(), p.y(), z_m}, 0.5}, at(0.0)).get(), &tracks);
    EXPECT_EQ(reach.first_reach(cruise(), 0.0, 0.0, at(0.0)).has_value(), std::abs(z_m) > 0.1)
        << z_m;
  }
}

// Without a rest at its end there is no stop on the path: it is straight, 0.32 m and 1.6 s long.
TEST(ReachCheck, StopsBesideAPathThatEndsTooSoon) {
  Trajectory motion = cut(cruise(), 0.0, 2.0);
  detail::ReachCheck reach = reach_check();
  const auto contingency = reach.contingency(motion, 0.0, 2.0);
  ASSERT_TRUE(contingency);
  EXPECT_NEAR(contingency->times_s.back(), 2.0 + kCruise_mps / kBrake_mps2, 1e-3);
  EXPECT_NEAR(contingency->centres_m.back().x(), 2.0 * kCruise_mps + 0.32, 1e-3);
}

TEST(ReachCheck, FearsWhateverMovesWhereNoStopCanBeFound) {
  ReplannerSettings settings;
  settings.obstacle_speed_mps = kWalk_mps;
  detail::ReachCheck reach(std::make_shared<testing_support::BallRobot>(kBody_m),
                           {{1.0, 1.0, 1.0}, {0.0, 0.0, 0.0}, {}}, settings);
  EXPECT_FALSE(reach.contingency(cruise(), 0.0, 0.5));
  EXPECT_FALSE(reach.first_reach(cruise(), 0.0, 0.5, at(0.0)));  // nothing moves
  reach.look_at(seen({{9.0, 9.0, 0.0}, 0.3}, at(0.0)).get(), nullptr);
  EXPECT_TRUE(reach.first_reach(cruise(), 0.0, 0.5, at(0.0)));
}

}  // namespace
}  // namespace sidestep
