#include "search.hpp"

#include <numbers>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <sidestep/field/scene_field.hpp>
#include <sidestep/planning/goal.hpp>

#include "conformance/test_host.hpp"
#include "ompl_optimiser.hpp"
#include "support/hsr.hpp"

namespace sidestep::ompl_optimiser {
namespace {

constexpr double kTurn_rad = 2.0 * std::numbers::pi;

/// The HSR in an empty hall, whose base turns without limits.
Problem in_hall(double yaw_start, double yaw_goal) {
  Problem problem;
  problem.robot = testing_support::load_hsr();
  const Eigen::AlignedBox3d bounds_m(Eigen::Vector3d::Constant(-4.0),
                                     Eigen::Vector3d::Constant(4.0));
  problem.field = std::make_shared<SceneField>(Scene(), Stamp(), bounds_m);
  problem.space = {Space::kFree, Space::kFree};
  problem.start = {Eigen::VectorXd::Zero(8), Eigen::VectorXd::Zero(8)};
  problem.start.q << 0.0, 0.0, yaw_start, 0.0, 0.0, -1.57, -1.57, 0.0;
  problem.goal = problem.start;
  problem.goal.q[2] = yaw_goal;
  problem.support_states = 10;
  problem.dt_s = 0.5;
  problem.qc = Eigen::VectorXd::Ones(8);
  return problem;
}

Node one_weight(const char* joint, const char* weight) {
  Node::Map entries;
  entries.push_back({joint, {}, Node(Node::Scalar{weight, false}, {})});
  return Node(std::move(entries), {});
}

double weight(const JointSpace& space, std::size_t joint) {
  std::vector<double> q(space.dof(), 0.0);
  std::vector<double> u(space.dof());
  q[joint] = 1.0;
  space.from_joints(q, u);
  return u[joint];
}

JointSpace space_of(const Problem& problem, const JointMetric& metric, bool any_turn) {
  return JointSpace(problem, {&problem.goal.q, 1}, weights_of(problem, metric), any_turn);
}

TEST(JointSpace, WeighsByTimeOrByMotionOrAsTold) {
  const Problem problem = in_hall(0.0, 1.0);
  const std::vector<Joint>& joints = problem.robot->description().joints;
  const JointSpace by_time = space_of(problem, {}, false);
  for (std::size_t j = 0; j < joints.size(); ++j) {
    EXPECT_NEAR(weight(by_time, j) * joints[j].max_velocity, 1.0, 1e-12) << joints[j].name;
  }
  // By motion a metre weighs the same in each direction of the base, and the lift's metre as much;
  // no joint's full speed counts for more than a second per second.
  const JointSpace by_motion = space_of(problem, {.name = "motion"}, false);
  EXPECT_NEAR(weight(by_motion, 0), weight(by_motion, 1), 1e-12);
  EXPECT_NEAR(weight(by_motion, 0), weight(by_motion, 3), 1e-12);
  double most = 0.0;
  for (std::size_t j = 0; j < joints.size(); ++j) {
    most = std::max(most, weight(by_motion, j) * joints[j].max_velocity);
  }
  EXPECT_NEAR(most, 1.0, 1e-12);
  // The farthest centre of a sphere from the base's axis, by distances alone.
  std::vector<Eigen::Vector3d> centres(problem.robot->description().spheres.size());
  Scratch scratch;
  problem.robot->sphere_centres({problem.start.q.data(), 8}, centres, scratch);
  double lever_m = 0.0;
  for (const Eigen::Vector3d& centre : centres)
    lever_m = std::max(lever_m, centre.head<2>().norm());
  EXPECT_NEAR(weight(by_motion, 2) / weight(by_motion, 0), lever_m, 1e-9);

  const JointSpace told = space_of(problem, {.weights = one_weight("odom_t", "0.25")}, false);
  EXPECT_EQ(weight(told, 2), 0.25);
  EXPECT_EQ(weight(told, 0), weight(by_time, 0));
}

TEST(JointSpace, RefusesWeightsOfJointsThatDoNotExist) {
  const Problem problem = in_hall(0.0, 1.0);
  Options options;
  options.weights = one_weight("odom_tt", "1");
  conformance::RecordingLog log;
  const auto solution = make_ompl_optimiser(options, 1, log)->solve(problem, {}, Deadline());
  ASSERT_FALSE(solution);
  EXPECT_THAT(solution.error().describe(), testing::HasSubstr("did you mean 'odom_t'"));
}

TEST(JointSpace, EndsInTheNearestEquivalentOfAFreeTurn) {
  for (const double turns : {0.0, 1.0, -3.0}) {
    const Problem problem = in_hall(3.0, -3.0 + turns * kTurn_rad);
    const JointSpace space = space_of(problem, {}, true);
    ASSERT_EQ(space.goals().size(), 2u);  // one joint turns freely
    EXPECT_NEAR(space.goals()[0][2], -3.0 + kTurn_rad, 1e-9);
    EXPECT_NEAR(space.goals()[1][2], -3.0, 1e-9);
    for (const Eigen::VectorXd& goal : space.goals()) {
      const double u = goal[2] * weight(space, 2);
      EXPECT_LE(space.lower(2), u);
      EXPECT_GE(space.upper(2), u);
    }
    EXPECT_EQ(space_of(problem, {}, false).goals().front(), problem.goal.q);
  }
}

TEST(JointSpace, NeverWrapsAJointWithLimits) {
  Problem problem = in_hall(0.0, 0.0);
  problem.start.q[4] = -2.5;  // arm_flex_joint
  const JointSpace space = space_of(problem, {}, true);
  for (const Eigen::VectorXd& goal : space.goals()) EXPECT_EQ(goal[4], problem.goal.q[4]);
}

/// As short a turn as there is, without a jump, and no miss of the goal.
TEST(JointSpace, PlansTheShortTurn) {
  const Problem problem = in_hall(3.0, -3.0);
  for (const bool any_turn : {false, true}) {
    Options options;
    options.any_turn = any_turn;
    conformance::RecordingLog log;
    const auto solution = make_ompl_optimiser(options, 1, log)->solve(problem, {}, Deadline());
    ASSERT_TRUE(solution) << solution.error().describe();
    ASSERT_EQ(solution->status, SolveStatus::kConverged) << solution->reason;
    const Trajectory& driven = solution->trajectory;
    double turned_rad = 0.0;
    for (int i = 1; i < driven.size(); ++i) {
      turned_rad += std::abs(driven.q(i)[2] - driven.q(i - 1)[2]);
    }
    EXPECT_NEAR(turned_rad, any_turn ? kTurn_rad - 6.0 : 6.0, 1e-9);
    EXPECT_EQ(goal_miss(problem, driven.q(driven.size() - 1)), "");
  }
}

}  // namespace
}  // namespace sidestep::ompl_optimiser
