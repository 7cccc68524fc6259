#include <algorithm>
#include <cmath>
#include <limits>
#include <random>

#include <gtest/gtest.h>

#include <sidestep/core/index.hpp>
#include <sidestep/planning/prediction_check.hpp>
#include <sidestep/trajectory/retime.hpp>
#include <sidestep/trajectory/splice.hpp>

#include "support/ball_robot.hpp"

namespace sidestep {
namespace {

using Knot = PredictedSet::Knot;

constexpr double kRadius_m = 0.3;

std::shared_ptr<const RobotModel> disc() {
  return std::make_shared<testing_support::BallRobot>(kRadius_m);
}

MotionLimits limits_of(double speed_mps, double acceleration_mps2) {
  return {{speed_mps, speed_mps, speed_mps},
          {acceleration_mps2, acceleration_mps2, acceleration_mps2},
          {"x", "y", "z"}};
}

/// From rest to rest along the x axis.
Trajectory along_x(double length_m, const MotionLimits& limits) {
  const RobotState start{Eigen::Vector3d(0.0, 0.0, 0.9), Eigen::Vector3d::Zero()};
  const RobotState goal{Eigen::Vector3d(length_m, 0.0, 0.9), Eigen::Vector3d::Zero()};
  return retime(straight_line(start, goal, 20, 0.5), limits, {.stop_at_goal = true})->trajectory;
}

PredictedSet person(std::int64_t track, std::vector<Knot> knots) {
  return {track, 1.0, 0.0, 1.8, std::move(knots)};
}

std::shared_ptr<const Prediction> predicted(std::vector<PredictedSet> sets) {
  auto prediction = Prediction::create(Stamp{}, std::move(sets));
  EXPECT_TRUE(prediction.has_value());
  return std::make_shared<const Prediction>(std::move(*prediction));
}

/// Clearance of the disc at one time, from the sets' own definition.
double clearance_m(const Trajectory& trajectory, double time_s, const Prediction& prediction,
                   double from_s) {
  std::vector<double> q(3);
  trajectory.sample(time_s, q, {});
  double least_m = std::numeric_limits<double>::infinity();
  for (const PredictedSet& set : prediction.sets()) {
    for (std::size_t k = 1; k < set.knots.size(); ++k) {
      const Knot &a = set.knots[k - 1], &b = set.knots[k];
      const double t = from_s + time_s;
      if (t < a.time_s || t > b.time_s) continue;
      const double share = (t - a.time_s) / (b.time_s - a.time_s);
      const double x = a.centre_m.x() + share * (b.centre_m.x() - a.centre_m.x());
      const double y = a.centre_m.y() + share * (b.centre_m.y() - a.centre_m.y());
      const double radius_m = a.radius_m + share * (b.radius_m - a.radius_m);
      least_m = std::min(least_m, std::hypot(q[0] - x, q[1] - y) - radius_m - kRadius_m);
    }
  }
  return least_m;
}

double least_clearance_m(const Trajectory& trajectory, const Prediction& prediction,
                         double from_s) {
  double least_m = std::numeric_limits<double>::infinity();
  for (double t = 0.0; t < trajectory.duration_s(); t += 1e-3) {
    least_m = std::min(least_m, clearance_m(trajectory, t, prediction, from_s));
  }
  return least_m;
}

TEST(PredictionCheck, FindsTheInstantAtWhichAMeetingBegins) {
  // The robot at 1 m/s along x, somebody at rest at x = 4: they touch after 4 - 0.3 - 0.25 m, the
  // margin before that.
  const auto limits = limits_of(1.0, 1e3);
  const Trajectory way = along_x(8.0, limits);
  const auto standing =
      predicted({person(7, {{-1.0, {4.0, 0.0}, 0.25}, {20.0, {4.0, 0.0}, 0.25}})});
  const PredictionCheck check(disc(), 0.1);
  const auto conflict = check.first_conflict(way, 0.0, {standing, 0.0});
  ASSERT_TRUE(conflict);
  EXPECT_NEAR(conflict->time_s, 4.0 - 0.3 - 0.25 - 0.1, 0.005);
  EXPECT_EQ(conflict->track, 7);
  EXPECT_NEAR(conflict->clearance_m, 0.1, 0.002);
}

TEST(PredictionCheck, AgreesWithDenseSamplingOnRandomWalkers) {
  std::mt19937 random(11);
  std::uniform_real_distribution<double> place(-1.0, 9.0), speed(-1.5, 1.5), begin(0.0, 2.0);
  const auto limits = limits_of(0.8, 0.5);
  const Trajectory way = along_x(8.0, limits);
  const PredictionCheck check(disc(), 0.05);
  int met = 0, clear = 0;
  for (int i = 0; i < 1000; ++i) {
    const Eigen::Vector2d from(place(random), 2.0 * speed(random));
    const Eigen::Vector2d velocity(speed(random), speed(random));
    const auto walker = predicted(
        {person(i, {{-3.0, from - 3.0 * velocity, 0.2}, {9.0, from + 9.0 * velocity, 0.5}})});
    const double from_s = begin(random);
    if (clearance_m(way, 0.0, *walker, from_s) < 0.06) continue;
    double sampled_s = std::numeric_limits<double>::infinity();
    double least_m = std::numeric_limits<double>::infinity();
    for (double t = 0.0; t < std::min(way.duration_s(), 9.0 - from_s); t += 1e-3) {
      const double now_m = clearance_m(way, t, *walker, from_s);
      least_m = std::min(least_m, now_m);
      if (now_m < 0.05) {
        sampled_s = t;
        break;
      }
    }
    const auto conflict = check.first_conflict(way, 0.0, {walker, from_s});
    if (std::isfinite(sampled_s)) {
      ASSERT_TRUE(conflict) << i;
      EXPECT_LE(conflict->time_s, sampled_s + 1e-3) << i;
      EXPECT_GE(clearance_m(way, conflict->time_s, *walker, from_s), 0.049) << i;
      ++met;
    } else if (least_m > 0.055) {
      EXPECT_FALSE(conflict) << i;
      ++clear;
    }
  }
  EXPECT_GT(met, 50);
  EXPECT_GT(clear, 50);
}

TEST(PredictionCheck, LetsARobotLeaveWhatItStandsIn) {
  const auto limits = limits_of(1.0, 1.0);
  const Trajectory away = along_x(3.0, limits);
  const auto behind = predicted({person(1, {{0.0, {-0.4, 0.0}, 0.2}, {9.0, {-0.4, 0.0}, 0.2}})});
  const auto ahead = predicted({person(1, {{0.0, {0.4, 0.0}, 0.2}, {9.0, {0.4, 0.0}, 0.2}})});
  const PredictionCheck check(disc(), 0.1);
  EXPECT_FALSE(check.first_conflict(away, 0.0, {behind, 0.0}));
  EXPECT_TRUE(check.first_conflict(away, 0.0, {ahead, 0.0}));
}

TEST(RetimeAmong, WaitsAsLongAsACrossingTakesAndNoLonger) {
  // Somebody crosses the way at x = 4 and is on it from 2 s to 8 s: 1 m wide, walking at 1/3 m/s
  // along y, within 0.65 m of the x axis for 3.9 s around t = 5 s.
  const auto limits = limits_of(1.0, 1.0);
  const Trajectory way = along_x(8.0, limits);
  const double v = 1.0 / 3.0;
  const auto walker =
      predicted({person(1, {{0.0, {4.0, -5.0 * v}, 0.3}, {12.0, {4.0, 7.0 * v}, 0.3}})});
  const PredictionCheck check(disc(), 0.05);
  ASSERT_TRUE(check.first_conflict(way, 0.0, {walker, 0.0}));
  const auto slower = retime_among(way, 0.0, limits, {walker, 0.0}, check);
  ASSERT_TRUE(slower);
  EXPECT_GE(least_clearance_m(*slower, *walker, 0.0), 0.05 - 1e-6);
  EXPECT_NEAR(slower->q(slower->size() - 1)[0], 8.0, 1e-6);
  // In the s-t plane the walker is an ellipse about (4 m, 5 s) with half axes 0.65 m and 0.65 / v;
  // the line of full speed that touches it from behind reaches x = 4 at the root below. 4 m and
  // half the time of a stop are left.
  const double pass_s = 5.0 + std::hypot(0.65 / v, 0.65);
  EXPECT_GT(slower->duration_s(), pass_s + 4.0 + 0.5 - 0.01);
  EXPECT_LT(slower->duration_s(), pass_s + 4.0 + 0.5 + 0.4);
}

TEST(RetimeAmong, KeepsPathLimitsAndTheStartsVelocity) {
  const auto limits = limits_of(0.6, 0.4);
  const Trajectory way = along_x(6.0, limits);
  const auto walker = predicted({person(1, {{0.0, {3.0, -2.0}, 0.3}, {10.0, {3.0, 2.0}, 0.3}})});
  const PredictionCheck check(disc(), 0.05);
  const double from_s = 2.0;  // at speed
  const auto slower = retime_among(way, from_s, limits, {walker, 0.0}, check);
  ASSERT_TRUE(slower);
  std::vector<double> q(3), v(3), q_way(3), v_way(3), v_before(3);
  slower->sample(from_s, q, v);
  way.sample(from_s, q_way, v_way);
  EXPECT_NEAR(v[0], v_way[0], 1e-9);
  EXPECT_NEAR(q[0], q_way[0], 1e-9);
  slower->sample(0.0, q, v_before);
  constexpr double kStep_s = 0.01;
  for (double t = kStep_s; t < slower->duration_s(); t += kStep_s) {
    slower->sample(t, q, v);
    EXPECT_NEAR(q[1], 0.0, 1e-9);
    EXPECT_GE(v[0], -5e-4) << t;  // cubics overshoot where the path ends
    EXPECT_LE(v[0], 0.6 + 1e-3) << t;
    EXPECT_LE(std::abs(v[0] - v_before[0]) / kStep_s, 0.4 * 1.12) << t;
    v_before = v;
  }
}

TEST(RetimeAmong, FindsNothingWhereSomebodyStaysInTheWay) {
  const auto limits = limits_of(1.0, 1.0);
  const Trajectory way = along_x(8.0, limits);
  // It walks along the way towards the robot: no speed on the path avoids it.
  const auto walker = predicted({person(1, {{0.0, {4.0, 0.0}, 0.3}, {9.0, {-5.0, 0.0}, 0.3}})});
  const PredictionCheck check(disc(), 0.05);
  EXPECT_FALSE(retime_among(way, 0.0, limits, {walker, 0.0}, check));
  // Whoever stands on it for good is waited for, as long as is predicted.
  const auto standing = predicted({person(1, {{0.0, {4.0, 0.0}, 0.3}, {6.0, {4.0, 0.0}, 0.3}})});
  const auto slower = retime_among(way, 0.0, limits, {standing, 0.0}, check);
  ASSERT_TRUE(slower);
  EXPECT_GE(least_clearance_m(cut(*slower, 0.0, 6.0), *standing, 0.0), 0.05 - 1e-6);
}

TEST(RetimeAmong, LeavesWhatIsClearAsItIs) {
  const auto limits = limits_of(1.0, 1.0);
  const Trajectory way = along_x(8.0, limits);
  const auto beside = predicted({person(1, {{0.0, {4.0, 2.0}, 0.3}, {9.0, {4.0, 2.0}, 0.3}})});
  const auto same = retime_among(way, 0.0, limits, {beside, 0.0}, PredictionCheck(disc(), 0.05));
  ASSERT_TRUE(same);
  EXPECT_EQ(same->times_s, way.times_s);
  EXPECT_EQ(same->positions, way.positions);
}

}  // namespace
}  // namespace sidestep
