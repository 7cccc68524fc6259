#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <numbers>

#include <sidestep/field/scene_field.hpp>
#include <sidestep/planning/validity_check.hpp>

#include "steering.hpp"
#include "support.hpp"
#include "support/chain_robot.hpp"

namespace sidestep::joint_paths {
namespace {

constexpr double kPi = std::numbers::pi;

std::shared_ptr<const RobotModel> rolling_arm() {
  auto robot = testing_support::mobile_arm();
  robot->description().rolling = RollingBase{0, 1, 2};
  for (Joint& joint : robot->description().joints) joint.max_acceleration = 1.0;
  return robot;
}

SceneObject box(const Eigen::Vector3d& size_m, const Eigen::Vector3d& centre_m) {
  SceneObject object;
  object.name = "box";
  object.shape = Box{size_m};
  object.waypoints.resize(1);
  object.waypoints[0].T_world_object.translation() = centre_m;
  return object;
}

class RollingArm : public testing::Test {
 protected:
  [[nodiscard]] Problem problem(std::vector<SceneObject> objects) const {
    Problem problem;
    problem.robot = robot_;
    problem.field = std::make_shared<const SceneField>(
        Scene(std::move(objects)), Stamp(),
        Eigen::AlignedBox3d(Eigen::Vector3d(-6, -6, -6), Eigen::Vector3d(6, 6, 6)));
    problem.space = {Space::kFree, Space::kFree};
    problem.start = problem.goal = {Eigen::VectorXd::Zero(7), Eigen::VectorXd::Zero(7)};
    problem.support_states = 3;
    problem.dt_s = 1.0;
    problem.qc = Eigen::VectorXd::Ones(7);
    return problem;
  }

  /// By the definition, every millisecond: the velocity is along the heading, no faster than the
  /// limit, and is that of the positions.
  void expect_rolls(const Trajectory& trajectory) const {
    std::vector<double> q(7), qdot(7), q_before(7), unused(7);
    double across = 0.0, along = 0.0, off = 0.0;
    for (double t = 0.0; t < trajectory.duration_s(); t += 1e-3) {
      trajectory.sample(t, q, qdot);
      const Eigen::Vector2d heading(std::cos(q[2]), std::sin(q[2]));
      const Eigen::Vector2d velocity(qdot[0], qdot[1]);
      across = std::max(across, (velocity - heading * heading.dot(velocity)).norm());
      along = std::max(along, std::abs(heading.dot(velocity)));
      if (t > 0.0) {
        trajectory.sample(t - 5e-4, unused, qdot);
        off = std::max(off, std::abs((q[0] - q_before[0]) / 1e-3 - qdot[0]));
      }
      q_before = q;
    }
    EXPECT_LT(across, 1e-6);
    EXPECT_LE(along, 0.8 + 1e-6);
    EXPECT_LT(off, 1e-3);
  }

  std::shared_ptr<const RobotModel> robot_ = rolling_arm();
  conformance::RecordingLog log_;
};

TEST(Steering, TurnsDrivesAndTurns) {
  const auto robot = rolling_arm();
  const Steering steering(robot->description(), std::vector<double>(7, 1.0));
  const std::vector<double> from = {0, 0, 0, 0, 0, 0, 0};
  const auto way = [&](std::vector<double> to) {
    std::vector<double> vertices;
    steering.append(from, to, vertices);
    return vertices;
  };
  // To the left: a quarter turn, 2 m, a quarter turn back; the lift goes evenly with m and rad.
  const auto left = way({0.0, 2.0, 0.0, 0.4, 0, 0, 0});
  ASSERT_EQ(left.size(), 3 * 7u);
  EXPECT_NEAR(std::abs(left[2]), 0.5 * kPi, 1e-12);
  EXPECT_EQ(left[9], left[2]);
  EXPECT_EQ(left[8], 2.0);
  EXPECT_NEAR(left[3], 0.4 * 0.5 * kPi / (kPi + 2.0), 1e-12);
  EXPECT_EQ(left[16], 0.0);
  // Behind it: straight back.
  EXPECT_EQ(way({-1.0, 0.0, 0.0, 0, 0, 0, 0}).size(), 7u);
  // Turned about: no drive.
  EXPECT_EQ(way({0.0, 0.0, 3.0, 0, 0, 0, 0}).size(), 7u);
}

TEST(Steering, IsTheSameWayBack) {
  const auto robot = rolling_arm();
  const Steering steering(robot->description(), std::vector<double>(7, 1.0));
  std::srand(3);
  for (int i = 0; i < 200; ++i) {
    Eigen::Matrix<double, 7, 1> a, b;
    a.setRandom();
    b.setRandom();
    a[2] *= 3.0;
    b[2] *= 3.0;
    if (i % 4 == 0) {  // beside each other: either way turns as far
      b[2] = a[2];
      b[0] = a[0] - std::sin(a[2]);
      b[1] = a[1] + std::cos(a[2]);
    }
    Way there, back;
    there.look(steering, {a.data(), 7}, {b.data(), 7});
    back.look(steering, {b.data(), 7}, {a.data(), 7});
    ASSERT_EQ(there.vertices().size(), back.vertices().size());
    const std::size_t count = there.vertices().size() / 7;
    for (std::size_t v = 0; v < count; ++v) {
      for (std::size_t j = 0; j < 7; ++j) {
        EXPECT_NEAR(there.vertices()[v * 7 + j], back.vertices()[(count - 1 - v) * 7 + j], 1e-9);
      }
    }
  }
}

TEST_F(RollingArm, DrivesThroughCornersWithoutStopping) {
  const Problem task = problem({});
  const auto checker = make_checker("field");
  ASSERT_TRUE(checker->look_at(task));
  const std::vector<double> path = {0, 0,   0,       0,   0,    0,   0,  //
                                    2, 0,   0,       0.2, -0.5, 0,   0,  //
                                    2, 1.5, kPi / 2, 0.2, -1.0, 0.5, 0,  //
                                    3, 1.0, 0.0,     0.0, 0.0,  0.5, 0};
  const auto driven = drive(task, path, *checker, 0.01, Deadline());
  ASSERT_TRUE(driven) << driven.error().describe();
  expect_rolls(*driven);
  for (std::size_t j = 0; j < 7; ++j) {
    EXPECT_EQ(driven->q(0)[j], path[j]);
    EXPECT_NEAR(driven->q(driven->size() - 1)[j], path[21 + j], 1e-9);
  }
  // It keeps moving at the first corner, where it only has to turn.
  std::vector<double> q(7), qdot(7);
  double least = 1.0;
  int looks = 0;
  for (double t = 1.0; t < driven->duration_s(); t += 0.01) {
    driven->sample(t, q, qdot);
    if (std::hypot(q[0] - 2.0, q[1]) > 0.7) continue;
    least = std::min(least, std::hypot(qdot[0], qdot[1]));
    ++looks;
  }
  EXPECT_GT(looks, 10);
  EXPECT_GT(least, 0.1);
}

TEST_F(RollingArm, KeepsToATightBend) {
  // A bend of a corridor that leaves the base 2 mm on either side as it turns on the spot.
  const Problem task = problem(
      {box({4.0, 0.1, 0.5}, {-2.332, 0.332, 0.25}), box({5.0, 0.1, 0.5}, {-2.0, -0.332, 0.25}),
       box({0.1, 4.0, 0.5}, {0.332, 1.7, 0.25}), box({0.1, 4.0, 0.5}, {-0.332, 2.282, 0.25})});
  const auto checker = make_checker("field");
  ASSERT_TRUE(checker->look_at(task));
  const std::vector<double> path = {-2, 0, 0,       0, 0, 0, 0,  //
                                    0,  0, 0,       0, 0, 0, 0,  //
                                    0,  2, kPi / 2, 0, 0, 0, 0};
  const auto driven = drive(task, path, *checker, 0.01, Deadline());
  ASSERT_TRUE(driven) << driven.error().describe();
  expect_rolls(*driven);
  const auto verdict =
      make_field_check(task.robot, task.field, task.space, {})->check(*driven, 0.0, Deadline());
  ASSERT_TRUE(verdict) << verdict.error().describe();
  EXPECT_TRUE(verdict->valid()) << verdict->describe();
}

/// Calls everything clear but what drives and turns at once.
class NoCurves final : public Checker {
 public:
  Result<void> look_at(const Problem&) override { return {}; }
  bool is_clear(std::span<const double>) override { return true; }
  unsigned find_blocked(std::span<const double>) override { return 0; }
  bool is_clear(std::span<const double> from, std::span<const double> to, double) override {
    return from[2] == to[2] || (from[0] == to[0] && from[1] == to[1]);
  }
  std::optional<Violation> violation(std::span<const double>) override { return std::nullopt; }
};

TEST_F(RollingArm, StopsToTurnWhereNoCurveIsClear) {
  NoCurves checker;
  const std::vector<double> path = {-2, 0, 0,       0, 0, 0, 0,  //
                                    0,  0, 0,       0, 0, 0, 0,  //
                                    0,  2, kPi / 2, 0, 0, 0, 0};
  const auto driven = drive(problem({}), path, checker, 0.01, Deadline());
  ASSERT_TRUE(driven) << driven.error().describe();
  expect_rolls(*driven);
  // It is in the corner with one heading and with the other, and at rest with both.
  int rests = 0;
  for (int i = 1; i + 1 < driven->size(); ++i) {
    if (std::hypot(driven->q(i)[0], driven->q(i)[1]) > 1e-9) continue;
    const double turned = driven->q(i)[2];
    if (turned > 1e-9 && turned < 0.5 * kPi - 1e-9) continue;
    ++rests;
    for (const double rate : driven->qdot(i)) EXPECT_NEAR(rate, 0.0, 1e-9);
  }
  EXPECT_EQ(rests, 2);
}

class RollingPlanner : public RollingArm, public testing::WithParamInterface<const char*> {};

/// Sideways past a wall: what comes out rolls, and both its ends are those asked for.
TEST_P(RollingPlanner, GetsSidewaysBehindAWall) {
  Problem task = problem({box({0.1, 3.0, 1.0}, {0.0, 0.0, 0.5})});
  task.start.q << -1.0, 0.3, 0.4, 0, 0, 0, 0;
  task.goal.q << 1.0, 0.0, 0.0, 0.3, -1.0, 0.5, 0;
  const auto solution =
      make_planner(GetParam(), "field", 3, log_)->solve(task, Trajectory{}, Deadline());
  ASSERT_TRUE(solution) << solution.error().describe();
  ASSERT_EQ(solution->status, SolveStatus::kConverged) << solution->reason;
  expect_rolls(solution->trajectory);
  const auto check = make_field_check(task.robot, task.field, task.space, {});
  const auto verdict = check->check(solution->trajectory, 0.0, Deadline());
  ASSERT_TRUE(verdict) << verdict.error().describe();
  EXPECT_TRUE(verdict->valid()) << verdict->describe();
}

INSTANTIATE_TEST_SUITE_P(Planners, RollingPlanner,
                         testing::Values("rrt_connect", "RRTConnect", "RRTstar", "PRM"));

TEST_F(RollingArm, CheckFindsWhatMovesSideways) {
  Problem task = problem({});
  task.goal.q[1] = 1.0;
  const Trajectory line = straight_line(task.start, task.goal, 3, 1.0);
  const auto check = make_field_check(task.robot, task.field, task.space, {});
  const auto verdict = check->check(line, 0.0, Deadline());
  ASSERT_TRUE(verdict) << verdict.error().describe();
  ASSERT_FALSE(verdict->violations.empty());
  EXPECT_EQ(verdict->violations.front().kind, Violation::Kind::kSideways);
  // Peaks of the two cubics: 0.5 m in 1 s, at rest at one end and at 0.5 m/s at the other.
  EXPECT_NEAR(verdict->violations.front().amount, 2.0 / 3.0, 0.01);
}

}  // namespace
}  // namespace sidestep::joint_paths
