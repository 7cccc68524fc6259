#include <sidestep/planning/explain.hpp>

#include <cmath>
#include <numeric>

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <sidestep/planning/costs.hpp>

#include "conformance/analytic_models.hpp"
#include "support/ball_robot.hpp"

namespace sidestep {
namespace {

using namespace conformance;
using testing::HasSubstr;
using testing_support::BallRobot;

const SpacePolicy kSpace{Space::kFree, Space::kOccupied};
constexpr double kRadius_m = 0.2;
constexpr double kDt_s = 0.5;

/// A ball that goes along x from -2 to 2 m at 1 m/s, in nine states.
Problem along_x(std::vector<Ball> obstacles) {
  Problem problem;
  problem.robot = std::make_shared<BallRobot>(kRadius_m);
  problem.field = std::make_shared<BallField>(std::move(obstacles));
  problem.space = kSpace;
  problem.start = {Eigen::Vector3d(-2, 0, 0), Eigen::Vector3d(1, 0, 0)};
  problem.goal = {Eigen::Vector3d(2, 0, 0), Eigen::Vector3d(1, 0, 0)};
  problem.support_states = 9;
  problem.dt_s = kDt_s;
  problem.qc = Eigen::Vector3d::Ones();
  problem.interpolated_checks = 4;  // every 0.1 s, that is 0.1 m
  return problem;
}

Trajectory straight(const Problem& problem) {
  return straight_line(problem.start, problem.goal, problem.support_states, problem.dt_s);
}

Explanation explained(const Problem& problem, const Trajectory& trajectory) {
  auto explanation = explain(problem, trajectory);
  EXPECT_TRUE(explanation) << explanation.error().describe();
  return explanation.value_or(Explanation{});
}

CostTerm everywhere(std::unique_ptr<StateCost> cost) {
  return {std::move(cost), Placement::kSupportAndInterpolated};
}

TEST(Explain, NamesTheLinkTheObstacleAndTheStates) {
  // At the origin the ball's centre is 0.25 m below that of an obstacle of radius 0.1 m.
  Problem problem = along_x({{{0.0, 0.0, 0.25}, 0.1}});
  problem.terms = {
      everywhere(make_obstacle_cost(problem.robot, problem.field, kSpace, 0.05, 0.01))};
  const Explanation told = explained(problem, straight(problem));
  ASSERT_EQ(told.hindrances.size(), 1u);
  const Hindrance& held = told.hindrances.front();
  EXPECT_EQ(held.kind, Hindrance::Kind::kCollision);
  EXPECT_EQ(held.term, "obstacle");
  EXPECT_EQ(held.subject, "ball");
  EXPECT_EQ(held.other, "an obstacle");
  EXPECT_TRUE(held.broken);
  EXPECT_NEAR(held.amount, 0.2 - (0.25 - 0.1), 1e-9);
  EXPECT_NEAR(held.worst_s, 2.0, 1e-9);
  ASSERT_TRUE(held.obstacle_m);
  EXPECT_NEAR((*held.obstacle_m - Eigen::Vector3d(0.0, 0.0, 0.15)).norm(), 0.0, 1e-9);
  // Felt while |(x, 0.25)| < 0.1 + 0.2 + 0.05: |x| < 0.245, at x of -0.2 to 0.2.
  EXPECT_NEAR(held.from_s, 1.8, 1e-9);
  EXPECT_NEAR(held.to_s, 2.2, 1e-9);
  EXPECT_EQ(held.first_state, 3);
  EXPECT_EQ(held.last_state, 5);
  double cost = 0.0;
  for (const double x : {-0.2, -0.1, 0.0, 0.1, 0.2}) {
    cost += 0.5 * std::pow((0.35 - std::hypot(x, 0.25)) / 0.01, 2);
  }
  EXPECT_NEAR(held.cost, cost, 1e-6 * cost);
  EXPECT_NEAR(held.share, 1.0, 1e-9);
  EXPECT_THAT(
      held.describe(),
      HasSubstr("ball is 0.05 m inside an obstacle at (0.00, 0.00, 0.15) m, at 2.00 s (from "
                "1.80 to 2.20 s, states 3 to 5)"));
}

TEST(Explain, NamesTheFloor) {
  // From 0.1 m above the floor to 0.06 m in it.
  Problem problem = along_x({});
  problem.space.floor = Floor{-0.5, {}};
  problem.start.q.z() = -0.2;
  problem.goal.q.z() = -0.36;
  problem.terms = {everywhere(make_floor_cost(problem.robot, *problem.space.floor, 0.05, 0.01))};
  const Explanation told = explained(problem, straight(problem));
  ASSERT_EQ(told.hindrances.size(), 1u);
  const Hindrance& held = told.hindrances.front();
  EXPECT_EQ(held.kind, Hindrance::Kind::kCollision);
  EXPECT_EQ(held.term, "floor");
  EXPECT_EQ(held.subject, "ball");
  EXPECT_TRUE(held.broken);
  EXPECT_NEAR(held.amount, 0.06, 1e-9);
  EXPECT_NEAR(held.worst_s, 4.0, 1e-9);
  ASSERT_TRUE(held.obstacle_m);
  EXPECT_NEAR((*held.obstacle_m - Eigen::Vector3d(2.0, 0.0, -0.5)).norm(), 0.0, 1e-9);
  EXPECT_EQ(held.what(), "ball is 0.06 m below the floor at (2.00, 0.00, -0.50) m");
  // A reading of 0.05 m is passed at 0.05 / 0.16 of the way, between 1.2 and 1.3 s.
  EXPECT_NEAR(held.from_s, 1.3, 1e-9);
}

TEST(Explain, TellsSeparateObstaclesApart) {
  Problem problem = along_x({{{-1.0, 0.0, 0.25}, 0.1}, {{1.0, 0.24, 0.0}, 0.1}});
  problem.terms = {
      everywhere(make_obstacle_cost(problem.robot, problem.field, kSpace, 0.05, 0.01))};
  const Explanation told = explained(problem, straight(problem));
  ASSERT_EQ(told.hindrances.size(), 2u);
  EXPECT_NEAR(told.hindrances[0].worst_s, 3.0, 1e-9) << "the deeper one";
  EXPECT_NEAR(told.hindrances[0].obstacle_m->y(), 0.14, 1e-9);
  EXPECT_NEAR(told.hindrances[1].worst_s, 1.0, 1e-9);
  EXPECT_NEAR(told.hindrances[1].obstacle_m->z(), 0.15, 1e-9);
  EXPECT_NEAR(told.hindrances[0].share + told.hindrances[1].share, 1.0, 1e-9);
}

TEST(Explain, TellsOfTheTwoWorstStretchesOnly) {
  Problem problem =
      along_x({{{-1.2, 0.0, 0.26}, 0.1}, {{0.0, 0.0, 0.25}, 0.1}, {{1.2, 0.0, 0.24}, 0.1}});
  problem.terms = {
      everywhere(make_obstacle_cost(problem.robot, problem.field, kSpace, 0.05, 0.01))};
  const Explanation told = explained(problem, straight(problem));
  ASSERT_EQ(told.hindrances.size(), 2u);
  EXPECT_NEAR(told.hindrances[0].worst_s, 3.2, 1e-9);
  EXPECT_NEAR(told.hindrances[1].worst_s, 2.0, 1e-9);
  EXPECT_LT(told.hindrances[0].share + told.hindrances[1].share, 1.0 - 1e-3);
}

TEST(Explain, DoesNotCallBrokenWhatIsMerelyNear) {
  Problem problem = along_x({{{0.0, 0.0, 0.4}, 0.1}});  // 0.1 m clear
  problem.terms = {everywhere(make_obstacle_cost(problem.robot, problem.field, kSpace, 0.2, 0.01))};
  const Explanation told = explained(problem, straight(problem));
  ASSERT_EQ(told.hindrances.size(), 1u);
  EXPECT_FALSE(told.hindrances[0].broken);
  EXPECT_NEAR(told.hindrances[0].amount, -0.1, 1e-9);
  EXPECT_THAT(told.hindrances[0].what(), HasSubstr("ball is 0.1 m from an obstacle at"));
}

TEST(Explain, PutsWhatIsBrokenBeforeWhatCostsMore) {
  Problem problem = along_x({{{0.0, 0.0, 0.4}, 0.1}});
  problem.terms = {
      everywhere(make_obstacle_cost(problem.robot, problem.field, kSpace, 0.2, 0.001)),
      everywhere(make_velocity_limit_cost(problem.robot, 0.9, 10.0))};  // 1 m/s, 0.9 allowed
  problem.speed_fraction = 0.9;
  const Explanation told = explained(problem, straight(problem));
  ASSERT_EQ(told.hindrances.size(), 2u);
  EXPECT_LT(told.hindrances[0].cost, told.hindrances[1].cost);
  EXPECT_EQ(told.hindrances[0].term, "velocity_limit");
  EXPECT_EQ(told.hindrances[0].subject, "x");
  EXPECT_NEAR(told.hindrances[0].amount, 0.1, 1e-9);
  EXPECT_EQ(told.hindrances[0].unit, "m/s");
  EXPECT_EQ(told.hindrances[0].first_state, 0);
  EXPECT_EQ(told.hindrances[0].last_state, 8);
}

TEST(Explain, TellsOfSpaceOutsideTheMapAndNeverSeen) {
  Problem problem = along_x({});
  problem.field = std::make_shared<BallField>(std::vector<Ball>{{{0, 0, 7}, 0.1}}, 1.5);
  problem.terms = {
      everywhere(make_obstacle_cost(problem.robot, problem.field, kSpace, 0.01, 0.01))};
  const Explanation told = explained(problem, straight(problem));
  ASSERT_EQ(told.hindrances.size(), 2u);  // where it starts and where it ends
  EXPECT_EQ(told.hindrances[0].other, "the space outside the map");
  EXPECT_NEAR(told.hindrances[0].amount, 0.5 + kRadius_m, 0.05);  // up to half a voxel
  problem.field = std::make_shared<BallField>(std::vector<Ball>{{{0, 0, 7}, 0.1}}, 4.0, -1.0);
  problem.space = {Space::kOccupied, Space::kOccupied};
  problem.terms = {
      everywhere(make_obstacle_cost(problem.robot, problem.field, problem.space, 0.01, 0.01))};
  EXPECT_EQ(explained(problem, straight(problem)).hindrances.at(0).other, "unknown space");
}

TEST(Explain, NamesTheJointBeyondItsLimitAndOffTheGoal) {
  Problem problem = along_x({});
  problem.goal.q.x() = 10.5;  // the joint ends at 10
  Trajectory trajectory = straight(problem);
  problem.goal.q.x() = 10.0;
  problem.terms = {everywhere(make_position_limit_cost(problem.robot, 0.01, 0.01)),
                   {make_state_prior("goal", problem.goal, 1e-4), Placement::kGoal}};
  const Explanation told = explained(problem, trajectory);
  ASSERT_GE(told.hindrances.size(), 2u);
  EXPECT_EQ(told.hindrances[0].what(), "x is 0.5 m beyond its upper limit of 10 m");
  EXPECT_TRUE(told.hindrances[0].broken);
  EXPECT_NEAR(told.hindrances[0].worst_s, 4.0, 1e-9);
  EXPECT_EQ(told.hindrances[1].kind, Hindrance::Kind::kEndpoint);
  EXPECT_EQ(told.hindrances[1].what(), "x is 0.5 m off the goal");
  EXPECT_EQ(told.hindrances[1].first_state, 8);
  EXPECT_EQ(told.hindrances[1].last_state, 8);
}

TEST(Explain, NamesTheLinksThatMeet) {
  Problem problem;
  problem.robot = std::make_shared<PlanarRobot>(PlanarRobot::Shape{3, false});
  // The third link is turned back onto the first, at an angle of 10 degrees and none.
  const double close = M_PI - 10.0 * M_PI / 180.0;
  problem.start = {Eigen::Vector3d(0, 0, 0), Eigen::Vector3d::Zero()};
  problem.goal = {Eigen::Vector3d(0, close / 2, close), Eigen::Vector3d::Zero()};
  problem.support_states = 5;
  problem.dt_s = kDt_s;
  problem.qc = Eigen::Vector3d::Ones();
  problem.terms = {{make_self_collision_cost(problem.robot, 0.02, 0.001), Placement::kSupport}};
  const Trajectory trajectory = straight(problem);
  const Explanation told = explained(problem, trajectory);
  ASSERT_GE(told.hindrances.size(), 1u);
  const Hindrance& held = told.hindrances.front();
  EXPECT_EQ(held.kind, Hindrance::Kind::kSelfCollision);
  EXPECT_EQ(held.subject, "link_3");
  EXPECT_EQ(held.other, "link_1");
  EXPECT_EQ(held.last_state, 4);
  Scratch scratch;
  std::vector<Eigen::Vector3d> centres_m(9);
  problem.robot->sphere_centres(trajectory.q(4), centres_m, scratch);
  double closest_m = 1e9;
  for (int a = 0; a < 3; ++a) {
    for (int b = 6; b < 9; ++b) {
      closest_m = std::min(
          closest_m,
          (centres_m[static_cast<std::size_t>(a)] - centres_m[static_cast<std::size_t>(b)]).norm());
    }
  }
  EXPECT_NEAR(held.amount, 0.12 - closest_m, 1e-9);
  EXPECT_GT(held.amount, 0.0);
}

/// A cost of somebody else: |q_x - 1| as one of two rows.
class OwnCost final : public StateCost {
 public:
  [[nodiscard]] std::string_view name() const noexcept override { return "own"; }
  [[nodiscard]] int residual_count() const noexcept override { return 2; }
  [[nodiscard]] bool depends_on_velocity() const noexcept override { return false; }
  void evaluate(const StateBatch& states, const CostBatch& out, Scratch&) const override {
    for (std::size_t i = 0; i < static_cast<std::size_t>(states.count); ++i) {
      out.residuals[2 * i] = 0.0;
      out.residuals[2 * i + 1] = states.q[3 * i] - 1.0;
    }
  }
};

TEST(Explain, KnowsCostsOfOthersByTheirRows) {
  Problem problem = along_x({});
  problem.terms = {{std::make_shared<OwnCost>(), Placement::kSupport}};
  const Explanation told = explained(problem, straight(problem));
  ASSERT_EQ(told.hindrances.size(), 2u) << "before and behind x = 1 m";
  EXPECT_EQ(told.hindrances[0].term, "own");
  EXPECT_EQ(told.hindrances[0].what(), "row 2 of 2 is 3 sigma off");
  EXPECT_EQ(told.hindrances[0].worst_s, 0.0);
}

TEST(Explain, NamesTheJointThatThePriorHolds) {
  Problem problem = along_x({});
  Trajectory trajectory = straight(problem);
  trajectory.qdot(4)[1] = 0.3;  // a velocity without a motion
  const Explanation told = explained(problem, trajectory);
  ASSERT_EQ(told.hindrances.size(), 1u);
  EXPECT_EQ(told.hindrances[0].term, "gp_prior");
  EXPECT_EQ(told.hindrances[0].subject, "y");
  // e^T Q^-1 e with e = (0, 0.3) before and (0.3 dt, 0.3) behind: 4/dt, and (12 - 12 + 4)/dt.
  EXPECT_NEAR(told.cost, 0.5 * (4.0 + 4.0) / kDt_s * 0.09, 1e-9);
}

TEST(Explain, HoldsNothingAgainstAFreeMotion) {
  Problem problem = along_x({{{0.0, 5.0, 0.0}, 0.1}});
  problem.terms = standard_terms(problem, {.epsilon_m = 0.1});
  const Explanation told = explained(problem, straight(problem));
  EXPECT_TRUE(told.hindrances.empty());
  EXPECT_NEAR(told.cost, 0.0, 1e-12);
}

TEST(Explain, TellsWhyAStartCannotBeUsed) {
  // Walled in: balls on every side, the nearest above.
  Problem problem =
      along_x({{{-2.0, 0.0, 0.25}, 0.1}, {{-2.3, 0.0, 0.0}, 0.05}, {{-1.7, 0.0, 0.0}, 0.05}});
  problem.terms = standard_terms(problem, {.epsilon_m = 0.1});
  const std::vector<double> q{-2.0, 0.0, 0.0};
  const auto told = explain_state(problem, q);
  ASSERT_TRUE(told);
  ASSERT_EQ(told->hindrances.size(), 1u);
  EXPECT_EQ(told->hindrances[0].what(),
            "ball is 0.05 m inside an obstacle at (-2.00, 0.00, 0.15) m");
}

TEST(Explain, RefusesWhatIsNotOfTheProblem) {
  const Problem problem = along_x({});
  EXPECT_FALSE(explain(problem, make_trajectory(2, 4, 0.5)));
  Trajectory broken = straight(problem);
  broken.positions[3] = std::nan("");
  EXPECT_FALSE(explain(problem, broken));
  EXPECT_FALSE(explain({}, straight(problem)));
  EXPECT_FALSE(explain_state(problem, std::vector<double>(2)));
}

}  // namespace
}  // namespace sidestep
