#include "checker.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <sidestep/field/scene_field.hpp>
#include <sidestep/runtime/shape_check.hpp>

#include "conformance/test_host.hpp"
#include "ompl_optimiser.hpp"
#include "support/chain_robot.hpp"
#include "support/hsr_room.hpp"

namespace sidestep::ompl_optimiser {
namespace {

using joint_paths::make_checker;
using testing::HasSubstr;
using testing_support::HsrRoom;

std::shared_ptr<const DistanceField> empty_scene() {
  const Eigen::AlignedBox3d bounds_m(Eigen::Vector3d::Constant(-4.0),
                                     Eigen::Vector3d::Constant(4.0));
  return std::make_shared<SceneField>(Scene(), Stamp(), bounds_m);
}

std::string complaint(const char* name, const Problem& problem) {
  Options options;
  options.checker = name;
  conformance::RecordingLog log;
  const auto solution = make_ompl_optimiser(options, 1, log)->solve(problem, {}, Deadline());
  return solution ? "none" : solution.error().describe();
}

TEST(Checker, SaysWhatAProblemHasNot) {
  Problem problem = HsrRoom(0.1).problem();
  EXPECT_THAT(complaint("primitives", problem), HasSubstr("checker: primitives wants the shapes"));
  problem.field = empty_scene();
  EXPECT_THAT(complaint("octomap", problem), HasSubstr("checker: octomap wants a map of voxels"));
  EXPECT_EQ(complaint("primitives", problem), "none");
  problem.robot = testing_support::mobile_arm();
  problem.start = problem.goal = {Eigen::VectorXd::Zero(7), Eigen::VectorXd::Zero(7)};
  problem.qc = Eigen::VectorXd::Ones(7);
  EXPECT_THAT(complaint("primitives", problem), HasSubstr("mobile_arm has none"));
}

/// Through a door and over a table, by FCL and an octree of the map's voxels; FCL judges it again,
/// over continuous time, on the boxes themselves.
TEST(Checker, PlansAmongVoxelsOfAnOctree) {
  const HsrRoom room(0.05);
  Problem problem = room.problem();
  problem.space = {Space::kFree, Space::kOccupied};
  problem.collision_margin_m = 0.01;
  Options options;
  options.checker = "octomap";
  options.max_time_s = 300.0;
  options.max_iterations = 3000;
  conformance::RecordingLog log;
  const auto solution = make_ompl_optimiser(options, 3, log)->solve(problem, {}, Deadline());
  ASSERT_TRUE(solution) << solution.error().describe();
  ASSERT_EQ(solution->status, SolveStatus::kConverged) << solution->reason;
  EXPECT_GT(solution->iterations, 0);
  ShapeObstacles obstacles;
  obstacles.resolution_m = room.resolution_m();
  obstacles.occupied_centres_m = room.surface_centres(0.0);
  const auto verdict = (*make_shape_check(problem.robot, obstacles, {}))
                           ->check(solution->trajectory, 0.0, Deadline());
  ASSERT_TRUE(verdict) << verdict.error().describe();
  EXPECT_TRUE(verdict->valid()) << verdict->describe();
  EXPECT_GE(verdict->min_clearance_m, problem.collision_margin_m);
}

/// What is kept of a map is not kept where anything about the problem differs.
TEST(Checker, LooksAtTheSameOctreeUnlessSomethingDiffers) {
  const Problem problem = HsrRoom(0.1).problem();
  const std::span<const double> q(problem.start.q.data(), 8);
  const auto checker = make_checker("octomap");
  const auto is_clear_in = [&](const Problem& posed) {
    EXPECT_TRUE(checker->look_at(posed));
    return checker->is_clear(q);
  };
  ASSERT_TRUE(is_clear_in(problem));
  EXPECT_TRUE(is_clear_in(problem));
  Problem far = problem;
  far.collision_margin_m = 2.0;
  EXPECT_FALSE(is_clear_in(far));
  Problem flooded = problem;
  flooded.space.floor = Floor{0.3, {}};
  EXPECT_FALSE(is_clear_in(flooded));
  flooded.space.floor = Floor{-1.0, {}};
  EXPECT_TRUE(is_clear_in(flooded));
  Problem elsewhere = problem;
  const HsrRoom other(0.1);
  elsewhere.field = other.problem().field;
  EXPECT_TRUE(is_clear_in(elsewhere));
  EXPECT_TRUE(is_clear_in(problem));
}

/// The floor is a plane for shapes, too, and its exceptions hold.
TEST(Checker, KeepsLinksFromTheFloor) {
  Problem problem = HsrRoom(0.1).problem();
  problem.field = empty_scene();
  problem.space.floor = Floor{0.15, {}};
  for (const Link& link : problem.robot->description().links) {
    problem.space.floor->except_links.push_back(link.name);
  }
  const auto checker = make_checker("primitives");
  const std::span<const double> q(problem.start.q.data(), 8);
  ASSERT_TRUE(checker->look_at(problem));
  EXPECT_TRUE(checker->is_clear(q));
  std::erase(problem.space.floor->except_links, "base_link");
  ASSERT_TRUE(checker->look_at(problem));
  EXPECT_FALSE(checker->is_clear(q));
  const auto hit = checker->violation(q);
  ASSERT_TRUE(hit);
  EXPECT_EQ(hit->subject, "base_link");
  EXPECT_EQ(hit->other, "the floor");
}

}  // namespace
}  // namespace sidestep::ompl_optimiser
