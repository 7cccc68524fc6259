#include <sidestep/planning/goal.hpp>

#include <limits>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <sidestep/planning/costs.hpp>

#include "support/chain_robot.hpp"

namespace sidestep {
namespace {

using testing::HasSubstr;

class Goal : public testing::Test {
 protected:
  Goal() {
    problem_.robot = testing_support::mobile_arm();
    q_ << 0.2, -0.1, 0.4, 0.1, -0.5, 0.8, 0.3;
    problem_.start = problem_.goal = {q_, Eigen::VectorXd::Zero(7)};
    std::vector<Transform> poses(problem_.robot->description().links.size());
    Scratch scratch;
    problem_.robot->link_poses(values(), poses, scratch);
    T_world_hand_ = poses.back();
  }
  [[nodiscard]] std::span<const double> values() const { return {q_.data(), 7}; }
  void add(Result<std::unique_ptr<StateCost>> cost) {
    ASSERT_TRUE(cost) << cost.error().describe();
    problem_.terms.push_back({std::move(*cost), Placement::kGoal});
  }

  Problem problem_;
  Eigen::VectorXd q_{7};
  Transform T_world_hand_;
};

TEST_F(Goal, IsAConfigurationUnlessCostsSayWhereTheRobotEnds) {
  EXPECT_FALSE(is_goal_free(problem_));
  problem_.terms = standard_terms(problem_, {});
  EXPECT_FALSE(is_goal_free(problem_));
  EXPECT_EQ(goal_miss(problem_, values()), "");
  q_[0] += 0.9e-3;
  EXPECT_EQ(goal_miss(problem_, values()), "");
  q_[5] -= 0.02;
  EXPECT_EQ(goal_miss(problem_, values()), "joint 'elbow' 0.02 rad off");
  q_[5] = std::numeric_limits<double>::quiet_NaN();
  EXPECT_THAT(goal_miss(problem_, values()), HasSubstr("joint 'elbow'"));
  problem_.terms = standard_terms(problem_, {.hold_goal = false});
  EXPECT_TRUE(is_goal_free(problem_));
  EXPECT_EQ(goal_miss(problem_, values()), "");
}

TEST_F(Goal, IsMetWholeTurnsAwayByWhatTurnsWithoutLimits) {
  q_[2] -= 4.0 * M_PI - 0.5e-3;
  EXPECT_EQ(goal_miss(problem_, values()), "");
  q_[2] += 0.01;
  EXPECT_THAT(goal_miss(problem_, values()), HasSubstr("joint 'theta' 0.0105 rad off"));
  q_ = problem_.goal.q;
  q_[5] += 2.0 * M_PI;
  EXPECT_THAT(goal_miss(problem_, values()), HasSubstr("joint 'elbow' 6.283 rad off"));
}

TEST_F(Goal, IsMissedByAPoseThreeStandardDeviationsOff) {
  Transform target = T_world_hand_;
  // 0.03 m in all, no component more than 0.02: within three times 0.0101, beyond three times
  // 0.0099.
  target.pretranslate(Eigen::Vector3d(0.01, 0.02, -0.02));
  add(make_link_pose_cost(problem_.robot, "hand", target, 0.0101, 0.01));
  EXPECT_TRUE(is_goal_free(problem_));
  EXPECT_EQ(goal_miss(problem_, values()), "");
  problem_.terms.clear();
  add(make_link_pose_cost(problem_.robot, "hand", target, 0.0099, 0.01));
  EXPECT_EQ(goal_miss(problem_, values()), "the position of hand 0.03 m off its target");
}

TEST_F(Goal, IsMissedByATurn) {
  Transform target = T_world_hand_;
  target.rotate(Eigen::AngleAxisd(0.25, Eigen::Vector3d(1.0, 1.0, 1.0).normalized()));
  add(make_link_pose_cost(problem_.robot, "hand", target, 0.01, 0.1));
  EXPECT_EQ(goal_miss(problem_, values()), "");
  add(make_link_orientation_cost(problem_.robot, "hand", target.linear(), 0.05));
  EXPECT_EQ(goal_miss(problem_, values()), "the orientation of hand 0.25 rad off its target");
}

TEST_F(Goal, IsMissedByATiltOrAPosture) {
  const Eigen::Vector3d axis =
      Eigen::AngleAxisd(0.3, T_world_hand_.linear().col(0)) * T_world_hand_.linear().col(2);
  add(make_link_axis_cost(problem_.robot, "hand", Eigen::Vector3d::UnitZ(), axis, 0.05));
  EXPECT_EQ(goal_miss(problem_, values()), "the axis of hand 0.3 rad off its direction");
  problem_.terms.clear();
  Eigen::VectorXd preferred = q_, sigmas = Eigen::VectorXd::Constant(7, 0.1);
  preferred[3] += 0.4;
  add(make_posture_cost(problem_.robot->description(), preferred, sigmas));
  EXPECT_EQ(goal_miss(problem_, values()), "the lift 0.4 m off its preferred position");
}

/// A cost that says no more of its residuals than what they are.
struct Nameless final : StateCost {
  [[nodiscard]] std::string_view name() const noexcept override { return "nameless"; }
  [[nodiscard]] int residual_count() const noexcept override { return 2; }
  [[nodiscard]] bool depends_on_velocity() const noexcept override { return false; }
  void evaluate(const StateBatch& states, const CostBatch& out, Scratch&) const override {
    for (int i = 0; i < states.count; ++i) {
      out.residuals[2 * static_cast<std::size_t>(i)] = 2.9;
      out.residuals[2 * static_cast<std::size_t>(i) + 1] = -3.5;
    }
  }
};

TEST_F(Goal, IsMissedByAnyResidualOfACostThatNamesNone) {
  problem_.terms.push_back({std::make_shared<Nameless>(), Placement::kGoal});
  EXPECT_EQ(goal_miss(problem_, values()), "row 2 of 2 of 'nameless' 3.5 sigma off");
  problem_.terms.front().placement = Placement::kSupport;
  EXPECT_EQ(goal_miss(problem_, values()), "");
}

}  // namespace
}  // namespace sidestep
