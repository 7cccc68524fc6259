#include <sidestep/planning/inverse_kinematics.hpp>

#include <cmath>
#include <numbers>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <sidestep/planning/costs.hpp>
#include <sidestep/planning/goal.hpp>

#include "conformance/analytic_models.hpp"
#include "support/chain_robot.hpp"

namespace sidestep {
namespace {

using conformance::PlanarRobot;
using testing::HasSubstr;

constexpr double kLink_m = PlanarRobot::kLinkLength_m;

std::string nothing(std::span<const double>) { return ""; }

/// A planar arm of two links, of which the end is to be at a place. A third joint, which does not
/// move that end, is to be at 0.
Problem two_links(const Eigen::Vector3d& place_m, double range_rad = 2.8) {
  Problem problem;
  problem.robot =
      std::make_shared<PlanarRobot>(PlanarRobot::Shape{.rotary_joints = 3, .range_rad = range_rad});
  problem.start = problem.goal = {Eigen::Vector3d(0.1, 0.1, 0.1), Eigen::Vector3d::Zero()};
  auto there = make_link_position_cost(problem.robot, "link_3", place_m, 1e-3);
  auto still = make_posture_cost(problem.robot->description(), Eigen::Vector3d::Zero(),
                                 Eigen::Vector3d(kInfinity, kInfinity, 1e-3));
  problem.terms.push_back({std::move(there).value(), Placement::kGoal});
  problem.terms.push_back({std::move(still).value(), Placement::kGoal});
  return problem;
}

/// By the law of cosines, elbow to the one side or the other.
TEST(InverseKinematics, FindsBothElbowsOfTwoLinks) {
  const Eigen::Vector3d place_m(0.25, 0.3, 0.0);
  const double reach_m = place_m.norm();
  const double elbow = std::acos(reach_m * reach_m / (2 * kLink_m * kLink_m) - 1.0);
  const double towards = std::atan2(place_m.y(), place_m.x());
  const GoalConfigurations found = find_goals(two_links(place_m), {}, 1, nothing, Deadline());
  ASSERT_EQ(found.q.size(), 2u) << found.reason;
  for (const double side : {1.0, -1.0}) {
    const Eigen::Vector3d wanted(towards - 0.5 * side * elbow, side * elbow, 0.0);
    EXPECT_TRUE(std::ranges::any_of(
        found.q,
        [&](const Eigen::VectorXd& q) { return (q - wanted).lpNorm<Eigen::Infinity>() < 0.01; }))
        << "elbow " << side * elbow;
  }
  // The start has its elbow at 0.1.
  EXPECT_GT(found.q.front()[1], 0.0);
}

/// What cannot be reached is missed by as much as the arm is too short.
TEST(InverseKinematics, ComesAsNearAsThereIs) {
  const Problem problem = two_links({0.5, 0.6, 0.0});
  InverseKinematics kinematics(problem, 1);
  for (int i = 0; i < 20; ++i) EXPECT_EQ(kinematics.next().size(), 0);
  std::vector<Transform> poses(4);
  Scratch scratch;
  problem.robot->link_poses({kinematics.nearest().data(), 3}, poses, scratch);
  const Eigen::Vector3d expected = 2.0 * kLink_m * Eigen::Vector3d(0.5, 0.6, 0.0).normalized();
  EXPECT_NEAR((poses[3].translation() - expected).norm(), 0.0, 2e-3);
  const GoalConfigurations found =
      find_goals(problem, {.wanted = 1, .seeds = 10, .most_seeds = 30}, 1, nothing, Deadline());
  EXPECT_TRUE(found.q.empty());
  EXPECT_THAT(found.reason, HasSubstr("of 30 searches within the joints' limits none reaches"));
  EXPECT_THAT(found.reason, HasSubstr("the position of link_3 0.181"));
}

/// Of two elbows, one is beyond the limits of its joints.
TEST(InverseKinematics, KeepsToTheLimits) {
  const double elbow = 1.2, shoulder = 0.5;
  const Eigen::Vector3d place_m(kLink_m * (std::cos(shoulder) + std::cos(shoulder + elbow)),
                                kLink_m * (std::sin(shoulder) + std::sin(shoulder + elbow)), 0.0);
  // The other way: shoulder 1.7, elbow -1.2.
  const GoalConfigurations found = find_goals(two_links(place_m, 1.3), {}, 2, nothing, Deadline());
  ASSERT_EQ(found.q.size(), 1u) << found.reason;
  EXPECT_NEAR(found.q[0][0], shoulder, 0.01);
  EXPECT_NEAR(found.q[0][1], elbow, 0.01);
}

TEST(InverseKinematics, LeavesOutWhatIsBlockedAndSaysWhy) {
  const Problem problem = two_links({0.25, 0.3, 0.0});
  const auto is_left = [](std::span<const double> q) -> std::string {
    return q[1] > 0.0 ? "stands in the wall" : "";
  };
  const GoalConfigurations found = find_goals(problem, {}, 1, is_left, Deadline());
  ASSERT_EQ(found.q.size(), 1u);
  EXPECT_LT(found.q[0][1], 0.0);
  const GoalConfigurations none = find_goals(
      problem, {.most_seeds = 30}, 1, [](std::span<const double>) { return "is in a wall"; },
      Deadline());
  EXPECT_TRUE(none.q.empty());
  EXPECT_THAT(none.reason, HasSubstr("the last that reaches it is in a wall"));
}

/// Poses that a mobile arm takes in random configurations are reached again.
TEST(InverseKinematics, ReachesWhatTheRobotHasReached) {
  Problem problem;
  problem.robot = testing_support::mobile_arm();
  const RobotDescription& robot = problem.robot->description();
  const int dof = robot.dof();
  problem.start = problem.goal = {Eigen::VectorXd::Zero(dof), Eigen::VectorXd::Zero(dof)};
  std::vector<Transform> poses(robot.links.size());
  Scratch scratch;
  std::srand(5);
  for (int i = 0; i < 50; ++i) {
    Eigen::VectorXd q = Eigen::VectorXd::Random(dof);
    for (int j = 0; j < dof; ++j) {
      const Joint& joint = robot.joints[static_cast<std::size_t>(j)];
      q[j] = std::clamp(2.0 * q[j], joint.lower, joint.upper);
    }
    problem.robot->link_poses({q.data(), static_cast<std::size_t>(dof)}, poses, scratch);
    problem.terms.clear();
    problem.terms.push_back(
        {make_link_pose_cost(problem.robot, "hand", poses.back(), 1e-3, 5e-3).value(),
         Placement::kGoal});
    const GoalConfigurations found =
        find_goals(problem, {}, static_cast<std::uint64_t>(i), nothing, Deadline());
    ASSERT_FALSE(found.q.empty()) << found.reason;
    for (const Eigen::VectorXd& end : found.q) {
      EXPECT_EQ(goal_miss(problem, {end.data(), static_cast<std::size_t>(dof)}), "");
      for (int j = 0; j < dof; ++j) {
        const Joint& joint = robot.joints[static_cast<std::size_t>(j)];
        EXPECT_GE(end[j], joint.lower);
        EXPECT_LE(end[j], joint.upper);
      }
    }
  }
}

}  // namespace
}  // namespace sidestep
