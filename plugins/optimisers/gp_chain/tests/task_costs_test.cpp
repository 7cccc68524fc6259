#include <cmath>
#include <limits>

#include <gtest/gtest.h>

#include <sidestep/planning/costs.hpp>
#include <sidestep/robot/attached_object.hpp>

#include "conformance/optimiser_conformance.hpp"
#include "support/chain_robot.hpp"

#include "gp_chain.hpp"

namespace sidestep {
namespace {

using conformance::clearance_m;
using conformance::straight_line_of;

/// A mobile arm whose goal configuration is free, and that stands still unless a term moves it.
class TaskCostSolves : public testing::Test {
 protected:
  TaskCostSolves() {
    problem_.robot = testing_support::mobile_arm();
    problem_.start = {Eigen::VectorXd::Zero(7), Eigen::VectorXd::Zero(7)};
    problem_.start.q << 0.0, 0.0, 0.3, 0.1, -0.6, 0.9, 0.2;
    problem_.goal = problem_.start;
    problem_.support_states = 21;
    problem_.dt_s = 0.3;
    problem_.qc = Eigen::VectorXd::Ones(7);
    problem_.interpolated_checks = 2;
    problem_.terms = standard_terms(problem_, {.sigma_self_collision = 0.0, .hold_goal = false});
  }

  void add(Result<std::unique_ptr<StateCost>> cost, Placement placement) {
    ASSERT_TRUE(cost.has_value()) << cost.error().describe();
    problem_.terms.push_back({std::move(*cost), placement});
  }

  Trajectory solve() {
    const auto solution = make_gp_chain({.max_iterations = 200})
                              ->solve(problem_, straight_line_of(problem_), Deadline());
    EXPECT_TRUE(solution.has_value()) << solution.error().describe();
    EXPECT_EQ(solution->status, SolveStatus::kConverged) << solution->reason;
    conformance::expect_state(solution->trajectory.q(0), problem_.start.q, "start");
    return solution->trajectory;
  }

  Transform hand(std::span<const double> q) {
    std::vector<Transform> poses(problem_.robot->description().links.size());
    problem_.robot->link_poses(q, poses, scratch_);
    return poses.back();
  }
  Transform hand_at_end(const Trajectory& trajectory) {
    return hand(trajectory.q(trajectory.size() - 1));
  }
  /// The largest of `measure` of the hand's pose, between support states as well.
  double worst(const Trajectory& trajectory,
               const std::function<double(const Transform&)>& measure) {
    std::vector<double> q(7), qdot(7);
    double largest = 0.0;
    for (double time_s = 0.0; time_s <= trajectory.duration_s(); time_s += 0.05) {
      trajectory.sample(time_s, q, qdot);
      largest = std::max(largest, measure(hand(q)));
    }
    return largest;
  }

  Problem problem_;
  Scratch scratch_;
  const Eigen::Vector3d place_m_{1.2, 0.5, 0.8};
};

TEST_F(TaskCostSolves, ReachesAPositionWithTheGoalConfigurationFree) {
  add(make_link_position_cost(problem_.robot, "hand", place_m_, 1e-4), Placement::kGoal);
  const Trajectory trajectory = solve();
  EXPECT_LT((hand_at_end(trajectory).translation() - place_m_).norm(), 1e-3);
  for (const double velocity : trajectory.qdot(trajectory.size() - 1)) {
    EXPECT_NEAR(velocity, 0.0, 1e-3);
  }
}

TEST_F(TaskCostSolves, ReachesAPoseFarFromThatOfTheStart) {
  Eigen::VectorXd there = problem_.start.q;
  there << 0.6, 0.9, 2.6, 0.3, -1.2, 0.4, -1.0;
  const Transform target = hand({there.data(), 7});
  const Eigen::Matrix3d turn =
      hand({problem_.start.q.data(), 7}).linear().transpose() * target.linear();
  ASSERT_GT(Eigen::AngleAxisd(turn).angle(), 2.0);
  add(make_link_pose_cost(problem_.robot, "hand", target, 1e-4, 1e-3), Placement::kGoal);
  const Transform end = hand_at_end(solve());
  EXPECT_LT((end.translation() - target.translation()).norm(), 1e-3);
  EXPECT_LT((end.linear() - target.linear()).norm(), 5e-3);
}

TEST_F(TaskCostSolves, HoldsAnOrientationAlongTheWay) {
  add(make_link_position_cost(problem_.robot, "hand", place_m_, 1e-4), Placement::kGoal);
  const Eigen::Matrix3d wanted = hand({problem_.start.q.data(), 7}).linear();
  const auto off = [&](const Transform& T) {
    return Eigen::AngleAxisd(wanted.transpose() * T.linear()).angle();
  };
  ASSERT_GT(worst(solve(), off), 0.1);
  add(make_link_orientation_cost(problem_.robot, "hand", wanted, 0.002),
      Placement::kSupportAndInterpolated);
  const Trajectory trajectory = solve();
  EXPECT_LT(worst(trajectory, off), 0.01);
  EXPECT_LT((hand_at_end(trajectory).translation() - place_m_).norm(), 1e-3);
}

TEST_F(TaskCostSolves, KeepsAnAxisUpright) {
  problem_.start.q.tail(3) << -0.6, 0.6, 0.0;
  problem_.goal = problem_.start;
  problem_.terms = standard_terms(problem_, {.sigma_self_collision = 0.0, .hold_goal = false});
  add(make_link_position_cost(problem_.robot, "hand", place_m_, 1e-4), Placement::kGoal);
  const auto tilt = [](const Transform& T) { return std::acos(std::min(1.0, T.linear()(2, 2))); };
  ASSERT_GT(worst(solve(), tilt), 0.1);
  add(make_link_axis_cost(problem_.robot, "hand", Eigen::Vector3d::UnitZ(),
                          Eigen::Vector3d::UnitZ(), 0.002),
      Placement::kSupportAndInterpolated);
  const Trajectory trajectory = solve();
  EXPECT_LT(worst(trajectory, tilt), 0.01);
  EXPECT_LT((hand_at_end(trajectory).translation() - place_m_).norm(), 1e-3);
}

TEST_F(TaskCostSolves, PrefersAPostureWhereTheTaskLeavesIt) {
  add(make_link_position_cost(problem_.robot, "hand", place_m_, 1e-4), Placement::kGoal);
  Eigen::VectorXd preferred = problem_.start.q;
  preferred[5] = -1.0;
  Eigen::VectorXd sigmas = Eigen::VectorXd::Constant(7, std::numeric_limits<double>::infinity());
  sigmas[5] = 0.1;
  const Trajectory without = solve();
  add(make_posture_cost(problem_.robot->description(), preferred, sigmas), Placement::kSupport);
  const Trajectory with = solve();
  const int last = with.size() - 1;
  EXPECT_GT(std::abs(without.q(last)[5] + 1.0), 0.5);
  EXPECT_LT(std::abs(with.q(last)[5] + 1.0), 0.1);
  EXPECT_LT((hand_at_end(with).translation() - place_m_).norm(), 1e-3);
}

/// A ball of 0.1 m that is moved along x, y and z.
std::unique_ptr<KinematicTree> moved_ball() {
  RobotDescription robot;
  robot.name = "ball";
  std::vector<TreeJoint> joints;
  robot.links.push_back({"world", -1});
  joints.emplace_back().name = "world";
  for (int i = 0; i < 3; ++i) {
    const std::string name(1, "xyz"[i]);
    robot.joints.push_back({name, Joint::Type::kPrismatic, -3.0, 3.0, 2.0, 10.0});
    robot.links.push_back({"ball_" + name, i});
    TreeJoint& joint = joints.emplace_back();
    joint.name = name;
    joint.motion = TreeJoint::Motion::kTranslation;
    joint.axis = Eigen::Vector3d::Unit(i);
    joint.joint = i;
  }
  robot.spheres.push_back({3, Eigen::Vector3d::Zero(), 0.1});
  return std::move(*KinematicTree::create(std::move(robot), std::move(joints)));
}

TEST(AttachedObjectSolve, CarriesAnObjectOverAnObstacle) {
  Problem problem;
  problem.robot = moved_ball();
  problem.field = std::make_shared<conformance::BallField>(
      std::vector<conformance::Ball>{{{0.0, 0.02, -0.55}, 0.2}});
  problem.start = {Eigen::Vector3d(-1.0, 0.0, 0.0), Eigen::Vector3d::Zero()};
  problem.goal = {Eigen::Vector3d(1.0, 0.0, 0.0), Eigen::Vector3d::Zero()};
  problem.support_states = 15;
  problem.dt_s = 0.2;
  problem.qc = Eigen::Vector3d::Ones();
  problem.interpolated_checks = 3;
  const auto solve = [&] {
    problem.terms = standard_terms(problem, {.epsilon_m = 0.1});
    const auto solution = make_gp_chain({})->solve(problem, straight_line_of(problem), Deadline());
    EXPECT_TRUE(solution.has_value()) << solution.error().describe();
    return solution->trajectory;
  };
  const Trajectory alone = solve();
  EXPECT_GT(clearance_m(problem, alone), 0.0);

  AttachedObject load{.name = "load", .link = "ball_z"};
  load.spheres.push_back({{0.0, 0.0, -0.5}, 0.15});
  problem.robot = std::move(*attach_object(*problem.robot, load));
  EXPECT_LT(clearance_m(problem, alone), 0.0);
  EXPECT_GT(clearance_m(problem, solve()), 0.0);
}

}  // namespace
}  // namespace sidestep
