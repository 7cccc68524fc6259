// Paths of straight pieces that meet at corners too shallow to stop at.
#include <algorithm>
#include <cmath>
#include <random>
#include <string>

#include <gtest/gtest.h>

#include <sidestep/trajectory/retime.hpp>

#include "support/path_probe.hpp"

namespace sidestep {
namespace {

using testing_support::limit_use;
using testing_support::stray;

/// `pieces` straight pieces from rest to rest, at one speed in the mean, of lengths 10^least to
/// 10^most but for the middle one's 1, each turned from the one before by 10^shallowest to
/// 10^steepest rad.
struct Corners {
  int dof = 7;
  int pieces = 4;
  double least = -1.5, most = 0.3;
  double shallowest = -9.0, steepest = -2.0;
};

Trajectory cornered(const Corners& corners, std::mt19937_64& random) {
  std::normal_distribution<double> normal;
  std::uniform_real_distribution<double> uniform;
  const auto power = [&](double low, double high) {
    return std::pow(10.0, low + (high - low) * uniform(random));
  };
  Eigen::VectorXd at(corners.dof), along(corners.dof), aside(corners.dof);
  for (double& value : at) value = normal(random);
  for (double& value : along) value = normal(random);
  along.normalize();
  Trajectory path = make_trajectory(corners.dof, corners.pieces + 1, 1.0);
  for (int i = 0; i <= corners.pieces; ++i) {
    std::ranges::copy(at, path.q(i).begin());
    const double random_length = power(corners.least, corners.most);
    const double length = i == corners.pieces / 2 ? 1.0 : random_length;
    at += length * along;
    if (i < corners.pieces) {
      path.times_s[static_cast<std::size_t>(i) + 1] =
          path.times_s[static_cast<std::size_t>(i)] + length;
    }
    for (double& value : aside) value = normal(random);
    aside = (aside - aside.dot(along) * along).normalized();
    along = (along + power(corners.shallowest, corners.steepest) * aside).normalized();
  }
  return path;
}

MotionLimits some_limits(int dof, std::mt19937_64& random) {
  std::uniform_real_distribution<double> uniform(0.5, 4.0);
  MotionLimits limits;
  for (int j = 0; j < dof; ++j) {
    limits.velocity.push_back(uniform(random));
    limits.acceleration.push_back(uniform(random));
  }
  return limits;
}

/// The largest share of the acceleration limits that any two states' velocities take on average
/// between them; a step between states that are next to the same instant takes more than all.
double use_between_states(const Trajectory& motion, const MotionLimits& limits) {
  constexpr double kRounding = 1e-13;  // m/s, rad/s
  double most = 0.0;
  for (int i = 0; i < motion.size(); ++i) {
    for (int k = i + 1; k < std::min(i + 5, motion.size()); ++k) {
      const double h =
          motion.times_s[static_cast<std::size_t>(k)] - motion.times_s[static_cast<std::size_t>(i)];
      for (std::size_t j = 0; j < static_cast<std::size_t>(motion.dof); ++j) {
        const double step = std::abs(motion.qdot(k)[j] - motion.qdot(i)[j]);
        most = std::max(most, std::max(0.0, step - kRounding) / (h * limits.acceleration[j]));
      }
    }
  }
  return most;
}

/// The same by second differences of positions around the middle between any two states.
double use_around_states(const Trajectory& motion, const MotionLimits& limits) {
  constexpr double kStep_s = 1e-4;
  const auto dof = static_cast<std::size_t>(motion.dof);
  std::vector<double> before(dof), here(dof), after(dof);
  double most = 0.0;
  for (const double time_s : motion.times_s) {
    const double t = std::clamp(time_s, kStep_s, motion.duration_s() - kStep_s);
    motion.sample(t - kStep_s, before, {});
    motion.sample(t, here, {});
    motion.sample(t + kStep_s, after, {});
    for (std::size_t j = 0; j < dof; ++j) {
      const double bend = std::abs(after[j] - 2.0 * here[j] + before[j]) / (kStep_s * kStep_s);
      most = std::max(most, bend / limits.acceleration[j]);
    }
  }
  return most;
}

double shortest_s(const Trajectory& motion) {
  double shortest = motion.duration_s();
  for (std::size_t i = 1; i < motion.times_s.size(); ++i) {
    shortest = std::min(shortest, motion.times_s[i] - motion.times_s[i - 1]);
  }
  return shortest;
}

void expect_smooth(const Trajectory& path, const MotionLimits& limits, const Retiming& retimed) {
  const Trajectory& motion = retimed.trajectory;
  const auto valid = motion.validate();
  ASSERT_TRUE(valid) << valid.error().describe();
  EXPECT_LE(use_between_states(motion, limits), 1.0 + 1e-5);
  EXPECT_LE(use_around_states(motion, limits), 1.0 + 1e-4);
  const auto use = limit_use(motion, limits, 20'000);
  EXPECT_LE(*std::ranges::max_element(use), 1.0 + 1e-4);
  EXPECT_LE(retimed.deviation, 1e-4);
  EXPECT_LE(stray(motion, path, 12'000), 1e-4 * std::sqrt(path.dof) + 1e-5);
  EXPECT_LE(stray(path, motion, 12'000), 1e-4 * std::sqrt(path.dof) + 1e-5);
}

TEST(RetimeCorners, KeepLimitsWherePiecesMeetAtShallowCorners) {
  std::mt19937_64 random(11);
  for (int trial = 0; trial < 30; ++trial) {
    SCOPED_TRACE("trial " + std::to_string(trial));
    const Trajectory path = cornered({.dof = 2 + trial % 7, .pieces = 2 + trial % 5}, random);
    const MotionLimits limits = some_limits(path.dof, random);
    const auto retimed = retime(path, limits, {.least_stages = trial % 2 == 0 ? 400 : 100});
    ASSERT_TRUE(retimed) << retimed.error().describe();
    expect_smooth(path, limits, *retimed);
    // An acceleration of 1 changes positions by more than their last digits.
    EXPECT_GT(shortest_s(retimed->trajectory), 1e-6);
  }
}

TEST(RetimeCorners, KeepLimitsWherePiecesAreTiny) {
  std::mt19937_64 random(12);
  for (int trial = 0; trial < 30; ++trial) {
    SCOPED_TRACE("trial " + std::to_string(trial));
    const Trajectory path =
        cornered({.dof = 2 + trial % 7, .pieces = 3 + trial % 9, .least = -13.0}, random);
    const MotionLimits limits = some_limits(path.dof, random);
    const auto retimed = retime(path, limits);
    ASSERT_TRUE(retimed) << retimed.error().describe();
    expect_smooth(path, limits, *retimed);
  }
}

TEST(RetimeCorners, TakeNoTimeWhereTheyAreShallow) {
  std::mt19937_64 random(13);
  for (int trial = 0; trial < 12; ++trial) {
    SCOPED_TRACE("trial " + std::to_string(trial));
    std::mt19937_64 same = random;
    const Corners shallow{.steepest = -4.0};
    Corners none = shallow;
    none.shallowest = none.steepest = -20.0;
    const Trajectory path = cornered(shallow, random), line = cornered(none, same);
    const MotionLimits limits = some_limits(path.dof, random);
    const auto retimed = retime(path, limits), straight = retime(line, limits);
    ASSERT_TRUE(retimed) << retimed.error().describe();
    ASSERT_TRUE(straight) << straight.error().describe();
    EXPECT_NEAR(retimed->trajectory.duration_s(), straight->trajectory.duration_s(),
                0.005 * straight->trajectory.duration_s());
  }
}

TEST(RetimeCorners, StopAtSteepOnesAndPassShallowOnesOfOnePath) {
  std::mt19937_64 random(14);
  for (int trial = 0; trial < 12; ++trial) {
    SCOPED_TRACE("trial " + std::to_string(trial));
    const Trajectory path =
        cornered({.dof = 3, .pieces = 6, .shallowest = -4.0, .steepest = 0.0}, random);
    const MotionLimits limits = some_limits(path.dof, random);
    const auto retimed = retime(path, limits);
    ASSERT_TRUE(retimed) << retimed.error().describe();
    expect_smooth(path, limits, *retimed);
  }
}

// A stop, and after it hardly anything: the profile has no speed anywhere on that last piece.
TEST(RetimeCorners, ATinyWayAfterAStopTakesTimeAndKeepsTheLimits) {
  const MotionLimits limits{{1.0, 1.0}, {1.0, 1.0}, {}};
  for (int digits = 1; digits <= 12; ++digits) {
    const double way = std::pow(10.0, -digits);
    Trajectory path = make_trajectory(2, 3, 0.0);
    path.times_s = {0.0, 2.0, 2.5};
    path.qdot(0)[0] = 0.5;
    path.q(1)[0] = path.q(2)[0] = 0.5;
    path.q(2)[1] = way;
    path.qdot(2)[1] = way;
    const auto retimed = retime(path, limits, {.least_stages = 100, .stop_at_goal = true});
    ASSERT_TRUE(retimed) << digits << ": " << retimed.error().describe();
    const auto sound = retimed->trajectory.validate();
    ASSERT_TRUE(sound) << digits << ": " << sound.error().describe();
    const auto use = limit_use(retimed->trajectory, limits, 5000);
    EXPECT_LE(*std::ranges::max_element(use), 1.01) << digits;
    EXPECT_NEAR(retimed->trajectory.q(retimed->trajectory.size() - 1)[1], way, 1e-9) << digits;
  }
}

}  // namespace
}  // namespace sidestep
