#include <gtest/gtest.h>

#include <sidestep/planning/validity_check.hpp>
#include <sidestep/runtime/shape_check.hpp>

#include "support.hpp"
#include "support/hsr_room.hpp"

namespace sidestep::joint_paths {
namespace {

using testing_support::HsrRoom;

class HsrPlan : public testing::TestWithParam<const char*> {};

/// Through a door and over a table: what the planner calls clear, both checks call valid.
TEST_P(HsrPlan, PassesBothChecks) {
  const HsrRoom room(0.05);
  Problem problem = room.problem();
  problem.collision_margin_m = 0.05;  // more than half a voxel's diagonal
  conformance::RecordingLog log;
  const auto solution =
      make_planner(GetParam(), "field", 3, log)->solve(problem, Trajectory{}, Deadline());
  ASSERT_TRUE(solution) << solution.error().describe();
  ASSERT_EQ(solution->status, SolveStatus::kConverged) << solution->reason;

  const auto field_check = make_field_check(problem.robot, problem.field, problem.space,
                                            {.margin_m = problem.collision_margin_m});
  const auto valid = field_check->check(solution->trajectory, 0.0, Deadline());
  ASSERT_TRUE(valid) << valid.error().describe();
  EXPECT_TRUE(valid->valid()) << valid->describe();
  EXPECT_GE(valid->min_clearance_m, problem.collision_margin_m);

  ShapeObstacles obstacles;
  obstacles.resolution_m = room.resolution_m();
  obstacles.occupied_centres_m = room.surface_centres(0.0);
  const auto shape_check = make_shape_check(problem.robot, obstacles, {});
  ASSERT_TRUE(shape_check) << shape_check.error().describe();
  const auto independent = (*shape_check)->check(solution->trajectory, 0.0, Deadline());
  ASSERT_TRUE(independent) << independent.error().describe();
  EXPECT_TRUE(independent->valid()) << independent->describe();
  // Spheres cover the shapes, and voxels reach half a diagonal beyond their centres at most.
  EXPECT_GE(independent->min_clearance_m,
            valid->min_clearance_m - 0.5 * std::sqrt(3.0) * room.resolution_m() - 1e-5);
}

INSTANTIATE_TEST_SUITE_P(Planners, HsrPlan,
                         testing::Values("rrt_connect", "RRTConnect", "RRTstar", "BITstar", "PRM"));

}  // namespace
}  // namespace sidestep::joint_paths
