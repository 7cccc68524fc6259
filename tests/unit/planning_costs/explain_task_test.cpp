#include <cmath>
#include <limits>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <sidestep/planning/costs.hpp>
#include <sidestep/planning/explain.hpp>

#include "support/chain_robot.hpp"

namespace sidestep {
namespace {

/// A mobile arm that stands still, next to where tasks want it to be.
class ExplainTask : public testing::Test {
 protected:
  ExplainTask() {
    problem_.robot = testing_support::mobile_arm();
    problem_.start = {Eigen::VectorXd::Zero(7), Eigen::VectorXd::Zero(7)};
    problem_.start.q << 0.2, -0.1, 0.4, 0.1, -0.5, 0.8, 0.3;
    problem_.goal = problem_.start;
    problem_.support_states = 5;
    problem_.dt_s = 0.5;
    problem_.qc = Eigen::VectorXd::Ones(7);
    problem_.interpolated_checks = 1;
    std::vector<Transform> poses(problem_.robot->description().links.size());
    Scratch scratch;
    problem_.robot->link_poses({problem_.start.q.data(), 7}, poses, scratch);
    T_world_hand_ = poses.back();
  }

  /// What the cost, by itself, holds against standing still, the worst first.
  std::vector<Hindrance> told(Result<std::unique_ptr<StateCost>> cost, Placement placement) {
    EXPECT_TRUE(cost) << cost.error().describe();
    problem_.terms = {{std::move(*cost), placement}};
    const auto explanation = explain(
        problem_,
        straight_line(problem_.start, problem_.goal, problem_.support_states, problem_.dt_s));
    EXPECT_TRUE(explanation) << explanation.error().describe();
    return explanation->hindrances;
  }

  Problem problem_;
  Transform T_world_hand_;
};

TEST_F(ExplainTask, NamesTheComponentOfAPositionThatIsOff) {
  Transform target = T_world_hand_;
  target.pretranslate(Eigen::Vector3d(0.005, 0.0, 0.032));
  const auto held =
      told(make_link_pose_cost(problem_.robot, "hand", target, 0.001, 0.01), Placement::kGoal);
  ASSERT_EQ(held.size(), 1u) << "no orientation is off";
  EXPECT_EQ(held[0].what(), "position of hand along z is 0.032 m off its target");
  EXPECT_EQ(held[0].term, "pose_hand");
  EXPECT_EQ(held[0].kind, Hindrance::Kind::kEndpoint);
  EXPECT_TRUE(held[0].broken);
  EXPECT_EQ(held[0].first_state, 4);
  EXPECT_NEAR(held[0].cost, 0.5 * (25.0 + 32.0 * 32.0), 1e-6);
}

TEST_F(ExplainTask, DoesNotCallAGoalMissedThatIsReached) {
  Transform target = T_world_hand_;
  target.pretranslate(Eigen::Vector3d(0.0, 0.0, 0.0025));
  const auto held =
      told(make_link_position_cost(problem_.robot, "hand", target.translation(), 0.001),
           Placement::kGoal);
  ASSERT_EQ(held.size(), 1u);
  EXPECT_FALSE(held[0].broken);
}

TEST_F(ExplainTask, NamesTheAxisAboutWhichALinkIsTurned) {
  Transform target = T_world_hand_;
  target.rotate(Eigen::AngleAxisd(-0.1, Eigen::Vector3d::UnitY()));
  const auto held = told(make_link_orientation_cost(problem_.robot, "hand", target.linear(), 0.02),
                         Placement::kSupportAndInterpolated);
  ASSERT_EQ(held.size(), 1u);
  EXPECT_EQ(held[0].what(), "orientation of hand about the target's y is 0.1 rad off its target");
  EXPECT_EQ(held[0].kind, Hindrance::Kind::kOther);
  EXPECT_FALSE(held[0].broken) << "a preference along the way";
}

TEST_F(ExplainTask, TellsHowFarAnAxisIsTilted) {
  // Tilted about a direction between the two that the residuals are along.
  const Eigen::Vector3d z = T_world_hand_.linear().col(2);
  const Eigen::Vector3d u = z.unitOrthogonal();
  const Eigen::Vector3d about = (u + z.cross(u)).normalized();
  const auto held = told(make_link_axis_cost(problem_.robot, "hand", Eigen::Vector3d::UnitZ(),
                                             Eigen::AngleAxisd(0.2, about) * z, 0.02),
                         Placement::kSupport);
  ASSERT_EQ(held.size(), 1u);
  EXPECT_EQ(held[0].what(), "axis of hand is 0.2 rad off its direction");
}

TEST_F(ExplainTask, NamesTheJointThatLeavesItsPosture) {
  Eigen::VectorXd preferred = problem_.start.q;
  preferred[3] -= 0.05;
  preferred[5] += 0.6;
  Eigen::VectorXd sigmas = Eigen::VectorXd::Constant(7, 0.2);
  sigmas[3] = std::numeric_limits<double>::infinity();
  const auto held = told(make_posture_cost(problem_.robot->description(), preferred, sigmas),
                         Placement::kSupport);
  ASSERT_EQ(held.size(), 1u);
  EXPECT_EQ(held[0].what(), "elbow is 0.6 rad off its preferred position");
}

TEST_F(ExplainTask, NamesTheJointThatDoesNotComeToRest) {
  problem_.terms = {
      {make_velocity_prior("goal_velocity", Eigen::VectorXd::Zero(7), 1e-3), Placement::kGoal}};
  Trajectory trajectory =
      straight_line(problem_.start, problem_.goal, problem_.support_states, problem_.dt_s);
  trajectory.qdot(4)[4] = 0.25;
  const auto explanation = explain(problem_, trajectory);
  ASSERT_TRUE(explanation) << explanation.error().describe();
  const Hindrance& held = explanation->hindrances.at(0);
  EXPECT_EQ(held.what(), "shoulder is 0.25 rad/s off the goal");
  EXPECT_TRUE(held.broken);
}

}  // namespace
}  // namespace sidestep
