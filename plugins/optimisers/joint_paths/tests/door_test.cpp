#include <gtest/gtest.h>

#include <string>
#include <vector>

#include <sidestep/planning/costs.hpp>
#include <sidestep/planning/validity_check.hpp>

#include "support.hpp"
#include "support/chain_robot.hpp"
#include "support/voxel_field.hpp"

namespace sidestep::joint_paths {
namespace {

using conformance::RecordingLog;
using testing_support::Aabb;
using testing_support::ChainRobot;
using testing_support::VoxelWorld;

/// A wall across a room, with a door for the base below a lintel that the arm must duck under.
VoxelWorld room_with_door() {
  VoxelWorld world;
  world.grid = {{-2.0, -1.5, -0.1}, 0.1, {40, 30, 18}};
  world.occupied = {Aabb{{-0.15, -1.5, -0.1}, {0.15, -0.5, 1.7}},
                    Aabb{{-0.15, 0.5, -0.1}, {0.15, 1.5, 1.7}},
                    Aabb{{-0.15, -0.5, 1.2}, {0.15, 0.5, 1.7}}};
  return world;
}

class EveryPlanner : public testing::TestWithParam<const char*> {
 protected:
  EveryPlanner() {
    robot_ = testing_support::mobile_arm();
    problem_.robot = robot_;
    problem_.field = room_with_door().field();
    problem_.space = {Space::kOccupied, Space::kOccupied};
    problem_.collision_margin_m = 0.02;
    problem_.start = rest(-1.2, 0.3, 0.5);
    problem_.goal = rest(1.2, -0.4, -1.0);
    problem_.support_states = 10;
    problem_.dt_s = 0.5;
    problem_.qc = Eigen::VectorXd::Ones(7);
  }

  static RobotState rest(double x, double y, double theta) {
    Eigen::VectorXd q(7);
    q << x, y, theta, 0.2, -0.8, 1.2, 0.0;
    return {q, Eigen::VectorXd::Zero(7)};
  }
  [[nodiscard]] std::unique_ptr<Optimiser> planner(std::uint64_t seed, int samples = kMostSamples) {
    return make_planner(GetParam(), "field", seed, log_, samples);
  }
  Solution solve(std::uint64_t seed = 1, const Deadline& deadline = Deadline(),
                 int samples = kMostSamples) {
    auto solution = planner(seed, samples)->solve(problem_, {}, deadline);
    EXPECT_TRUE(solution) << solution.error().describe();
    return solution ? std::move(*solution) : Solution{};
  }
  [[nodiscard]] Verdict verdict(const Trajectory& trajectory) const {
    const auto check = make_field_check(
        robot_, problem_.field, problem_.space,
        {.margin_m = problem_.collision_margin_m, .speed_fraction = problem_.speed_fraction});
    return check->check(trajectory, 0.0, Deadline()).value();
  }

  std::shared_ptr<ChainRobot> robot_;
  Problem problem_;
  RecordingLog log_;
};

TEST_P(EveryPlanner, PassesTheDoorAndTheFieldCheck) {
  problem_.speed_fraction = 0.7;
  for (const std::uint64_t seed : {1u, 2u, 3u}) {
    const Solution solution = solve(seed);
    ASSERT_EQ(solution.status, SolveStatus::kConverged) << solution.reason;
    EXPECT_GT(solution.iterations, 0);
    EXPECT_LE(solution.cost, solution.initial_cost + 1e-9);
    const Verdict its = verdict(solution.trajectory);
    EXPECT_TRUE(its.valid()) << its.describe();
    EXPECT_GE(its.min_clearance_m, problem_.collision_margin_m);
    EXPECT_EQ(solution.trajectory.q(0)[0], -1.2);
    EXPECT_EQ(solution.trajectory.q(solution.trajectory.size() - 1)[2], -1.0);
  }
}

TEST_P(EveryPlanner, RepeatsItselfForASeedAndOnlyForThat) {
  const Solution first = solve(5);
  const Solution second = solve(5);
  const Solution other = solve(6);
  ASSERT_EQ(first.status, SolveStatus::kConverged);
  EXPECT_EQ(first.trajectory.positions, second.trajectory.positions);
  EXPECT_EQ(first.iterations, second.iterations);
  EXPECT_NE(first.trajectory.positions, other.trajectory.positions);
}

TEST_P(EveryPlanner, SaysWhereThereIsNoPath) {
  VoxelWorld world = room_with_door();
  world.occupied.push_back(Aabb{{-0.15, -0.5, -0.1}, {0.15, 0.5, 1.2}});  // shut the door
  problem_.field = world.field();
  const Solution solution = solve(1, Deadline(), 300);
  EXPECT_EQ(solution.status, SolveStatus::kNoPath);
  EXPECT_EQ(solution.trajectory.size(), 0);
  EXPECT_NE(solution.reason.find("no path to the goal"), std::string::npos) << solution.reason;
}

TEST_P(EveryPlanner, StopsWhenAsked) {
  VoxelWorld world = room_with_door();
  world.occupied.push_back(Aabb{{-0.15, -0.5, -0.1}, {0.15, 0.5, 1.2}});
  problem_.field = world.field();
  const Solution solution = solve(1, Deadline::after_s(0.05));
  EXPECT_EQ(solution.status, SolveStatus::kDeadline);
  EXPECT_FALSE(solution.reason.empty());
}

TEST_P(EveryPlanner, NamesTheLinkAndTheDepthOfAStartInCollision) {
  // Centres of the base's spheres at x = -0.3 -+ 0.08; voxels of the wall from x = -0.15 on.
  problem_.start = rest(-0.3, 1.0, 0.0);
  const Solution solution = solve();
  EXPECT_EQ(solution.status, SolveStatus::kNoPath);
  EXPECT_EQ(solution.trajectory.size(), 0);
  EXPECT_EQ(solution.reason.rfind("start is in collision: base is 0.1", 0), 0u) << solution.reason;
  EXPECT_NE(solution.reason.find(" m inside an obstacle"), std::string::npos) << solution.reason;
}

TEST_P(EveryPlanner, NamesTheLinksOfAGoalInSelfCollision) {
  problem_.goal.q.tail(4) << 0.0, 0.5, 2.2, 0.0;
  problem_.goal.q[4] = -0.9;
  problem_.goal.q[5] = 2.2;
  robot_->description().self_collision_pairs = {{4, 6}};  // mast and fore-arm
  robot_->description().spheres[6].radius_m = 0.4;
  problem_.space.outside = Space::kFree;
  const Solution solution = solve();
  EXPECT_EQ(solution.status, SolveStatus::kNoPath);
  EXPECT_NE(solution.reason.find("self-collision: fore_arm is "), std::string::npos)
      << solution.reason;
  EXPECT_NE(solution.reason.find("inside mast"), std::string::npos) << solution.reason;
}

TEST_P(EveryPlanner, ReachesAGoalThatOnlyCostsKnow) {
  const auto aim = [&](const Eigen::Vector3d& place_m) {
    auto there = make_link_position_cost(robot_, "hand", place_m, 1e-3);
    ASSERT_TRUE(there) << there.error().describe();
    problem_.terms = {{std::move(*there), Placement::kGoal}};
  };
  const Eigen::Vector3d place_m(1.0, 0.2, 0.9);
  aim(place_m);
  problem_.goal = problem_.start;  // on this side of the wall
  const Solution solution = solve();
  ASSERT_EQ(solution.status, SolveStatus::kConverged) << solution.reason;
  std::vector<Transform> poses(robot_->description().links.size());
  Scratch scratch;
  robot_->link_poses(solution.trajectory.q(solution.trajectory.size() - 1), poses, scratch);
  EXPECT_LE((poses.back().translation() - place_m).norm(), 3e-3);
  const Verdict its = verdict(solution.trajectory);
  EXPECT_TRUE(its.valid()) << its.describe();

  aim({0.0, 1.0, 0.9});  // in the wall
  const Solution none = solve();
  EXPECT_EQ(none.status, SolveStatus::kNoPath);
  EXPECT_NE(none.reason.find("the last that reaches it is in collision: "), std::string::npos)
      << none.reason;
}

TEST_P(EveryPlanner, DoesNotShortenATurnOfAContinuousJoint) {
  problem_.goal = problem_.start;
  problem_.goal.q[2] += 6.0;  // nearly a full turn
  const Solution solution = solve();
  ASSERT_EQ(solution.status, SolveStatus::kConverged) << solution.reason;
  const int last = solution.trajectory.size() - 1;
  EXPECT_EQ(solution.trajectory.q(last)[2], problem_.start.q[2] + 6.0);
}

TEST_P(EveryPlanner, SpeaksOnlyThroughTheLog) {
  testing::internal::CaptureStderr();
  testing::internal::CaptureStdout();
  (void)solve(3);
  (void)solve(4);
  EXPECT_EQ(testing::internal::GetCapturedStderr(), "");
  EXPECT_EQ(testing::internal::GetCapturedStdout(), "");
  EXPECT_EQ(log_.count(LogLevel::kError), 0);
  if (std::string(GetParam()) == "RRTConnect") {
    EXPECT_GT(log_.count(LogLevel::kDebug), 0);
  }
}

TEST_P(EveryPlanner, NeedsAField) {
  problem_.field = nullptr;
  const auto solution = planner(1)->solve(problem_, {}, Deadline());
  ASSERT_FALSE(solution);
  EXPECT_EQ(solution.error().code, ErrorCode::kInvalidArgument);
}

INSTANTIATE_TEST_SUITE_P(Planners, EveryPlanner,
                         testing::Values("rrt_connect", "RRTConnect", "RRTstar", "BITstar", "PRM"));

}  // namespace
}  // namespace sidestep::joint_paths
