#include "rrt_connect.hpp"

#include <gtest/gtest.h>

#include <sidestep/field/scene_field.hpp>
#include <sidestep/planning/goal.hpp>
#include <sidestep/planning/validity_check.hpp>

#include "conformance/test_host.hpp"
#include "support/hsr.hpp"

namespace sidestep::rrt_connect {
namespace {

/// A Panda that reaches from one side of a post to the other.
Problem around_a_post() {
  SceneObject post;
  post.name = "post";
  post.shape = Cylinder{0.05, 2.0};
  post.waypoints.resize(1);
  post.waypoints[0].T_world_object.translation() << 0.45, 0.0, 0.0;
  Problem problem;
  problem.robot = testing_support::load_profile("panda");
  problem.field = std::make_shared<SceneField>(
      Scene({post}), Stamp(),
      Eigen::AlignedBox3d(Eigen::Vector3d::Constant(-2.0), Eigen::Vector3d::Constant(2.0)));
  problem.space = {Space::kFree, Space::kFree};
  problem.start = {Eigen::VectorXd::Zero(7), Eigen::VectorXd::Zero(7)};
  problem.goal = problem.start;
  problem.start.q << 0.7, 0.4, 0.0, -2.0, 0.0, 2.4, 0.78;
  problem.goal.q << -0.7, 0.4, 0.0, -2.0, 0.0, 2.4, 0.78;
  problem.support_states = 10;
  problem.dt_s = 0.5;
  problem.qc = Eigen::VectorXd::Ones(7);
  return problem;
}

Solution solve(const Problem& problem, const Options& options, std::uint64_t seed) {
  conformance::RecordingLog log;
  auto solution = make_rrt_connect(options, seed, log)->solve(problem, {}, Deadline());
  EXPECT_TRUE(solution) << solution.error().describe();
  return solution ? std::move(*solution) : Solution{};
}

/// The same optimiser keeps nothing of a problem that another, or another time, would notice.
TEST(RrtConnect, SolvesAProblemAlikeWheneverItIsAsked) {
  const Problem problem = around_a_post();
  Problem back = problem;
  std::swap(back.start, back.goal);
  conformance::RecordingLog log;
  const auto planner = make_rrt_connect({}, 3, log);
  const auto first = planner->solve(problem, {}, Deadline());
  ASSERT_TRUE(first);
  ASSERT_EQ(first->status, SolveStatus::kConverged) << first->reason;
  EXPECT_GT(first->iterations, 0);  // the straight line is blocked
  (void)planner->solve(back, {}, Deadline());
  EXPECT_EQ(planner->solve(problem, {}, Deadline())->trajectory.positions,
            first->trajectory.positions);
}

TEST(RrtConnect, ShortensWhatItFinds) {
  const Problem problem = around_a_post();
  Options raw;
  raw.shorten_tries = 0;
  Options thorough;
  thorough.shorten_tries = 200;
  double with = 0.0, without = 0.0;
  for (std::uint64_t seed = 0; seed < 10; ++seed) {
    const Solution solution = solve(problem, thorough, seed);
    EXPECT_LE(solution.cost, solution.initial_cost);
    with += solution.cost;
    without += solve(problem, raw, seed).cost;
  }
  EXPECT_LT(with, without);
}

TEST(RrtConnect, GivesUpAfterItsSamples) {
  Problem problem = around_a_post();
  Options options;
  options.max_samples = 200;
  options.range_m = 0.001;  // the trees cannot meet
  const Solution solution = solve(problem, options, 1);
  EXPECT_EQ(solution.status, SolveStatus::kNoPath);
  EXPECT_GE(solution.iterations, 200);
  EXPECT_LT(solution.iterations, 500);  // a round more at most
  EXPECT_NE(solution.reason.find("samples"), std::string::npos);
}

/// A turn that a base makes without limits ends at any whole number of turns, where it may.
TEST(RrtConnect, TurnsTheShortWayWhereAnyTurnWillDo) {
  Problem problem;
  problem.robot = testing_support::load_hsr();
  SceneObject post;
  post.name = "post";
  post.shape = Cylinder{0.2, 2.0};
  post.waypoints.resize(1);
  post.waypoints[0].T_world_object.translation() << 1.0, 0.0, 0.0;
  problem.field = std::make_shared<SceneField>(
      Scene({post}), Stamp(),
      Eigen::AlignedBox3d(Eigen::Vector3d::Constant(-4.0), Eigen::Vector3d::Constant(4.0)));
  problem.space = {Space::kFree, Space::kFree};
  problem.start = {Eigen::VectorXd::Zero(8), Eigen::VectorXd::Zero(8)};
  problem.start.q << 0.0, 0.0, 3.0, 0.0, 0.0, -1.57, -1.57, 0.0;
  problem.goal = problem.start;
  problem.goal.q[0] = 2.0;
  problem.goal.q[2] = -3.0;
  problem.support_states = 10;
  problem.dt_s = 0.5;
  problem.qc = Eigen::VectorXd::Ones(8);
  for (const bool any_turn : {false, true}) {
    Options options;
    options.any_turn = any_turn;
    int near = 0;
    for (std::uint64_t seed = 0; seed < 5; ++seed) {
      const Solution solution = solve(problem, options, seed);
      ASSERT_EQ(solution.status, SolveStatus::kConverged) << solution.reason;
      const Trajectory& driven = solution.trajectory;
      EXPECT_EQ(goal_miss(problem, driven.q(driven.size() - 1)), "");
      near += driven.q(driven.size() - 1)[2] > 3.0 ? 1 : 0;
      const auto check = make_field_check(problem.robot, problem.field, problem.space, {});
      const auto verdict = check->check(driven, 0.0, Deadline());
      ASSERT_TRUE(verdict);
      EXPECT_TRUE(verdict->valid()) << verdict->describe();
    }
    EXPECT_EQ(near > 0, any_turn);
  }
}

}  // namespace
}  // namespace sidestep::rrt_connect
