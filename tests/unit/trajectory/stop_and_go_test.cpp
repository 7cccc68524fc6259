// Paths of straight lines between stops, which are timed in closed form.
#include <algorithm>
#include <cmath>
#include <limits>
#include <random>
#include <string>

#include <gtest/gtest.h>

#include <sidestep/trajectory/retime.hpp>

#include "support/path_probe.hpp"

namespace sidestep {
namespace {

using testing_support::limit_use;
using testing_support::stray;

constexpr double kNoLimit = std::numeric_limits<double>::infinity();

Trajectory polyline(int dof, int vertices, std::mt19937_64& random) {
  std::normal_distribution<double> normal;
  Trajectory path = make_trajectory(dof, vertices, 1.0);
  for (double& q : path.positions) q = normal(random);
  return path;
}

MotionLimits random_limits(int dof, std::mt19937_64& random) {
  std::uniform_real_distribution<double> power(-0.7, 0.7);
  MotionLimits limits;
  for (int j = 0; j < dof; ++j) {
    limits.velocity.push_back(std::pow(10.0, power(random)));
    limits.acceleration.push_back(std::pow(10.0, power(random)));
  }
  return limits;
}

/// From rest to rest on each line, as a share of its way: the slowest joint's limits bind.
double least_time_along(const Trajectory& path, const MotionLimits& limits) {
  double sum_s = 0.0;
  for (int line = 0; line + 1 < path.size(); ++line) {
    double speed = kNoLimit, acceleration = kNoLimit;
    for (std::size_t j = 0; j < limits.velocity.size(); ++j) {
      const double way = std::abs(path.q(line + 1)[j] - path.q(line)[j]);
      speed = std::min(speed, limits.velocity[j] / way);
      acceleration = std::min(acceleration, limits.acceleration[j] / way);
    }
    sum_s += speed * speed < acceleration ? 1.0 / speed + speed / acceleration
                                          : 2.0 / std::sqrt(acceleration);
  }
  return sum_s;
}

TEST(StopAndGo, IsTheFastestMotionAlongAPolyline) {
  std::mt19937_64 random(31);
  for (int trial = 0; trial < 30; ++trial) {
    SCOPED_TRACE("trial " + std::to_string(trial));
    const Trajectory path = polyline(1 + trial % 8, 2 + trial % 7, random);
    const MotionLimits limits = random_limits(path.dof, random);
    const auto retimed = retime(path, limits);
    ASSERT_TRUE(retimed) << retimed.error().describe();
    const Trajectory& motion = retimed->trajectory;
    ASSERT_TRUE(motion.validate());
    const double least_s = least_time_along(path, limits);
    // A joint may turn back where another does not, or go on in the same direction, with one dof.
    const bool may_go_on = path.dof == 1;
    if (!may_go_on) {
      EXPECT_GE(motion.duration_s(), least_s * (1.0 - 1e-9));
    }
    EXPECT_LE(motion.duration_s(), least_s * 1.001);
    const auto use = limit_use(motion, limits, 20'000);
    EXPECT_LE(*std::ranges::max_element(use), 1.0 + 1e-5);
    if (may_go_on) continue;
    EXPECT_EQ(retimed->deviation, 0.0);
    EXPECT_LE(stray(motion, path, 6'000), 1e-6);  // its samples are not the corners
    EXPECT_LE(stray(path, motion, 6'000), 2e-3);  // a polyline cuts corners
  }
}

TEST(StopAndGo, EndsAtThePathsOwnStatesAtRest) {
  std::mt19937_64 random(32);
  const Trajectory path = polyline(7, 5, random);
  const auto retimed = retime(path, random_limits(7, random));
  ASSERT_TRUE(retimed) << retimed.error().describe();
  const Trajectory& motion = retimed->trajectory;
  // Every vertex is one of its states, exactly, and at rest.
  int vertex = 0;
  for (int i = 0; i < motion.size() && vertex < path.size(); ++i) {
    if (!std::ranges::equal(motion.q(i), path.q(vertex))) continue;
    for (const double v : motion.qdot(i)) EXPECT_EQ(v, 0.0);
    ++vertex;
  }
  EXPECT_EQ(vertex, path.size());
  EXPECT_LE(motion.size(), 1 + 3 * (path.size() - 1));
}

TEST(StopAndGo, KeepsLimitsWhereFullSpeedIsHardlyReached) {
  // 1 m at 1 m/s^2 reaches 1 m/s in the middle.
  Trajectory path = make_trajectory(1, 2, 1.0);
  path.q(1)[0] = 1.0;
  for (const double off : {-1e-2, -1e-3, -1e-6, -1e-12, 0.0, 1e-12, 1e-6, 1e-3, 1e-2}) {
    SCOPED_TRACE(off);
    const MotionLimits limits{{1.0 + off}, {1.0}, {}};
    const auto retimed = retime(path, limits);
    ASSERT_TRUE(retimed) << retimed.error().describe();
    ASSERT_TRUE(retimed->trajectory.validate());
    const auto use = limit_use(retimed->trajectory, limits, 20'000);
    EXPECT_LE(*std::ranges::max_element(use), 1.0 + 1e-5);
    EXPECT_NEAR(retimed->trajectory.duration_s(), least_time_along(path, limits), 1e-3);
    for (std::size_t i = 1; i < retimed->trajectory.times_s.size(); ++i) {
      EXPECT_GT(retimed->trajectory.times_s[i] - retimed->trajectory.times_s[i - 1], 1e-4);
    }
  }
}

}  // namespace
}  // namespace sidestep
