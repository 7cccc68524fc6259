#include "tool_line.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <sidestep/planning/costs.hpp>
#include <sidestep/trajectory/motion_limits.hpp>
#include <sidestep/trajectory/retime.hpp>

#include "conformance/test_host.hpp"
#include "support/hsr.hpp"

namespace sidestep::tool_line {
namespace {

using ::testing::HasSubstr;

/// The Panda's hand, from where the arm is bent before it.
class ToolLines : public ::testing::Test {
 protected:
  void SetUp() override {
    problem_.robot = testing_support::load_profile("panda");
    problem_.space = {Space::kFree, Space::kFree};
    problem_.start = {Eigen::VectorXd::Zero(7), Eigen::VectorXd::Zero(7)};
    problem_.start.q << 0.1, -0.3, 0.05, -2.2, 0.0, 2.0, 0.8;
    problem_.goal = problem_.start;
    problem_.support_states = 10;
    problem_.dt_s = 0.5;
    problem_.qc = Eigen::VectorXd::Ones(7);
  }
  [[nodiscard]] Transform hand_at(std::span<const double> q) const {
    const RobotDescription& robot = problem_.robot->description();
    std::vector<Transform> poses(robot.links.size());
    Scratch scratch;
    problem_.robot->link_poses(q, poses, scratch);
    return poses[static_cast<std::size_t>(robot.link_index("panda_hand").value())];
  }
  [[nodiscard]] Transform hand_at_start() const { return hand_at({problem_.start.q.data(), 7}); }
  Solution solve(const Options& options = {}) {
    auto solution = make_tool_line(options, log_)->solve(problem_, {}, Deadline());
    EXPECT_TRUE(solution) << solution.error().describe();
    return solution ? std::move(*solution) : Solution{};
  }
  Solution solve_to(const Transform& target) {
    auto there = make_link_pose_cost(problem_.robot, "panda_hand", target, 1e-3, 5e-3);
    EXPECT_TRUE(there) << there.error().describe();
    problem_.terms = {{std::move(*there), Placement::kGoal}};
    return solve();
  }
  /// Along all of the motion, the hand's distance from the segment between two places, and its
  /// angle to where it should have turned by as much of the way.
  void expect_straight(const Trajectory& motion, const Transform& from, const Transform& to,
                       double most_m, double most_rad) const {
    const Eigen::Vector3d a = from.translation(), b = to.translation();
    const Eigen::Quaterniond turned_a(from.linear()), turned_b(to.linear());
    std::vector<double> q(7);
    for (int i = 0; i <= 3000; ++i) {
      motion.sample(motion.duration_s() * i / 3000.0, q, {});
      const Transform hand = hand_at(q);
      const double share =
          std::clamp((hand.translation() - a).dot(b - a) / (b - a).squaredNorm(), 0.0, 1.0);
      ASSERT_LE((hand.translation() - a - share * (b - a)).norm(), most_m) << "sample " << i;
      ASSERT_LE(Eigen::Quaterniond(hand.linear()).angularDistance(turned_a.slerp(share, turned_b)),
                most_rad)
          << "sample " << i;
    }
    motion.sample(motion.duration_s(), q, {});
    EXPECT_LE((hand_at(q).translation() - b).norm(), 1e-5);
  }

  Problem problem_;
  conformance::RecordingLog log_;
};

TEST_F(ToolLines, KeepTheHandOnItsLineAndTurnItEvenly) {
  const Transform from = hand_at_start();
  Transform to = from;
  to.translation() += Eigen::Vector3d(0.05, -0.3, -0.1);
  to.rotate(Eigen::AngleAxisd(0.7, Eigen::Vector3d(0.3, -0.5, 1.0).normalized()));
  const Solution solution = solve_to(to);
  ASSERT_EQ(solution.status, SolveStatus::kConverged) << solution.reason;
  expect_straight(solution.trajectory, from, to, 5e-4, 5e-3);
  EXPECT_EQ(solution.trajectory.q(0)[3], -2.2);

  // Timed by the limits it stays there, but for what retiming may deviate, and a joint's lever.
  const MotionLimits limits = motion_limits(problem_.robot->description(), {0.8, 0.9, 0.5});
  const auto timed = retime(solution.trajectory, limits, {.stop_at_goal = true});
  ASSERT_TRUE(timed) << timed.error().describe();
  expect_straight(timed->trajectory, from, to, 5e-4 + 3e-4, 5e-3 + 7e-4);
}

TEST_F(ToolLines, KeepTheOrientationThatIsLeftOpen) {
  const Transform from = hand_at_start();
  Transform to = from;
  to.translation() += Eigen::Vector3d(0.0, 0.0, -0.2);
  auto there = make_link_position_cost(problem_.robot, "panda_hand", to.translation(), 1e-3);
  ASSERT_TRUE(there);
  problem_.terms.push_back({std::move(*there), Placement::kGoal});
  const Solution solution = solve();
  ASSERT_EQ(solution.status, SolveStatus::kConverged) << solution.reason;
  expect_straight(solution.trajectory, from, to, 5e-4, 5e-3);
}

TEST_F(ToolLines, AreFollowedCloserWhereThatIsAskedFor) {
  const Transform from = hand_at_start();
  Transform to = from;
  to.translation() += Eigen::Vector3d(0.05, -0.25, -0.1);
  (void)solve_to(to);
  Options close{.step_m = 0.1, .step_rad = 1.0};
  const Solution coarse = solve(close);
  ASSERT_EQ(coarse.status, SolveStatus::kConverged) << coarse.reason;
  expect_straight(coarse.trajectory, from, to, 5e-4, 5e-3);
  close.deviation_m = 1e-6;
  close.deviation_rad = 1e-5;
  const Solution solution = solve(close);
  ASSERT_EQ(solution.status, SolveStatus::kConverged) << solution.reason;
  EXPECT_GT(solution.trajectory.size(), coarse.trajectory.size());
  expect_straight(solution.trajectory, from, to, 2e-6, 2e-5);
}

TEST_F(ToolLines, SayHowFarTheyLead) {
  Transform to = hand_at_start();
  to.translation() += Eigen::Vector3d(0.6, 0.0, 0.0);  // beyond the arm's reach
  const Solution solution = solve_to(to);
  EXPECT_EQ(solution.status, SolveStatus::kNoPath);
  EXPECT_EQ(solution.trajectory.size(), 0);
  EXPECT_THAT(solution.reason, HasSubstr("the link cannot follow its line beyond 0."));
  EXPECT_THAT(solution.reason, HasSubstr(" of 0.6 m: it ends with "));
}

TEST_F(ToolLines, LeadToOnePoseAlone) {
  const Transform from = hand_at_start();
  const auto is_refused = [&] {
    const Solution solution = solve();
    return solution.status == SolveStatus::kNoPath &&
           solution.reason.find("leads to one pose or position of it") != std::string::npos;
  };
  const auto place = [&] {
    return CostTerm{
        make_link_position_cost(problem_.robot, "panda_hand", from.translation(), 1e-3).value(),
        Placement::kGoal};
  };
  EXPECT_TRUE(is_refused());  // a goal configuration
  problem_.terms = {
      {make_link_axis_cost(problem_.robot, "panda_hand", {0, 0, 1}, {0, 0, -1}, 0.01).value(),
       Placement::kGoal}};
  EXPECT_TRUE(is_refused());
  problem_.terms = {place(), place()};
  EXPECT_TRUE(is_refused());
  problem_.terms = {
      {make_link_pose_cost(problem_.robot, "panda_hand", from, 1e-3, 5e-3, {.alternatives = {from}})
           .value(),
       Placement::kGoal}};
  EXPECT_TRUE(is_refused());
  problem_.terms = {place()};
  EXPECT_FALSE(is_refused());
}

/// A gripper that turns by most of a turn, about a joint that has no limits, half a turn and more
/// away from where it started.
TEST_F(ToolLines, FollowJointsThatTurnWithoutLimits) {
  problem_.robot = testing_support::load_profile("fetch");
  const RobotDescription& robot = problem_.robot->description();
  const NamedPose* ready = robot.find_pose("reach_table");
  ASSERT_NE(ready, nullptr);
  problem_.start = {Eigen::VectorXd::Zero(8), Eigen::VectorXd::Zero(8)};
  for (int j = 0; j < 8; ++j) {
    problem_.start.q[j] = ready->positions[static_cast<std::size_t>(j)].value_or(0.0);
  }
  problem_.goal = problem_.start;
  problem_.qc = Eigen::VectorXd::Ones(8);
  const auto gripper = static_cast<std::size_t>(robot.link_index("gripper_link").value());
  const auto wrist = static_cast<Eigen::Index>(robot.joint_index("wrist_roll_joint").value());
  for (int turn = 0; turn < 2; ++turn) {
    std::vector<Transform> poses(robot.links.size());
    Scratch scratch;
    problem_.robot->link_poses({problem_.start.q.data(), 8}, poses, scratch);
    Transform to = poses[gripper];
    to.rotate(Eigen::AngleAxisd(0.98 * M_PI, Eigen::Vector3d::UnitX()));
    auto there = make_link_pose_cost(problem_.robot, "gripper_link", to, 1e-3, 5e-3);
    ASSERT_TRUE(there);
    problem_.terms = {{std::move(*there), Placement::kGoal}};
    const Solution solution = solve();
    ASSERT_EQ(solution.status, SolveStatus::kConverged) << solution.reason;
    const auto end = solution.trajectory.q(solution.trajectory.size() - 1);
    EXPECT_GT(std::abs(end[static_cast<std::size_t>(wrist)] - problem_.start.q[wrist]), 2.5);
    std::ranges::copy(end, problem_.start.q.begin());
  }
}

TEST_F(ToolLines, StopAtTheDeadline) {
  Transform to = hand_at_start();
  to.translation().z() -= 0.2;
  auto there = make_link_pose_cost(problem_.robot, "panda_hand", to, 1e-3, 5e-3);
  ASSERT_TRUE(there);
  problem_.terms = {{std::move(*there), Placement::kGoal}};
  const auto solution = make_tool_line({}, log_)->solve(problem_, {}, Deadline::after_s(0.0));
  ASSERT_TRUE(solution);
  EXPECT_EQ(solution->status, SolveStatus::kDeadline);
  EXPECT_THAT(solution->reason, HasSubstr("the deadline passed beyond 0"));
}

}  // namespace
}  // namespace sidestep::tool_line
