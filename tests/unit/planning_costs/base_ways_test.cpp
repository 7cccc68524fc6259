#include <sidestep/planning/base_ways.hpp>

#include <cmath>
#include <limits>
#include <numbers>

#include <gtest/gtest.h>

#include <sidestep/core/index.hpp>
#include <sidestep/field/scene_field.hpp>

#include "support/ball_robot.hpp"

namespace sidestep {
namespace {

constexpr double kBall_m = 0.2;
constexpr double kApart_m = 0.05;

/// Walls of a plan: from corner to corner, as high as the robot.
struct Wall {
  Eigen::Vector2d low_m, high_m;

  [[nodiscard]] double distance_m(const Eigen::Vector2d& p_m) const {
    return (p_m - p_m.cwiseMax(low_m).cwiseMin(high_m)).norm();
  }
};

/// A ball that goes from the origin to (4, 0, 0).
class BaseWaysTest : public ::testing::Test {
 protected:
  [[nodiscard]] static Problem among(const std::vector<Wall>& walls) {
    std::vector<SceneObject> objects;
    for (const Wall& wall : walls) {
      const Eigen::Vector2d middle_m = 0.5 * (wall.low_m + wall.high_m);
      const Eigen::Vector2d size_m = wall.high_m - wall.low_m;
      objects.push_back({.name = "wall",
                         .shape = Box{{size_m.x(), size_m.y(), 2.0}},
                         .waypoints = {{0.0, transform_from_xyz_rpy(
                                                 {middle_m.x(), middle_m.y(), 0.0}, {0, 0, 0})}}});
    }
    Problem problem;
    problem.robot = std::make_shared<testing_support::BallRobot>(kBall_m);
    problem.field = std::make_shared<const SceneField>(
        Scene(objects), Stamp{},
        Eigen::AlignedBox3d(Eigen::Vector3d(-2, -4, -1), Eigen::Vector3d(6, 4, 1)));
    problem.space = {Space::kFree, Space::kOccupied};
    problem.collision_margin_m = kApart_m;
    problem.start = {Eigen::Vector3d::Zero(), Eigen::Vector3d::Zero()};
    problem.goal = {Eigen::Vector3d(4, 0, 0), Eigen::Vector3d::Zero()};
    problem.support_states = 21;
    problem.dt_s = 0.4;
    problem.qc = Eigen::Vector3d::Ones();
    return problem;
  }

  /// Of all that lies between the states of a guess, by a look every centimetre.
  [[nodiscard]] static double clearance_m(const Trajectory& guess, const std::vector<Wall>& walls) {
    double least_m = std::numeric_limits<double>::infinity();
    for (int i = 0; i + 1 < guess.size(); ++i) {
      const Eigen::Vector2d from_m(guess.q(i)[0], guess.q(i)[1]);
      const Eigen::Vector2d to_m(guess.q(i + 1)[0], guess.q(i + 1)[1]);
      const int steps = 1 + static_cast<int>((to_m - from_m).norm() / 0.01);
      for (int k = 0; k <= steps; ++k) {
        const Eigen::Vector2d p_m = from_m + (to_m - from_m) * k / steps;
        for (const Wall& wall : walls) {
          least_m = std::min(least_m, wall.distance_m(p_m) - kBall_m);
        }
      }
    }
    return least_m;
  }
  [[nodiscard]] static double length_of(const Trajectory& guess) {
    double length_m = 0.0;
    for (int i = 0; i + 1 < guess.size(); ++i) {
      length_m += std::hypot(guess.q(i + 1)[0] - guess.q(i)[0], guess.q(i + 1)[1] - guess.q(i)[1]);
    }
    return length_m;
  }
};

/// A wall that is bent around the start; below it the shorter way.
const std::vector<Wall> kDeadEnd{
    {{1.5, -1.2}, {1.7, 1.8}}, {{0.0, -1.2}, {1.7, -1.0}}, {{-1.0, 1.6}, {1.7, 1.8}}};

TEST_F(BaseWaysTest, LeadOutOfADeadEnd) {
  const Problem problem = among(kDeadEnd);
  const BaseWays ways(problem, {});
  ASSERT_FALSE(ways.empty());
  const Trajectory guess = ways.first_guess(problem);
  EXPECT_EQ(guess.q(0)[0], 0.0);
  EXPECT_EQ(guess.q(guess.size() - 1)[0], 4.0);
  // Between two states it is cut short.
  EXPECT_GT(clearance_m(guess, kDeadEnd), kApart_m - 0.05);
  // The taut string around the two lower corners, the robot touching them.
  const double apart_m = kBall_m + kApart_m;
  const Eigen::Vector2d first(-apart_m, -1.2), second(1.7, -1.2 - apart_m), goal(4.0, 0.0);
  const double taut_m = first.norm() + (second - first).norm() + (goal - second).norm();
  EXPECT_GT(length_of(guess), 0.95 * taut_m);
  EXPECT_LT(length_of(guess), 1.25 * taut_m);
  EXPECT_NEAR(guess.size() - 1, 20 * length_of(guess) / 4.0, 1.5);
  for (int i = 1; i + 1 < guess.size(); ++i) {
    const double speed_mps = std::hypot(guess.qdot(i)[0], guess.qdot(i)[1]);
    EXPECT_LE(speed_mps, 1.02 * length_of(guess) / guess.duration_s()) << i;
  }
}

TEST_F(BaseWaysTest, TellHowFarItIsFromADeadEnd) {
  const BaseWays ways(among(kDeadEnd), {});
  const Eigen::Vector3d end(1.2, 0.3, 0.0), outside(2.2, 0.3, 0.0);
  const auto inside_m = ways.length_m(as_span(Eigen::VectorXd(end)));
  const auto outside_m = ways.length_m(as_span(Eigen::VectorXd(outside)));
  ASSERT_TRUE(inside_m && outside_m);
  EXPECT_GT(*inside_m, 5.0);
  EXPECT_GE(*outside_m, 1.8);
  EXPECT_LT(*outside_m, 2.5);
}

TEST_F(BaseWaysTest, PreferTheOpen) {
  // Straight on through a gap that is just wide enough, or around: 0.2 m longer.
  const std::vector<Wall> gap{{{1.8, 0.27}, {2.2, 0.5}}, {{1.8, -0.5}, {2.2, -0.27}}};
  const Problem problem = among(gap);
  EXPECT_GT(clearance_m(BaseWays(problem, {}).first_guess(problem), gap), 0.1);
}

TEST_F(BaseWaysTest, GoThroughWhatIsWideEnoughBetweenThePositions) {
  const std::vector<Wall> gap{{{1.8, 0.287}, {2.2, 5.0}}, {{1.8, -5.0}, {2.2, -0.235}}};
  EXPECT_FALSE(BaseWays(among(gap), {}).empty());
  const std::vector<Wall> less{{{1.8, 0.207}, {2.2, 5.0}}, {{1.8, -5.0}, {2.2, -0.207}}};
  EXPECT_TRUE(BaseWays(among(less), {}).empty());
}

TEST_F(BaseWaysTest, SetOutFromWhereTheRobotStandsTooNear) {
  const std::vector<Wall> beside{{{-0.4, 0.22}, {0.4, 0.4}}};
  EXPECT_FALSE(BaseWays(among(beside), {}).empty());
}

TEST_F(BaseWaysTest, AreEmptyWhereThereIsNone) {
  const std::vector<Wall> ring{{{3.0, -1.0}, {3.1, 1.0}},
                               {{4.9, -1.0}, {5.0, 1.0}},
                               {{3.0, -1.0}, {5.0, -0.9}},
                               {{3.0, 0.9}, {5.0, 1.0}}};
  const BaseWays ways(among(ring), {});
  EXPECT_TRUE(ways.empty());
  EXPECT_FALSE(ways.length_m(as_span(Eigen::VectorXd(Eigen::Vector3d::Zero()))));
  Problem mapless = among({});
  mapless.field = nullptr;
  EXPECT_TRUE(BaseWays(mapless, {}).empty());
  EXPECT_TRUE(BaseWays(among({}), Deadline::after_s(-1.0)).empty());
  EXPECT_FALSE(BaseWays(among({}), {}).empty());
}

/// A ball on two wheels in the open: its third joint is its heading.
class RollingBall : public testing_support::BallRobot {
 public:
  RollingBall() : BallRobot(kBall_m) {
    description_.joints[2].type = Joint::Type::kContinuous;
    description_.rolling = RollingBase{0, 1, 2};
  }
  void sphere_centres(std::span<const double> q, std::span<Eigen::Vector3d> centres_m,
                      Scratch&) const override {
    for (std::size_t b = 0; b < centres_m.size(); ++b) {
      centres_m[b] = {q[3 * b], q[3 * b + 1], 0.0};
    }
  }
};

/// From the origin.
class RollingWays : public BaseWaysTest {
 protected:
  [[nodiscard]] static Trajectory to(const Eigen::Vector3d& goal) {
    Problem problem = among({});
    problem.robot = std::make_shared<RollingBall>();
    problem.goal.q = goal;
    return BaseWays(problem, {}).first_guess(problem);
  }
};

TEST_F(RollingWays, TurnDriveAndTurn) {
  constexpr double kDiagonal = 0.25 * std::numbers::pi;
  const Trajectory guess = to({2.0, 2.0, 0.5});
  // The way begins within a cell of the start; a chord that ends with it is 0.3 m long.
  constexpr double kCell_m = 0.05, kAside = kCell_m / 0.3;
  int turning = 0, driving = 0;
  for (int i = 1; i + 1 < guess.size(); ++i) {
    const auto q = guess.q(i);
    EXPECT_NEAR(q[0], q[1], kCell_m + 1e-9) << i;
    if (q[0] > 1e-9 && q[0] < 2.0 - 1e-9) {
      EXPECT_NEAR(q[2], kDiagonal, kAside) << i;
      ++driving;
    } else {
      EXPECT_GT(q[2], q[0] > 1.0 ? 0.5 : 0.0) << i;
      EXPECT_LT(q[2], kDiagonal + kAside) << i;
      ++turning;
    }
  }
  // Its speeds' limits are 1 m/s and 1 rad/s.
  const double share = (2.0 * kDiagonal - 0.5) / (2.0 * kDiagonal - 0.5 + std::hypot(2.0, 2.0));
  EXPECT_NEAR(turning, share * (guess.size() - 1), 2.0);
  EXPECT_GT(driving, 15);
  EXPECT_EQ(guess.q(guess.size() - 1)[2], 0.5);
}

TEST_F(RollingWays, DriveBackWhereItIsNear) {
  const Trajectory near = to({-0.6, 0.0, 0.0});
  for (int i = 0; i < near.size(); ++i) EXPECT_NEAR(near.q(i)[2], 0.0, 1e-9) << i;
  // Driving back, it would turn by 1.94 rad less, which are worth 1.94 m; the way is longer.
  const Trajectory far = to({-1.9, 3.6, 0.0});
  double highest = 0.0;
  for (int i = 0; i < far.size(); ++i) highest = std::max(highest, far.q(i)[2]);
  EXPECT_NEAR(highest, std::atan2(3.6, -1.9), 0.5);
}

/// As RollingBall, with an arm ahead: a second ball.
class RollingArm : public RollingBall {
 public:
  RollingArm() { description_.spheres.push_back({0, kArm_m * Eigen::Vector3d::UnitX(), 0.1}); }
  void sphere_centres(std::span<const double> q, std::span<Eigen::Vector3d> centres_m,
                      Scratch&) const override {
    for (std::size_t b = 0; b < centres_m.size() / 2; ++b) {
      const double* joints = q.data() + 3 * b;
      centres_m[2 * b] = {joints[0], joints[1], 0.0};
      centres_m[2 * b + 1] =
          centres_m[2 * b] + kArm_m * Eigen::Vector3d(std::cos(joints[2]), std::sin(joints[2]), 0);
    }
  }
  static constexpr double kArm_m = 0.6;
};

TEST_F(RollingWays, GoBackToWhereTheArmCanTurn) {
  // It reaches in between two posts; its way leads to where it came from.
  const std::vector<Wall> posts{{{0.3, 0.2}, {0.7, 0.4}}, {{0.3, -0.4}, {0.7, -0.2}}};
  Problem problem = among(posts);
  problem.robot = std::make_shared<RollingArm>();
  problem.goal.q = Eigen::Vector3d(-1.5, 2.5, 0.5 * std::numbers::pi);
  const BaseWays ways(problem, {});
  ASSERT_FALSE(ways.empty());
  const Trajectory guess = ways.first_guess(problem);
  double back_m = 0.0;
  for (int i = 1; i < guess.size() && std::abs(guess.q(i)[2]) < 1e-9; ++i) {
    EXPECT_NEAR(guess.q(i)[1], 0.0, 1e-9) << i;
    back_m = -guess.q(i)[0];
  }
  // The corners of the posts are then out of the arm's reach.
  const double reach_m = RollingArm::kArm_m + 0.1 + kApart_m;
  EXPECT_GE(back_m + 0.15, std::sqrt(reach_m * reach_m - 0.2 * 0.2) - 0.3);
  EXPECT_LT(back_m, 0.6);
  Scratch scratch;
  std::vector<Eigen::Vector3d> centres_m(2);
  for (int i = 0; i < guess.size(); ++i) {
    problem.robot->sphere_centres(guess.q(i), centres_m, scratch);
    for (const Wall& post : posts) EXPECT_GT(post.distance_m(centres_m[1].head<2>()), 0.1) << i;
  }
}

}  // namespace
}  // namespace sidestep
