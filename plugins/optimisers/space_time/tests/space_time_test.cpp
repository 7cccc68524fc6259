#include <cmath>
#include <memory>
#include <random>

#include <gtest/gtest.h>

#include <sidestep/field/scene_field.hpp>
#include <sidestep/planning/prediction_check.hpp>
#include <sidestep/trajectory/trajectory.hpp>

#include "space_time.hpp"
#include "support/ball_robot.hpp"

namespace sidestep {
namespace {

constexpr double kRadius_m = 0.3;
constexpr double kMargin_m = 0.1;

Eigen::Vector3d at(double x, double y) { return {x, y, 0.9}; }

/// A ball that moves at 1 m/s and 1 m/s^2 in a plane in which nothing stands.
Problem problem_of(const Eigen::Vector3d& from, const Eigen::Vector3d& to) {
  Problem problem;
  problem.robot = std::make_shared<testing_support::BallRobot>(kRadius_m);
  problem.space = {Space::kFree, Space::kFree};
  problem.start = {from, Eigen::Vector3d::Zero()};
  problem.goal = {to, Eigen::Vector3d::Zero()};
  problem.support_states = 11;
  problem.dt_s = 1.0;
  problem.qc = Eigen::Vector3d::Ones();
  problem.prediction_margin_m = kMargin_m;
  return problem;
}

Solution solve(const Problem& problem) {
  const auto planner = make_space_time({});
  const auto solution = planner->solve(
      problem, straight_line(problem.start, problem.goal, problem.support_states, problem.dt_s),
      Deadline());
  EXPECT_TRUE(solution.has_value());
  return *solution;
}

std::shared_ptr<const Prediction> walkers(std::vector<PredictedSet> sets) {
  return std::make_shared<const Prediction>(*Prediction::create(Stamp{}, std::move(sets)));
}

PredictedSet walker(std::int64_t track, const Eigen::Vector2d& from_m,
                    const Eigen::Vector2d& velocity_mps, double until_s) {
  return {
      track, 1.0, 0.0, 1.8, {{0.0, from_m, 0.3}, {until_s, from_m + until_s * velocity_mps, 0.3}}};
}

/// From the sets' own definition, sampled densely.
double least_clearance_m(const Trajectory& motion, const Prediction& prediction) {
  double least_m = std::numeric_limits<double>::infinity();
  std::vector<double> q(3);
  for (double t = 0.0; t <= motion.duration_s(); t += 1e-3) {
    motion.sample(t, q, {});
    for (const PredictedSet& set : prediction.sets()) {
      const auto &a = set.knots.front(), &b = set.knots.back();
      if (t > b.time_s) continue;
      const Eigen::Vector2d centre_m = a.centre_m + t / b.time_s * (b.centre_m - a.centre_m);
      least_m = std::min(least_m, (Eigen::Vector2d(q[0], q[1]) - centre_m).norm() - 0.3);
    }
  }
  return least_m - kRadius_m;
}

const MotionLimits kLimits{{1.0, 1.0, 1.0}, {1.0, 1.0, 1.0}, {}};

TEST(SpaceTime, GoesStraightAndAsFastAsTheLimitsLetWhereNothingIsInTheWay) {
  const Solution solution = solve(problem_of(at(0, 0), at(6, 0)));
  ASSERT_EQ(solution.status, SolveStatus::kConverged);
  EXPECT_NEAR(solution.trajectory.duration_s(), 6.0 / 1.0 + 1.0, 1e-6);
  EXPECT_TRUE(keeps_limits(solution.trajectory, kLimits));
  // Too short a way for full speed.
  EXPECT_NEAR(solve(problem_of(at(0, 0), at(0, 0.36))).trajectory.duration_s(),
              2.0 * std::sqrt(0.36), 0.002);
  // It is there already, or has to come back.
  EXPECT_EQ(solve(problem_of(at(1, 1), at(1, 1))).status, SolveStatus::kConverged);
  Problem past = problem_of(at(0, 0), at(0.1, 0));
  past.start.qdot.x() = 1.0;
  const Solution back = solve(past);
  EXPECT_TRUE(keeps_limits(back.trajectory, kLimits));
  EXPECT_NEAR(back.trajectory.duration_s(), 1.0 + 2.0 * std::sqrt(0.4), 0.01);
}

TEST(SpaceTime, TakesOverAtTheStartsVelocity) {
  Problem problem = problem_of(at(0, 0), at(5, 0));
  problem.start.qdot = Eigen::Vector3d(0.2, 0.7, 0.0);
  const Solution solution = solve(problem);
  ASSERT_EQ(solution.status, SolveStatus::kConverged);
  EXPECT_NEAR(solution.trajectory.qdot(0)[1], 0.7, 1e-12);
  const int last = solution.trajectory.size() - 1;
  EXPECT_NEAR(solution.trajectory.q(last)[0], 5.0, 1e-12);
  EXPECT_NEAR(solution.trajectory.q(last)[1], 0.0, 1e-12);
  EXPECT_EQ(solution.trajectory.qdot(last)[0], 0.0);
  EXPECT_TRUE(keeps_limits(solution.trajectory, kLimits));
}

TEST(SpaceTime, KeepsClearOfWhoeverWalksThere) {
  std::mt19937 random(3);
  std::uniform_real_distribution<double> angle(-M_PI, M_PI), speed(0.3, 1.4);
  int blocked = 0;
  for (int scene = 0; scene < 40; ++scene) {
    // Five people cross a circle of 4 m, as the robot does.
    std::vector<PredictedSet> sets;
    for (int person = 0; person < 5; ++person) {
      const double a = angle(random);
      const Eigen::Vector2d from = 4.0 * Eigen::Vector2d(std::cos(a), std::sin(a));
      if ((from - Eigen::Vector2d(0, -4)).norm() < 1.5) continue;
      sets.push_back(walker(person, from, -speed(random) / 4.0 * from, 8.0));
    }
    Problem problem = problem_of(at(0, -4), at(0, 4));
    problem.prediction = walkers(std::move(sets));
    const PredictionCheck check(problem.robot, kMargin_m);
    const Solution straight = solve(problem_of(at(0, -4), at(0, 4)));
    const bool is_blocked =
        check.first_conflict(straight.trajectory, 0.0, {problem.prediction, 0.0}).has_value();
    blocked += is_blocked ? 1 : 0;
    const Solution solution = solve(problem);
    ASSERT_EQ(solution.status, SolveStatus::kConverged) << scene << " " << solution.reason;
    EXPECT_GE(least_clearance_m(solution.trajectory, *problem.prediction), kMargin_m) << scene;
    EXPECT_TRUE(keeps_limits(solution.trajectory, kLimits)) << scene;
    if (!is_blocked) {
      EXPECT_NEAR(solution.trajectory.duration_s(), 9.0, 0.5) << scene;
    }
    EXPECT_LT(solution.trajectory.duration_s(), 15.0) << scene;
  }
  EXPECT_GT(blocked, 20) << "the scenes are no test of anything";
}

/// Two boxes along x, 1.8 m high and 0.4 m thick, with a gap between them.
std::shared_ptr<const DistanceField> wall_with_gap(double from_m, double to_m) {
  std::vector<SceneObject> walls;
  for (const double end_m : {from_m, to_m}) {
    const double side = end_m == from_m ? -1.0 : 1.0;
    SceneObject wall;
    wall.shape = Box{{8.0, 0.4, 1.8}};
    Transform pose = Transform::Identity();
    pose.translation() << end_m + side * 4.0, 0.0, 0.9;
    wall.waypoints = {{0.0, pose}};
    walls.push_back(wall);
  }
  return std::make_shared<SceneField>(
      Scene(walls), Stamp{},
      Eigen::AlignedBox3d(Eigen::Vector3d::Constant(-20.0), Eigen::Vector3d::Constant(20.0)));
}

TEST(SpaceTime, KeepsAllSpheresClear) {
  // One sphere is hidden above the base, one reaches out of it.
  class Reaching final : public testing_support::BallRobot {
   public:
    Reaching() : BallRobot(kRadius_m) {
      description_.spheres[0].centre_link_m = {0.0, 0.0, -0.6};
      description_.spheres.push_back({0, {0.1, 0.0, 0.0}, 0.1});
      description_.spheres.push_back({0, {0.45, 0.1, 0.3}, 0.1});
    }
    void sphere_centres(std::span<const double> q, std::span<Eigen::Vector3d> centres_m,
                        Scratch&) const override {
      for (std::size_t i = 0; i < centres_m.size(); ++i) {
        centres_m[i] = Eigen::Map<const Eigen::Vector3d>(q.data() + 3 * (i / 3)) +
                       description_.spheres[i % 3].centre_link_m;
      }
    }
  };
  std::mt19937 random(8);
  std::uniform_real_distribution<double> angle(-M_PI, M_PI), height(0.2, 1.8);
  for (int scene = 0; scene < 20; ++scene) {
    std::vector<PredictedSet> sets;
    for (int person = 0; person < 4; ++person) {
      const double a = angle(random);
      const Eigen::Vector2d from = 4.0 * Eigen::Vector2d(std::cos(a), std::sin(a));
      if ((from - Eigen::Vector2d(0, -4)).norm() < 1.5) continue;
      sets.push_back(walker(person, from, -0.2 * from, 8.0));
      sets.back().top_m = height(random);
    }
    Problem problem = problem_of(at(0, -4), at(0, 4));
    problem.robot = std::make_shared<Reaching>();
    problem.prediction = walkers(std::move(sets));
    const Solution solution = solve(problem);
    ASSERT_EQ(solution.status, SolveStatus::kConverged) << scene << " " << solution.reason;
    std::vector<double> q(3), distances_m(3);
    std::vector<Eigen::Vector3d> centres_m(3);
    Scratch scratch;
    for (double t = 0.0; t <= solution.trajectory.duration_s(); t += 1e-3) {
      solution.trajectory.sample(t, q, {});
      problem.robot->sphere_centres(q, centres_m, scratch);
      problem.prediction->query(t, centres_m, distances_m, {});
      for (std::size_t i = 0; i < 3; ++i) {
        ASSERT_GE(distances_m[i] - problem.robot->description().spheres[i].radius_m, kMargin_m)
            << scene << " at " << t << " of sphere " << i;
      }
    }
  }
}

TEST(SpaceTime, WaitsForAGoalOnWhichSomebodyStands) {
  Problem problem = problem_of(at(0, -2), at(0, 2));
  PredictedSet standing = walker(1, {0.0, 2.1}, {0.0, 0.0}, 9.0);
  problem.prediction = walkers({standing});
  const Solution solution = solve(problem);
  ASSERT_EQ(solution.status, SolveStatus::kConverged) << solution.reason;
  EXPECT_GE(least_clearance_m(solution.trajectory, *problem.prediction), kMargin_m);
  EXPECT_GE(solution.trajectory.duration_s(), 9.0);
  EXPECT_LT(solution.trajectory.duration_s(), 11.0);
  EXPECT_LT(solution.iterations, 300);
}

TEST(SpaceTime, GoesThroughAGapBesideTheStraightWay) {
  for (const double middle_m : {0.0, 0.8, -1.7, 3.0}) {
    const double half_m = 0.5;
    Problem problem = problem_of(at(0, -3), at(0, 3));
    problem.field = wall_with_gap(middle_m - half_m, middle_m + half_m);
    problem.collision_margin_m = 0.05;
    const Solution solution = solve(problem);
    ASSERT_EQ(solution.status, SolveStatus::kConverged) << middle_m << " " << solution.reason;
    EXPECT_TRUE(keeps_limits(solution.trajectory, kLimits)) << middle_m;
    std::vector<double> q(3);
    for (double t = 0.0; t <= solution.trajectory.duration_s(); t += 1e-3) {
      solution.trajectory.sample(t, q, {});
      // Of the disc from the corners of the gap and the sides of the wall.
      const double beside_m = std::abs(q[0] - middle_m) - half_m, across_m = std::abs(q[1]) - 0.2;
      const double clear_m =
          beside_m > 0.0 ? across_m : std::hypot(std::min(0.0, beside_m), std::max(0.0, across_m));
      EXPECT_GE(clear_m - kRadius_m, problem.collision_margin_m) << middle_m << " at " << t;
    }
    // By the middle of the gap, from rest to rest, and what a lattice loses.
    const double least_s = 2.0 * std::hypot(3.0, std::max(0.0, std::abs(middle_m) - 0.15)) + 1.0;
    EXPECT_LT(solution.trajectory.duration_s(), 1.25 * least_s) << middle_m;
    EXPECT_LT(solution.iterations, 3000) << middle_m;
  }
}

TEST(SpaceTime, MovesOtherJointsWhileTheBaseGoes) {
  Problem problem = problem_of(at(0, 0), {6, 0, 1.5});
  const Solution solution = solve(problem);
  ASSERT_EQ(solution.status, SolveStatus::kConverged);
  EXPECT_TRUE(keeps_limits(solution.trajectory, kLimits));
  std::vector<double> q(3);
  double last_m = 0.9;
  for (double t = 0.0; t <= solution.trajectory.duration_s(); t += 0.01) {
    solution.trajectory.sample(t, q, {});
    EXPECT_GE(q[2], last_m - 1e-9) << t;  // at once, and never back
    last_m = q[2];
  }
  EXPECT_NEAR(last_m, 1.5, 1e-9);
}

TEST(SpaceTime, PlansSlowRobotsAmongWalkers) {
  class SlowBall final : public testing_support::BallRobot {
   public:
    SlowBall() : BallRobot(kRadius_m) {
      for (Joint& joint : description_.joints) {
        joint.max_velocity = 0.2;
        joint.max_acceleration = 0.05;
      }
    }
  };
  Problem problem = problem_of(at(0, -1), at(0, 1));
  problem.robot = std::make_shared<SlowBall>();
  // Whoever comes along the way meets it unless it waits or goes aside.
  problem.prediction = walkers({walker(1, {-3.2, 0.0}, {0.5, 0.0}, 12.0)});
  const Solution solution = solve(problem);
  ASSERT_EQ(solution.status, SolveStatus::kConverged) << solution.reason;
  EXPECT_GE(least_clearance_m(solution.trajectory, *problem.prediction), kMargin_m);
  EXPECT_LT(solution.trajectory.duration_s(), 2.0 * (2.0 / 0.2 + 4.0));
}

TEST(SpaceTime, IsTheSameEveryTime) {
  Problem problem = problem_of(at(0, -4), at(0, 4));
  problem.prediction = walkers({walker(1, {0.5, 4.0}, {-0.1, -1.0}, 8.0)});
  const Solution first = solve(problem), second = solve(problem);
  EXPECT_EQ(first.trajectory.positions, second.trajectory.positions);
  EXPECT_EQ(first.iterations, second.iterations);
}

TEST(SpaceTime, RefusesABaseThatDoesNotCarryTheWholeRobot) {
  class Tethered final : public testing_support::BallRobot {
   public:
    Tethered() : BallRobot(kRadius_m) {
      description_.spheres.push_back({0, Eigen::Vector3d::Zero(), 0.1});
    }
    void sphere_centres(std::span<const double> q, std::span<Eigen::Vector3d> centres_m,
                        Scratch&) const override {
      for (std::size_t k = 0; 2 * k < centres_m.size(); ++k) {
        centres_m[2 * k] = Eigen::Map<const Eigen::Vector3d>(q.data() + 3 * k);
        centres_m[2 * k + 1] = Eigen::Vector3d::Zero();
      }
    }
  };
  Problem problem = problem_of(at(0, 0), at(1, 0));
  problem.robot = std::make_shared<Tethered>();
  const auto refused = make_space_time({})->solve(
      problem, straight_line(problem.start, problem.goal, problem.support_states, problem.dt_s),
      Deadline());
  ASSERT_FALSE(refused.has_value());
  EXPECT_EQ(refused.error().code, ErrorCode::kInvalidArgument);
}

TEST(SpaceTime, SaysWhenItHasNoBaseToMoveOrNoTime) {
  Problem problem = problem_of(at(0, 0), at(1, 0));
  const auto planner = make_space_time({});
  const Trajectory guess =
      straight_line(problem.start, problem.goal, problem.support_states, problem.dt_s);
  const auto late = planner->solve(problem, guess, Deadline::after_s(0.0));
  ASSERT_TRUE(late.has_value());
  EXPECT_EQ(late->status, SolveStatus::kDeadline);
  EXPECT_EQ(late->trajectory.size(), 0);
}

}  // namespace
}  // namespace sidestep
