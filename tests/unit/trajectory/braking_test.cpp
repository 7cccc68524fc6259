#include <cmath>
#include <random>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <sidestep/trajectory/braking.hpp>
#include <sidestep/trajectory/retime.hpp>
#include <sidestep/trajectory/splice.hpp>

#include "support/path_probe.hpp"

namespace sidestep {
namespace {

using testing::HasSubstr;
using testing_support::distance_to_segment;
using testing_support::limit_use;
using testing_support::sampled;

/// Constant velocity from the origin.
Trajectory cruise(const std::vector<double>& velocity, double duration_s) {
  const int dof = static_cast<int>(velocity.size());
  Trajectory out = make_trajectory(dof, 2, duration_s);
  for (std::size_t j = 0; j < velocity.size(); ++j) {
    out.q(1)[j] = velocity[j] * duration_s;
    out.qdot(0)[j] = out.qdot(1)[j] = velocity[j];
  }
  return out;
}

/// Joints that swing and move on, from rest to rest, as fast as the limits allow.
Trajectory winding(int dof, std::uint64_t seed, const MotionLimits& limits) {
  std::mt19937_64 random(seed);
  std::normal_distribution<double> normal;
  Trajectory path = make_trajectory(dof, 12, 0.4);
  for (std::size_t j = 0; j < static_cast<std::size_t>(dof); ++j) {
    const double way = normal(random), swing = 0.4 * normal(random);
    for (int i = 0; i < path.size(); ++i) {
      const double f = i / 11.0, pi = 3.14159265358979;
      path.q(i)[j] = way * f * f * (3 - 2 * f) + swing * (1 - std::cos(2 * pi * f));
      path.qdot(i)[j] = (way * 6 * f * (1 - f) + swing * 2 * pi * std::sin(2 * pi * f)) / 4.4;
    }
  }
  auto fastest = retime(path, limits);
  EXPECT_TRUE(fastest) << fastest.error().describe();
  return fastest->trajectory;
}

/// The largest distance of a motion from a path, as a polyline.
double distance_from(const Trajectory& motion, const Trajectory& path) {
  const auto line = sampled(path, 4'000);
  double worst = 0.0;
  for (const auto& point : sampled(motion, 60)) {
    double nearest = 1e9;
    for (std::size_t k = 0; k + 1 < line.size(); ++k) {
      nearest = std::min(nearest, distance_to_segment(point, line[k], line[k + 1]));
    }
    worst = std::max(worst, nearest);
  }
  return worst;
}

void expect_rest_at_end(const Trajectory& motion) {
  for (const double v : motion.qdot(motion.size() - 1)) EXPECT_EQ(v, 0.0);
}

TEST(Brake, OneJointStopsAfterHalfItsSpeedSquaredByItsLimit) {
  const double v = 0.8, a = 1.6;
  const auto stop = brake(cruise({v}, 10.0), 3.0, {{1.0}, {a}, {}});
  ASSERT_TRUE(stop) << stop.error().describe();
  EXPECT_NEAR(stop->q(0)[0], 3.0 * v, 1e-14);
  EXPECT_NEAR(stop->qdot(0)[0], v, 1e-14);
  EXPECT_NEAR(stop->q(stop->size() - 1)[0] - stop->q(0)[0], v * v / (2 * a), 1e-3 * v * v / a);
  EXPECT_NEAR(stop->duration_s(), v / a, 2e-3 * v / a);
  expect_rest_at_end(*stop);
}

// The HSR's base at full speed: 4 s and 0.4 m by its planning limit.
TEST(Brake, StopsByTheLimitOfBrakingWhereThereIsOne) {
  const double v = 0.2;
  for (const auto& [braking, limit] : {std::pair(std::vector<double>{}, 0.05),
                                       {std::vector<double>{0.05}, 0.05},
                                       {std::vector<double>{0.4}, 0.4}}) {
    const MotionLimits limits{{1.0}, {0.05}, {}, braking};
    const auto stop = brake(cruise({v}, 20.0), 3.0, limits);
    ASSERT_TRUE(stop) << stop.error().describe();
    EXPECT_NEAR(stop->duration_s(), v / limit, 2e-3 * v / limit);
    EXPECT_NEAR(stop->q(stop->size() - 1)[0] - 3.0 * v, v * v / (2 * limit), 1e-3 * v * v / limit);
    const auto straight = brake_straight(
        {Eigen::VectorXd::Constant(1, 0.6), Eigen::VectorXd::Constant(1, v)}, limits);
    ASSERT_TRUE(straight) << straight.error().describe();
    EXPECT_NEAR(straight->duration_s(), v / limit, 1e-5 * v / limit);
    EXPECT_NEAR(straight->q(1)[0] - 0.6, v * v / (2 * limit), 1e-5 * v * v / limit);
  }
}

TEST(Brake, IsTheSameToTheLastBitWhereBrakingIsTheAcceleration) {
  MotionLimits limits{{0.5, 0.8}, {0.6, 0.9}, {}};
  const Trajectory motion = winding(2, 3, limits);
  MotionLimits same = limits;
  same.braking = same.acceleration;
  const double from_s = 0.4 * motion.duration_s();
  const auto one = brake(motion, from_s, limits), other = brake(motion, from_s, same);
  ASSERT_TRUE(one && other);
  EXPECT_EQ(one->times_s, other->times_s);
  EXPECT_EQ(one->positions, other->positions);
  EXPECT_EQ(one->velocities, other->velocities);
}

TEST(Brake, OneJointStopsFromAnySpeedOnTheWayUp) {
  // From rest with a = 2: v = 2 t and q = t^2, until 1.5 s.
  Trajectory rise = make_trajectory(1, 2, 1.5);
  rise.q(1)[0] = 2.25;
  rise.qdot(1)[0] = 3.0;
  for (const double t : {0.001, 0.1, 0.4, 0.7}) {
    const auto stop = brake(rise, t, {{3.0}, {2.0}, {}});
    ASSERT_TRUE(stop) << t << ": " << stop.error().describe();
    EXPECT_NEAR(stop->q(stop->size() - 1)[0], 2.0 * t * t, 2e-3 * t * t);
    EXPECT_NEAR(stop->duration_s(), t, 3e-3 * t);
  }
}

TEST(Brake, TheJointThatBrakesWorstSetsTheTimeOnAStraightPath) {
  const auto stop = brake(cruise({1.0, 0.5}, 20.0), 1.0, {{1.0, 1.0}, {2.0, 0.25}, {}});
  ASSERT_TRUE(stop) << stop.error().describe();
  EXPECT_NEAR(stop->duration_s(), 0.5 / 0.25, 5e-3);
  const auto end = stop->q(stop->size() - 1);
  EXPECT_NEAR(end[0] - 1.0, 1.0 * 2.0 / 2, 5e-3);
  EXPECT_NEAR(end[1] - 0.5, 0.5 * 2.0 / 2, 5e-3);
}

TEST(Brake, KeepsLimitsAndPathOfWindingMotions) {
  for (const int dof : {2, 8}) {
    MotionLimits limits;
    for (int j = 0; j < dof; ++j) {
      limits.velocity.push_back(0.5 + 0.1 * j);
      limits.acceleration.push_back(0.6 + 0.2 * j);
    }
    for (std::uint64_t seed = 1; seed <= 4; ++seed) {
      const Trajectory motion = winding(dof, seed, limits);
      for (const double share : {0.1, 0.35, 0.5, 0.8, 0.99}) {
        const double from_s = share * motion.duration_s();
        const auto stop = brake(motion, from_s, limits);
        ASSERT_TRUE(stop) << stop.error().describe();
        std::vector<double> q(limits.velocity.size()), v(q);
        motion.sample(from_s, q, v);
        EXPECT_THAT(stop->q(0), testing::ElementsAreArray(q));
        EXPECT_THAT(stop->qdot(0), testing::ElementsAreArray(v));
        expect_rest_at_end(*stop);
        const auto use = limit_use(*stop, limits, 4'000);
        EXPECT_LE(*std::ranges::max_element(use), 1.0 + 1e-3);
        EXPECT_LE(distance_from(*stop, cut(motion, from_s, motion.duration_s())),
                  1e-4 * std::sqrt(dof) + 1e-5);
        double least_s = 0.0;  // no joint stops sooner than by itself
        for (std::size_t j = 0; j < v.size(); ++j) {
          least_s = std::max(least_s, std::abs(v[j]) / limits.acceleration[j]);
        }
        EXPECT_GE(stop->duration_s(), least_s * (1 - 1e-4));
        EXPECT_LE(stop->duration_s(), (motion.duration_s() - from_s) * 1.02 + 1e-3);
      }
    }
  }
}

/// The most that any joint's speed grows by, and falls by, relative to the limits of motions, from
/// differences of densely sampled positions.
std::pair<double, double> growth_and_fall(const Trajectory& motion, const MotionLimits& limits) {
  constexpr int kSteps = 4'000;
  const auto rows = sampled(motion, kSteps);
  const double h = motion.duration_s() / kSteps;
  double growth = 0.0, fall = 0.0;
  for (std::size_t i = 1; i + 1 < rows.size(); ++i) {
    for (std::size_t j = 0; j < rows[i].size(); ++j) {
      const double before = (rows[i][j] - rows[i - 1][j]) / h;
      const double after = (rows[i + 1][j] - rows[i][j]) / h;
      const double change = (std::abs(after) - std::abs(before)) / h / limits.acceleration[j];
      growth = std::max(growth, change);
      fall = std::max(fall, -change);
    }
  }
  return {growth, fall};
}

// A joint that gains speed in a bend of the way on which the others brake has no brakes to do it
// with.
TEST(Brake, HardGainsSpeedNoFasterThanTheMotionMay) {
  for (const int dof : {2, 8}) {
    MotionLimits limits;
    for (int j = 0; j < dof; ++j) {
      limits.velocity.push_back(0.5 + 0.1 * j);
      limits.acceleration.push_back(0.6 + 0.2 * j);
      limits.braking.push_back(3.0 * limits.acceleration.back());
    }
    double hardest = 0.0;
    for (std::uint64_t seed = 1; seed <= 8; ++seed) {
      const Trajectory motion = winding(dof, seed, limits);
      for (double share = 0.05; share < 1.0; share += 0.05) {
        const auto stop = brake(motion, share * motion.duration_s(), limits);
        ASSERT_TRUE(stop) << stop.error().describe();
        const auto [growth, fall] = growth_and_fall(*stop, limits);
        EXPECT_LE(growth, 1.0 + 1e-2) << dof << " joints, seed " << seed << ", " << share;
        EXPECT_LE(fall, 3.0 + 1e-2);
        hardest = std::max(hardest, fall);
      }
    }
    EXPECT_GT(hardest, 2.9);
  }
}

TEST(Brake, GoesNoFurtherThanACornerWhereThePathRests) {
  // As fast as the limits allow along x, then along y, with a rest between: braked as hard as it
  // may be on the way to the corner, it cannot stop before, and must not go on after it.
  const double a = 0.1, half_s = 3.0, v = a * half_s, leg = v * half_s;
  Trajectory path = make_trajectory(2, 5, half_s);
  for (int i = 0; i < path.size(); ++i) {
    path.q(i)[0] = std::min(i, 2) * 0.5 * leg;
    path.q(i)[1] = std::max(0, i - 2) * 0.5 * leg;
    if (i % 2 == 1) path.qdot(i)[i / 2] = v;
  }
  const MotionLimits limits{{1.0, 1.0}, {a, a}, {}};
  for (double from_s = 0.1; from_s < 2.0 * half_s; from_s += 0.1) {
    const auto stop = brake(path, from_s, limits);
    if (!stop) continue;  // then it stops on a straight line
    EXPECT_LE(from_s + stop->duration_s(), 2.0 * half_s * 1.001) << from_s;
    EXPECT_LE(stop->q(stop->size() - 1)[0], leg * (1.0 + 1e-9)) << from_s;
    EXPECT_LE(stop->q(stop->size() - 1)[1], 1e-12) << from_s;
    expect_rest_at_end(*stop);
  }
  const auto on_the_way = brake(path, 4.0, limits);
  ASSERT_TRUE(on_the_way) << on_the_way.error().describe();
  EXPECT_NEAR(on_the_way->q(on_the_way->size() - 1)[0], leg, 1e-6);
}

TEST(Brake, RestsWhereThereIsNoVelocity) {
  const auto stop =
      brake(resting(std::vector<double>{0.3, -1.0}, 2.0), 1.0, {{1.0, 1.0}, {1.0, 1.0}, {}});
  ASSERT_TRUE(stop) << stop.error().describe();
  EXPECT_THAT(stop->positions, testing::ElementsAre(0.3, -1.0, 0.3, -1.0));
  EXPECT_THAT(stop->velocities, testing::Each(0.0));
}

TEST(Brake, SlowsDownWhatIsBeyondItsVelocityLimit) {
  const auto stop = brake(cruise({2.0}, 10.0), 0.0, {{1.0}, {1.0}, {}});
  ASSERT_TRUE(stop) << stop.error().describe();
  EXPECT_NEAR(stop->duration_s(), 2.0, 0.01);
  EXPECT_NEAR(stop->q(stop->size() - 1)[0], 2.0, 0.01);
}

TEST(Brake, RefusesAPathThatEndsBeforeTheRobotCanStop) {
  const auto stop = brake(cruise({1.0}, 1.0), 0.8, {{1.0}, {1.0}, {}});
  ASSERT_FALSE(stop);
  EXPECT_EQ(stop.error().code, ErrorCode::kInvalidArgument);
}

TEST(Brake, RefusesWhatMakesNoSense) {
  EXPECT_FALSE(brake(cruise({1.0}, 1.0), 0.0, {{1.0}, {1.0}, {}, {1.0, 1.0}}));
  EXPECT_FALSE(brake({}, 0.0, {}));
  EXPECT_FALSE(brake(cruise({1.0}, 1.0), std::nan(""), {{1.0}, {1.0}, {}}));
  EXPECT_FALSE(brake(cruise({1.0}, 1.0), 0.0, {{1.0, 1.0}, {1.0, 1.0}, {}}));
  const auto frozen = brake(cruise({1.0, 1.0}, 1.0), 0.0, {{1.0, 1.0}, {1.0, 0.0}, {"x", "lift"}});
  ASSERT_FALSE(frozen);
  EXPECT_THAT(frozen.error().message, HasSubstr("lift"));
}

TEST(Brake, RefusesAPathThatEndsWhereItBegins) {
  EXPECT_FALSE(brake(cruise({1.0}, 1.0), 1.0, {{1.0}, {1.0}, {}}));
  EXPECT_FALSE(brake(cruise({1.0}, 1.0), 1.0 - 1e-6, {{1.0}, {1.0}, {}}));
}

TEST(BrakeStraight, RefusesWhatMakesNoSense) {
  const Eigen::Vector2d two(1.0, 2.0), nan(1.0, std::nan(""));
  const MotionLimits limits{{1.0, 1.0}, {1.0, 1.0}, {}};
  EXPECT_TRUE(brake_straight({two, two}, limits));
  EXPECT_FALSE(brake_straight({two, Eigen::VectorXd::Ones(1)}, limits));
  EXPECT_FALSE(brake_straight({two, two}, {{1.0}, {1.0}, {}}));
  EXPECT_FALSE(brake_straight({two, two}, {{1.0, 1.0}, {1.0, 1.0}, {}, {1.0}}));
  EXPECT_FALSE(brake_straight({Eigen::VectorXd(), Eigen::VectorXd()}, {}));
  EXPECT_FALSE(brake_straight({nan, two}, limits));
  EXPECT_FALSE(brake_straight({two, nan}, limits));
  const auto frozen = brake_straight({two, two}, {{1.0, 1.0}, {1.0, 0.0}, {"x", "lift"}});
  ASSERT_FALSE(frozen);
  EXPECT_THAT(frozen.error().message, HasSubstr("lift"));
}

TEST(BrakeStraight, SlowsAllJointsEvenly) {
  const RobotState state{Eigen::Vector2d(1.0, 2.0), Eigen::Vector2d(0.6, -0.3)};
  const auto stop = brake_straight(state, {{1.0, 1.0}, {2.0, 0.5}, {}});
  ASSERT_TRUE(stop) << stop.error().describe();
  EXPECT_NEAR(stop->duration_s(), 0.6, 1e-5);
  for (const double t : {0.0, 0.2, 0.45, 0.6}) {
    double q[2], v[2];
    stop->sample(t, q, v);
    for (int j = 0; j < 2; ++j) {
      EXPECT_NEAR(q[j], state.q[j] + state.qdot[j] * (t - t * t / 1.2), 1e-5);
      EXPECT_NEAR(v[j], state.qdot[j] * (1 - t / 0.6), 1e-5);
    }
  }
}

TEST(RetimeThatStops, EndsAtRestWhateverThePathsSpeed) {
  const auto stop = retime(cruise({1.0}, 2.0), {{1.0}, {1.0}, {}}, {.stop_at_goal = true});
  ASSERT_TRUE(stop) << stop.error().describe();
  expect_rest_at_end(stop->trajectory);
  // 1.5 m at full speed, then 0.5 m in 1 s.
  EXPECT_NEAR(stop->trajectory.duration_s(), 2.5, 5e-3);
}

TEST(Cut, IsTheSameMotion) {
  const Trajectory whole = winding(3, 7, {{1, 1, 1}, {1, 1, 1}, {}});
  const double from_s = 0.31 * whole.duration_s(), to_s = 0.77 * whole.duration_s();
  const Trajectory part = cut(whole, from_s, to_s);
  ASSERT_TRUE(part.validate());
  EXPECT_NEAR(part.duration_s(), to_s - from_s, 1e-12);
  for (int i = 0; i <= 200; ++i) {
    const double t = part.duration_s() * i / 200;
    double q[3], v[3], q_whole[3], v_whole[3];
    part.sample(t, q, v);
    whole.sample(from_s + t, q_whole, v_whole);
    for (int j = 0; j < 3; ++j) {
      EXPECT_NEAR(q[j], q_whole[j], 1e-9);
      EXPECT_NEAR(v[j], v_whole[j], 1e-7);
    }
  }
}

TEST(Cut, WaitsBeyondTheEnd) {
  const Trajectory whole = winding(1, 3, {{1}, {1}, {}});
  const double end_s = whole.duration_s(), end = whole.q(whole.size() - 1)[0];
  for (const double from_s : {0.5 * end_s, end_s, end_s + 3.0}) {
    const Trajectory part = cut(whole, from_s, from_s + end_s);
    ASSERT_TRUE(part.validate()) << part.validate().error().describe();
    EXPECT_NEAR(part.duration_s(), end_s, 1e-5);
    double q = 0.0, v = 1.0;
    part.sample(part.duration_s(), {&q, 1}, {&v, 1});
    EXPECT_EQ(q, end);
    EXPECT_EQ(v, 0.0);
  }
}

TEST(NearestState, IsFoundBetweenStates) {
  const Trajectory whole = winding(3, 7, {{1, 1, 1}, {1, 1, 1}, {}});
  for (int i = 0; i <= 60; ++i) {
    const double time_s = whole.duration_s() * i / 60;
    std::vector<double> q(3), beside(3);
    whole.sample(time_s, q, {});
    EXPECT_LT(nearest_state(whole, q).off, 1e-4) << time_s;
    beside = q;
    beside[1] += 0.01;
    // Brute force.
    double least = 1.0;
    for (int k = 0; k <= 20000; ++k) {
      std::vector<double> there(3);
      whole.sample(whole.duration_s() * k / 20000, there, {});
      double off = 0.0;
      for (std::size_t j = 0; j < 3; ++j) off = std::max(off, std::abs(there[j] - beside[j]));
      least = std::min(least, off);
    }
    const NearestState found = nearest_state(whole, beside);
    EXPECT_LT(found.off, std::max(1.5 * least, least + 1e-4)) << time_s;
    std::vector<double> there(3);
    whole.sample(found.time_s, there, {});
    double off = 0.0;
    for (std::size_t j = 0; j < 3; ++j) off = std::max(off, std::abs(there[j] - beside[j]));
    EXPECT_NEAR(off, found.off, 1e-12);
  }
}

TEST(NearestState, IsTheEndOfAWait) {
  const Trajectory way = winding(1, 3, {{1}, {1}, {}});
  const auto end = way.q(way.size() - 1);
  const Trajectory waiting = joined(way, resting(end, 2.0));
  EXPECT_EQ(nearest_state(waiting, end).time_s, way.duration_s() + 2.0);
}

TEST(Joined, GoesFromOneToTheOther) {
  const Trajectory whole = winding(2, 5, {{1, 1}, {1, 1}, {}});
  const double middle_s = 0.4 * whole.duration_s();
  const Trajectory again =
      joined(cut(whole, 0.0, middle_s), cut(whole, middle_s, whole.duration_s()));
  ASSERT_TRUE(again.validate());
  for (int i = 0; i <= 200; ++i) {
    double q[2], q_whole[2];
    again.sample(whole.duration_s() * i / 200, q, {});
    whole.sample(whole.duration_s() * i / 200, q_whole, {});
    EXPECT_NEAR(q[0], q_whole[0], 1e-9);
    EXPECT_NEAR(q[1], q_whole[1], 1e-9);
  }
}

}  // namespace
}  // namespace sidestep
