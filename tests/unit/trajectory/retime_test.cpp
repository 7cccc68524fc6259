#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>
#include <random>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <sidestep/trajectory/retime.hpp>

#include "support/path_probe.hpp"

namespace sidestep {
namespace {

using testing::HasSubstr;
using testing_support::limit_use;
using testing_support::stray;
using testing_support::turning_points;

constexpr double kUnlimited = std::numeric_limits<double>::infinity();

Trajectory hermite(int dof, std::vector<double> times_s, std::vector<double> positions,
                   std::vector<double> velocities) {
  Trajectory out;
  out.dof = dof;
  out.times_s = std::move(times_s);
  out.positions = std::move(positions);
  out.velocities = std::move(velocities);
  return out;
}

/// A straight motion from rest to rest in one cubic piece.
Trajectory straight(const std::vector<double>& goal, double duration_s = 3.0) {
  std::vector<double> positions(goal.size(), 0.0);
  positions.insert(positions.end(), goal.begin(), goal.end());
  return hermite(static_cast<int>(goal.size()), {0.0, duration_s}, positions,
                 std::vector<double>(positions.size(), 0.0));
}

MotionLimits limits_of(std::vector<double> velocity, std::vector<double> acceleration) {
  return {std::move(velocity), std::move(acceleration), {}};
}

/// Smooth motion of sines from rest to rest, as support states.
Trajectory waves(int dof, int states, std::uint64_t seed, double duration_s = 4.0) {
  std::mt19937_64 random(seed);
  std::normal_distribution<double> normal;
  Trajectory out = make_trajectory(dof, states, duration_s / (states - 1));
  for (std::size_t j = 0; j < static_cast<std::size_t>(dof); ++j) {
    const double way = normal(random), one = 0.5 * normal(random), two = 0.3 * normal(random);
    for (int i = 0; i < states; ++i) {
      const double f = static_cast<double>(i) / (states - 1), pi = std::numbers::pi;
      // Its rate vanishes at both ends.
      out.q(i)[j] = way * f * f * (3 - 2 * f) + one * (1 - std::cos(2 * pi * f)) +
                    two * (1 - std::cos(4 * pi * f));
      out.qdot(i)[j] = (way * 6 * f * (1 - f) + one * 2 * pi * std::sin(2 * pi * f) +
                        two * 4 * pi * std::sin(4 * pi * f)) /
                       duration_s;
    }
  }
  return out;
}

/// What every retiming must be, held against finite differences and the path as a polyline.
void expect_sound(const Trajectory& path, const MotionLimits& limits, const Retiming& retimed) {
  const Trajectory& motion = retimed.trajectory;
  const auto valid = motion.validate();
  ASSERT_TRUE(valid) << valid.error().describe();
  const auto use = limit_use(motion, limits, 20'000);
  EXPECT_LE(*std::ranges::max_element(use), 1.0 + 1e-5);
  EXPECT_LE(retimed.deviation, 1e-4);
  // Two joints may be off at once, and a polyline of 12,000 segments is off itself.
  if (path.dof == 1) {  // a line that turns back is told by where it does
    EXPECT_THAT(turning_points(motion, 12'000),
                testing::Pointwise(testing::DoubleNear(1e-5), turning_points(path, 12'000)));
    return;
  }
  EXPECT_LE(stray(motion, path, 12'000), 1e-4 * std::sqrt(path.dof) + 1e-5);
  EXPECT_LE(stray(path, motion, 12'000), 1e-4 * std::sqrt(path.dof) + 1e-5);
}

TEST(Retime, IsATriangleWhereTheWayIsTooShortForFullSpeed) {
  const auto limits = limits_of({10.0}, {2.0});
  const Trajectory path = straight({1.5});
  const auto retimed = retime(path, limits);
  ASSERT_TRUE(retimed) << retimed.error().describe();
  expect_sound(path, limits, *retimed);
  const double optimum_s = 2.0 * std::sqrt(1.5 / 2.0);
  EXPECT_GE(retimed->trajectory.duration_s(), optimum_s * (1.0 - 1e-9));
  EXPECT_LE(retimed->trajectory.duration_s(), optimum_s * 1.001);
}

TEST(Retime, IsATrapezoidWhereFullSpeedIsReached) {
  const auto limits = limits_of({0.5}, {2.0});
  for (const double goal : {1.5, -1.5}) {
    const Trajectory path = straight({goal});
    const auto retimed = retime(path, limits);
    ASSERT_TRUE(retimed) << retimed.error().describe();
    expect_sound(path, limits, *retimed);
    const double optimum_s = 1.5 / 0.5 + 0.5 / 2.0;
    EXPECT_GE(retimed->trajectory.duration_s(), optimum_s * (1.0 - 1e-9));
    EXPECT_LE(retimed->trajectory.duration_s(), optimum_s * 1.001);
  }
}

TEST(Retime, DoesNotDependOnHowThePathWasTimed) {
  const auto limits = limits_of({0.5}, {2.0});
  const Trajectory slow = straight({1.0}, 500.0), fast = straight({1.0}, 0.01);
  const auto one = retime(slow, limits), other = retime(fast, limits);
  ASSERT_TRUE(one && other);
  EXPECT_NEAR(one->trajectory.duration_s(), other->trajectory.duration_s(), 1e-9);
}

TEST(Retime, TheSlowestJointOfAStraightLineSetsItsTime) {
  // In line, joint 0 has 1.2 m at 0.3 m/s, joint 1 2 rad at 1 rad/s^2 and so on.
  const auto limits = limits_of({0.3, 2.0, 5.0}, {4.0, 1.0, 0.2});
  const Trajectory path = straight({1.2, 2.0, -0.1});
  const auto retimed = retime(path, limits);
  ASSERT_TRUE(retimed) << retimed.error().describe();
  expect_sound(path, limits, *retimed);
  // Per unit of the way: speeds 0.25, 1, 50; accelerations 10/3, 0.5, 2.
  const double optimum_s = 1.0 / 0.25 + 0.25 / 0.5;
  EXPECT_GE(retimed->trajectory.duration_s(), optimum_s * (1.0 - 1e-9));
  EXPECT_LE(retimed->trajectory.duration_s(), optimum_s * 1.001);
}

TEST(Retime, AJointThatAloneIsLimitedIsFastestOnACurve) {
  // Half a circle: x goes monotonically from -R to R, and only x is limited, so that the optimum
  // is x's own triangle although the path leaves and arrives across x.
  constexpr double kRadius = 0.5, kLimit = 1.5;
  constexpr int kStates = 41;
  Trajectory path = make_trajectory(2, kStates, 0.1);
  for (int i = 0; i < kStates; ++i) {
    const double f = static_cast<double>(i) / (kStates - 1), pi = std::numbers::pi;
    const double angle = pi * f * f * (3.0 - 2.0 * f);
    const double rate = pi * 6.0 * f * (1.0 - f) / path.duration_s();
    path.q(i)[0] = -kRadius * std::cos(angle);
    path.q(i)[1] = kRadius * std::sin(angle);
    path.qdot(i)[0] = kRadius * std::sin(angle) * rate;
    path.qdot(i)[1] = kRadius * std::cos(angle) * rate;
  }
  const auto limits = limits_of({kUnlimited, kUnlimited}, {kLimit, 1e4});
  const auto retimed = retime(path, limits);
  ASSERT_TRUE(retimed) << retimed.error().describe();
  expect_sound(path, limits, *retimed);
  const double optimum_s = 2.0 * std::sqrt(2.0 * kRadius / kLimit);
  EXPECT_GE(retimed->trajectory.duration_s(), optimum_s * (1.0 - 1e-4));
  EXPECT_LE(retimed->trajectory.duration_s(), optimum_s * 1.01);
}

/// A full circle at constant speed 1 m/s.
Trajectory circle(double radius, int states) {
  const double period_s = 2.0 * std::numbers::pi * radius;
  Trajectory out = make_trajectory(2, states, period_s / (states - 1));
  for (int i = 0; i < states; ++i) {
    const double angle = 2.0 * std::numbers::pi * i / (states - 1);
    out.q(i)[0] = radius * std::cos(angle);
    out.q(i)[1] = radius * std::sin(angle);
    out.qdot(i)[0] = -std::sin(angle);
    out.qdot(i)[1] = std::cos(angle);
  }
  return out;
}

/// The least time around a circle by dynamic programming on a grid of angle and squared speed:
/// of all motions with constant tangential acceleration between angles whose joint accelerations
/// keep the limit, both at the beginning and at the end of each step.
double least_circle_time_s(double radius, double limit, double squared_speed_at_ends) {
  constexpr int kAngles = 120, kSpeeds = 480;
  const double step_x = squared_speed_at_ends / 320;
  const double step_angle = 2.0 * std::numbers::pi / kAngles, length = radius * step_angle;
  const auto keeps = [&](double angle, double x, double u) {
    const double ax = -std::sin(angle) * u - std::cos(angle) * x / radius;
    const double ay = std::cos(angle) * u - std::sin(angle) * x / radius;
    return std::max(std::abs(ax), std::abs(ay)) <= limit * (1.0 + 1e-9);
  };
  std::vector<double> best(kSpeeds, kUnlimited), next;
  best[320] = 0.0;
  for (int k = 0; k < kAngles; ++k) {
    next.assign(kSpeeds, kUnlimited);
    for (int from = 0; from < kSpeeds; ++from) {
      if (std::isinf(best[static_cast<std::size_t>(from)])) continue;
      for (int to = 0; to < kSpeeds; ++to) {
        const double x0 = from * step_x, x1 = to * step_x, u = (x1 - x0) / (2.0 * length);
        if (from + to == 0 || !keeps(k * step_angle, x0, u)) continue;
        if (!keeps((k + 1) * step_angle, x1, u)) continue;
        const double time_s =
            best[static_cast<std::size_t>(from)] + 2.0 * length / (std::sqrt(x0) + std::sqrt(x1));
        auto& there = next[static_cast<std::size_t>(to)];
        there = std::min(there, time_s);
      }
    }
    best = next;
  }
  return best[320];
}

TEST(Retime, GoesAroundACircleAsFastAsAnySearchFinds) {
  constexpr double kRadius = 0.4;
  const double limit = 1.02 / kRadius;  // at 1 m/s the acceleration to the centre is just below
  const Trajectory path = circle(kRadius, 65);
  const auto limits = limits_of({100.0, 100.0}, {limit, limit});
  const auto retimed = retime(path, limits);
  ASSERT_TRUE(retimed) << retimed.error().describe();
  expect_sound(path, limits, *retimed);
  // At both ends at its path's speed, in between faster: a joint is at its limit only where it
  // points to the centre.
  const double constant_s = path.duration_s();
  const double searched_s = least_circle_time_s(kRadius, limit, 1.0);
  EXPECT_LT(searched_s, constant_s);
  EXPECT_LE(retimed->trajectory.duration_s(), searched_s * 1.002);
  EXPECT_GE(retimed->trajectory.duration_s(), searched_s * 0.97);  // what the grid loses
}

TEST(Retime, KeepsLimitsAndPathOfSmoothMotionsAndWastesNothing) {
  for (std::uint64_t seed = 1; seed <= 12; ++seed) {
    SCOPED_TRACE("seed " + std::to_string(seed));
    const int dof = 2 + static_cast<int>(seed % 6);
    const Trajectory path = waves(dof, 8 + static_cast<int>(seed), seed);
    std::mt19937_64 random(seed);
    std::uniform_real_distribution<double> uniform(0.3, 3.0);
    MotionLimits limits;
    for (int j = 0; j < dof; ++j) {
      limits.velocity.push_back(uniform(random));
      limits.acceleration.push_back(uniform(random));
    }
    const auto retimed = retime(path, limits);
    ASSERT_TRUE(retimed) << retimed.error().describe();
    expect_sound(path, limits, *retimed);
    // At nearly every instant some limit is used to the full.
    const auto use = limit_use(retimed->trajectory, limits, 20'000);
    const auto full = std::ranges::count_if(use, [](double part) { return part > 0.97; });
    EXPECT_GT(static_cast<double>(full), 0.9 * static_cast<double>(use.size()));
    // A hundredth less time, and a limit breaks.
    Trajectory shorter = retimed->trajectory;
    for (double& time_s : shorter.times_s) time_s *= 0.99;
    for (double& velocity : shorter.velocities) velocity /= 0.99;
    const auto over = limit_use(shorter, limits, 20'000);
    EXPECT_GT(*std::ranges::max_element(over), 1.0 + 1e-3);
  }
}

TEST(Retime, ComesAsNearTheOptimumAsItsStagesAreShort) {
  // The optimum uses a limit to the full at every instant.
  for (const std::uint64_t seed : {4, 9}) {
    const Trajectory path = waves(4, 12, seed);
    const auto limits = limits_of({1.0, 0.7, 2.0, 1.5}, {1.0, 2.0, 0.5, 1.5});
    const auto fine = retime(path, limits, {.least_stages = 6400});
    const auto coarse = retime(path, limits);
    ASSERT_TRUE(fine && coarse);
    const auto use = limit_use(fine->trajectory, limits, 20'000);
    const auto full = std::ranges::count_if(use, [](double part) { return part > 0.99; });
    EXPECT_GT(static_cast<double>(full), 0.99 * static_cast<double>(use.size()));
    EXPECT_GT(coarse->trajectory.duration_s(), fine->trajectory.duration_s());
    EXPECT_LT(coarse->trajectory.duration_s(), 1.005 * fine->trajectory.duration_s());
  }
}

TEST(Retime, KeepsLimitsAndPathOfRaggedMotions) {
  // Positions and velocities at random: loops, sharp turns and near standstills.
  std::mt19937_64 random(3);
  std::normal_distribution<double> normal;
  for (int trial = 0; trial < 40; ++trial) {
    SCOPED_TRACE("trial " + std::to_string(trial));
    const int dof = 1 + trial % 4;
    Trajectory path = make_trajectory(dof, 3 + trial % 7, 0.5);
    for (double& q : path.positions) q = normal(random);
    for (double& v : path.velocities) v = (trial % 3) * normal(random);
    for (int j = 0; j < dof; ++j) {
      path.qdot(0)[static_cast<std::size_t>(j)] = 0.0;
      path.qdot(path.size() - 1)[static_cast<std::size_t>(j)] = 0.0;
    }
    const auto limits = limits_of(std::vector<double>(static_cast<std::size_t>(dof), 1.0),
                                  std::vector<double>(static_cast<std::size_t>(dof), 2.0));
    const auto retimed = retime(path, limits);
    ASSERT_TRUE(retimed) << retimed.error().describe();
    expect_sound(path, limits, *retimed);
  }
}

TEST(Retime, NeverSlowsAMotionThatKeepsItsLimits) {
  for (std::uint64_t seed = 20; seed < 30; ++seed) {
    const Trajectory path = waves(4, 15, seed);
    // Of the path itself, by differences: at least what it uses.
    MotionLimits limits = limits_of(std::vector<double>(4, 1.0), std::vector<double>(4, 1.0));
    const auto use = limit_use(path, limits, 20'000);
    const double most = *std::ranges::max_element(use) * 1.001;
    for (double& limit : limits.velocity) limit *= most;
    for (double& limit : limits.acceleration) limit *= most;
    const auto retimed = retime(path, limits);
    ASSERT_TRUE(retimed) << retimed.error().describe();
    EXPECT_LE(retimed->trajectory.duration_s(), path.duration_s());
  }
}

TEST(Retime, KeepsTheVelocitiesOfStartAndGoal) {
  // As in replanning: the robot is under way, and the goal is passed.
  Trajectory path = waves(3, 12, 5);
  const Trajectory rest = refit(path, 1.1, 9, 0.25);
  Trajectory moving = rest;
  moving.times_s.pop_back();
  moving.positions.resize(moving.times_s.size() * 3);
  moving.velocities.resize(moving.times_s.size() * 3);
  const auto limits = limits_of({2.5, 2.5, 2.5}, {8.0, 8.0, 8.0});
  const auto retimed = retime(moving, limits);
  ASSERT_TRUE(retimed) << retimed.error().describe();
  expect_sound(moving, limits, *retimed);
  const Trajectory& motion = retimed->trajectory;
  for (std::size_t j = 0; j < 3; ++j) {
    EXPECT_NEAR(motion.qdot(0)[j], moving.qdot(0)[j], 1e-5);
    EXPECT_NEAR(motion.qdot(motion.size() - 1)[j], moving.qdot(moving.size() - 1)[j], 1e-5);
  }
}

TEST(Retime, TakesTheLeastTimeFromASpeed) {
  // 1 m at -2 m/s^2 from 1.5 m/s to rest: faster first, then down. v^2 = 1.5^2 + 2 a y = 2 a (1 -
  // y).
  const Trajectory path = hermite(1, {0.0, 1.0}, {0.0, 1.0}, {1.5, 0.0});
  const auto limits = limits_of({5.0}, {2.0});
  const auto retimed = retime(path, limits);
  ASSERT_TRUE(retimed) << retimed.error().describe();
  const double peak = std::sqrt((1.5 * 1.5 + 2.0 * 2.0 * 1.0) / 2.0);
  const double optimum_s = (peak - 1.5) / 2.0 + peak / 2.0;
  EXPECT_GE(retimed->trajectory.duration_s(), optimum_s * (1.0 - 1e-9));
  EXPECT_LE(retimed->trajectory.duration_s(), optimum_s * 1.001);
}

TEST(Retime, LeavesAtFullSpeedIntoACurve) {
  // At its velocity limit where the path begins to turn; its own timing keeps all limits.
  for (const double v : {0.9, 0.9999, 1.0 - 1e-6, 1.0}) {
    Trajectory path =
        hermite(2, {0.0, 4.3, 7.9}, {0.6, 0.0, 2.5, 1.0, 4.0, 0.0}, {v, 0.0, 0.38, 0.0, 0.0, 0.0});
    const MotionLimits limits = limits_of({1.0, 1.0}, {1.0, 1.0});
    const auto use = limit_use(path, limits, 20'000);
    ASSERT_LE(*std::ranges::max_element(use), 1.0 + 1e-6);
    const auto retimed = retime(path, limits);
    ASSERT_TRUE(retimed) << v << ": " << retimed.error().describe();
    expect_sound(path, limits, *retimed);
    EXPECT_NEAR(retimed->trajectory.qdot(0)[0], v, 1e-12);
  }
}

TEST(Retime, StopsWhereThePathTurnsOnTheSpotOnly) {
  // Along x, then along y, at rest in the corner; and along x through a point where it stood.
  const Trajectory corner = hermite(2, {0.0, 1.0, 2.0}, {0, 0, 1, 0, 1, 1}, std::vector<double>(6));
  const auto limits = limits_of({10.0, 10.0}, {1.0, 1.0});
  const auto turned = retime(corner, limits);
  ASSERT_TRUE(turned) << turned.error().describe();
  expect_sound(corner, limits, *turned);
  EXPECT_NEAR(turned->trajectory.duration_s(), 4.0, 0.004);

  const Trajectory line = hermite(2, {0.0, 1.0, 2.0}, {0, 0, 1, 0, 2, 0}, std::vector<double>(6));
  const auto through = retime(line, limits);
  ASSERT_TRUE(through) << through.error().describe();
  EXPECT_NEAR(through->trajectory.duration_s(), 2.0 * std::sqrt(2.0), 0.003);
}

TEST(Retime, TurnsBackWithinAPiece) {
  // One joint that overshoots its goal and returns: a stop where it turns, at 4/27 v T beyond 0.
  const Trajectory path = hermite(1, {0.0, 1.0}, {0.0, 0.0}, {2.7, 0.0});
  const auto limits = limits_of(
      {
          2.7,
      },
      {12.0});
  const auto retimed = retime(path, limits);
  ASSERT_TRUE(retimed) << retimed.error().describe();
  expect_sound(path, limits, *retimed);
  const double reach = 2.7 * 4.0 / 27.0, back_s = 2.0 * std::sqrt(reach / 12.0);
  // Out: from 2.7 m/s, at full speed until it must brake.
  const double out_s = 2.7 / 12.0 + (reach - 2.7 * 2.7 / 24.0) / 2.7;
  EXPECT_NEAR(retimed->trajectory.duration_s(), out_s + back_s, 0.002 * (out_s + back_s));
}

TEST(Retime, SkipsThePauses) {
  const Trajectory path = hermite(1, {0.0, 5.0, 8.0, 20.0}, {0, 0, 1, 1}, {0, 0, 0, 0});
  const auto limits = limits_of({10.0}, {1.0});
  const auto retimed = retime(path, limits);
  ASSERT_TRUE(retimed) << retimed.error().describe();
  EXPECT_NEAR(retimed->trajectory.duration_s(), 2.0, 0.002);
}

TEST(Retime, StaysPutInAMillisecond) {
  for (const int states : {1, 2, 3, 11}) {
    Trajectory path = make_trajectory(2, states, 0.1);
    std::ranges::fill(path.positions, 0.7);
    const auto retimed = retime(path, limits_of({0.0, 1.0}, {1.0, 0.0}));
    ASSERT_TRUE(retimed) << retimed.error().describe();
    ASSERT_TRUE(retimed->trajectory.validate());
    EXPECT_EQ(retimed->trajectory.size(), 2);
    EXPECT_EQ(retimed->trajectory.duration_s(), 1e-3);
    EXPECT_EQ(retimed->trajectory.q(1)[0], 0.7);
    EXPECT_EQ(retimed->deviation, 0.0);
  }
}

TEST(Retime, TimesTheTiniestMotions) {
  for (const double way : {1e-3, 1e-5, 1e-7}) {
    const Trajectory path = straight({way});
    const auto limits = limits_of({1.0}, {2.0});
    const auto retimed = retime(path, limits);
    ASSERT_TRUE(retimed) << way << ": " << retimed.error().describe();
    EXPECT_NEAR(retimed->trajectory.duration_s() / (2.0 * std::sqrt(way / 2.0)), 1.0, 1e-3);
  }
}

TEST(Retime, IgnoresTheLimitsOfJointsThatStandStill) {
  const Trajectory path = straight({1.0, 0.0});
  const auto limited = retime(path, limits_of({10.0, 0.0}, {1.0, 0.0}));
  ASSERT_TRUE(limited) << limited.error().describe();
  EXPECT_NEAR(limited->trajectory.duration_s(), 2.0, 0.002);
}

TEST(Retime, WorksWithVelocityLimitsAlone) {
  const Trajectory path = waves(2, 10, 9);
  const auto limits = limits_of({0.5, 0.8}, {kUnlimited, kUnlimited});
  const auto retimed = retime(path, limits);
  ASSERT_TRUE(retimed) << retimed.error().describe();
  ASSERT_TRUE(retimed->trajectory.validate());
  const auto use = limit_use(retimed->trajectory, limits, 20'000);
  EXPECT_LE(*std::ranges::max_element(use), 1.0 + 1e-5);
}

TEST(RetimeRefuses, ASpeedThatCannotBeBraked) {
  const Trajectory path = hermite(1, {0.0, 0.1}, {0.0, 0.1}, {2.0, 0.0});
  // 2 m/s over 0.1 m takes 20 m/s^2.
  const auto refused = retime(path, limits_of({3.0}, {15.0}));
  ASSERT_FALSE(refused);
  EXPECT_EQ(refused.error().code, ErrorCode::kInvalidArgument);
  EXPECT_THAT(refused.error().message, HasSubstr("from its start's velocity"));
  EXPECT_TRUE(retime(path, limits_of({3.0}, {25.0})));
}

TEST(RetimeRefuses, AGoalVelocityThatCannotBeReached) {
  const Trajectory path = hermite(1, {0.0, 0.1}, {0.0, 0.1}, {0.0, 2.0});
  const auto refused = retime(path, limits_of({3.0}, {15.0}));
  ASSERT_FALSE(refused);
  EXPECT_THAT(refused.error().message, HasSubstr("to its goal's velocity"));
}

TEST(RetimeRefuses, EndsBeyondTheVelocityLimitNamingTheJoint) {
  const Trajectory path = hermite(2, {0.0, 1.0}, {0, 0, 1, 1}, {1, 2, 0, 0});
  MotionLimits limits = limits_of({1.5, 1.5}, {50.0, 50.0});
  limits.names = {"shoulder", "elbow"};
  const auto refused = retime(path, limits);
  ASSERT_FALSE(refused);
  EXPECT_THAT(refused.error().message, HasSubstr("joint 'elbow' moves at 2 at the start"));
}

TEST(RetimeRefuses, LimitsThatForbidOrDoNotExist) {
  const Trajectory path = straight({1.0, 1.0});
  const auto message = [&](MotionLimits limits) {
    const auto refused = retime(path, limits);
    return refused ? std::string("no error") : refused.error().message;
  };
  EXPECT_THAT(message(limits_of({1.0, 0.0}, {1.0, 1.0})), HasSubstr("joint 1 moves on the path"));
  EXPECT_THAT(message(limits_of({1.0, 1.0}, {0.0, 1.0})), HasSubstr("acceleration is zero"));
  EXPECT_THAT(message(limits_of({1.0, kUnlimited}, {1.0, kUnlimited})),
              HasSubstr("without a limit"));
  EXPECT_THAT(message(limits_of({1.0, std::nan("")}, {1.0, 1.0})), HasSubstr("not numbers"));
  EXPECT_THAT(message(limits_of({1.0, 1.0}, {-1.0, 1.0})), HasSubstr("negative"));
  EXPECT_THAT(message(limits_of({1.0}, {1.0})), HasSubstr("for a path of 2 joints"));
}

TEST(RetimeRefuses, BrokenPathsAndSettings) {
  Trajectory path = straight({1.0});
  path.positions[1] = std::nan("");
  EXPECT_FALSE(retime(path, limits_of({1.0}, {1.0})));
  EXPECT_FALSE(retime({}, {}));
  EXPECT_FALSE(retime(straight({1.0}), limits_of({1.0}, {1.0}), {.least_stages = 0}));
  EXPECT_FALSE(retime(straight({1.0}), limits_of({1.0}, {1.0}), {.max_deviation = 0.0}));
}

TEST(LeastTime, IsTheSlowestJointsTriangleOrTrapezoid) {
  const std::vector<double> from{0.0, 1.0}, to{1.0, -1.0};
  // Triangle: 2 sqrt(1 / 4) = 1 s; trapezoid: 2 / 0.5 + 0.5 / 1 = 4.5 s.
  EXPECT_DOUBLE_EQ(least_time_s(limits_of({9.0, 9.0}, {4.0, kUnlimited}), from, to), 1.0);
  EXPECT_DOUBLE_EQ(least_time_s(limits_of({9.0, 0.5}, {4.0, 1.0}), from, to), 4.5);
  EXPECT_DOUBLE_EQ(least_time_s(limits_of({0.0, 0.0}, {0.0, 0.0}), from, from), 0.0);
  EXPECT_EQ(least_time_s(limits_of({9.0, 0.0}, {4.0, 1.0}), from, to), kUnlimited);
  EXPECT_EQ(least_time_s(limits_of({9.0, 1.0}, {4.0, 0.0}), from, to), kUnlimited);
}

TEST(MotionLimitsOfARobot, AreSharesAndAnAssumptionWhereNoneIsKnown) {
  RobotDescription robot;
  robot.joints.resize(2);
  robot.joints[0] = {.name = "known", .max_velocity = 2.0, .max_acceleration = 3.0};
  robot.joints[1] = {.name = "unknown", .max_velocity = 2.0, .max_acceleration = kUnlimited};
  const auto limits = motion_limits(
      robot, {.speed_fraction = 0.5, .acceleration_fraction = 0.1, .assumed_ramp_s = 0.25});
  EXPECT_THAT(limits.velocity, testing::ElementsAre(1.0, 1.0));
  EXPECT_NEAR(limits.acceleration[0], 0.3, 1e-12);
  EXPECT_NEAR(limits.acceleration[1], 0.8, 1e-12);  // 2 / 0.25, and a tenth of it
  EXPECT_THAT(joints_of_unknown_acceleration(robot), testing::ElementsAre("unknown"));
  EXPECT_TRUE(limits.braking.empty());
  robot.joints[0].max_braking = 12.0;
  const auto braking = motion_limits(
      robot, {.speed_fraction = 0.5, .acceleration_fraction = 0.1, .assumed_ramp_s = 0.25});
  EXPECT_EQ(braking.acceleration, limits.acceleration);
  EXPECT_NEAR(braking.while_stopping()[0], 1.2, 1e-12);
  EXPECT_EQ(braking.while_stopping()[1], limits.acceleration[1]);
}

}  // namespace
}  // namespace sidestep
