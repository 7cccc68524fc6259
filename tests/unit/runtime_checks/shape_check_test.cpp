#include <gtest/gtest.h>

#include <sidestep/runtime/shape_check.hpp>

#include "support/chain_robot.hpp"
#include "support/limit_checks.hpp"

namespace sidestep {
namespace {

using testing_support::ChainRobot;
using testing_support::flying_ball;
using testing_support::mobile_arm;
using testing_support::rest_to_rest;

Transform at_point(double x, double y, double z) {
  return Transform(Eigen::Translation3d(x, y, z));
}

class ShapeCheckTest : public testing::Test {
 protected:
  std::shared_ptr<ChainRobot> robot_ = flying_ball(0.1);
  ShapeObstacles obstacles_;
  ShapeCheckSettings settings_;

  void add_object(SceneObject object) {
    objects_.push_back(std::move(object));
    obstacles_.scene = std::make_shared<Scene>(objects_);
  }
  [[nodiscard]] Verdict check(const Trajectory& trajectory, double from_s = 0.0) const {
    auto its = make_shape_check(robot_, obstacles_, settings_);
    EXPECT_TRUE(its) << its.error().describe();
    auto verdict = (*its)->check(trajectory, from_s, Deadline());
    EXPECT_TRUE(verdict) << verdict.error().describe();
    return verdict.value();
  }
  [[nodiscard]] testing_support::CheckOfLimits limits() {
    return {robot_->description(), settings_.speed_fraction, settings_.acceleration_fraction, false,
            [this](const Trajectory& trajectory) { return check(trajectory); }};
  }
  [[nodiscard]] std::string refusal() const {
    auto its = make_shape_check(robot_, obstacles_, settings_);
    return its ? std::string() : its.error().describe();
  }

 private:
  std::vector<SceneObject> objects_;
};

TEST_F(ShapeCheckTest, MeasuresTheClearanceOfABallThatPassesAVoxel) {
  obstacles_.resolution_m = 0.2;
  obstacles_.occupied_centres_m = {{0.0, 0.0, 0.0}};
  const Verdict verdict =
      check(rest_to_rest(Eigen::Vector3d(-1, 0.25, 0), Eigen::Vector3d(1, 0.25, 0), 4.0));
  EXPECT_TRUE(verdict.valid()) << verdict.describe();
  EXPECT_NEAR(verdict.min_clearance_m, 0.05, 1e-6);
  EXPECT_EQ(verdict.min_clearance_link, "ball");
  EXPECT_NEAR(verdict.min_clearance_time_s, 2.0, 0.5);
  EXPECT_EQ(verdict.unknown_share, 0.0);
}

TEST_F(ShapeCheckTest, FindsTheDepthAndTheTimeOfACollision) {
  obstacles_.resolution_m = 0.2;
  obstacles_.occupied_centres_m = {{0.0, 0.0, 0.0}};
  const Verdict verdict =
      check(rest_to_rest(Eigen::Vector3d(-1, 0.19, 0), Eigen::Vector3d(1, 0.19, 0), 4.0));
  EXPECT_EQ(verdict.outcome, Verdict::Outcome::kInvalid);
  ASSERT_EQ(verdict.violations.size(), 1u);
  const Violation& violation = verdict.violations[0];
  EXPECT_EQ(violation.kind, Violation::Kind::kCollision);
  EXPECT_EQ(violation.subject, "ball");
  EXPECT_NEAR(violation.amount, 0.01, 1e-4);
  EXPECT_NEAR(verdict.min_clearance_m, -0.01, 1e-4);
  EXPECT_NEAR(violation.time_s, 2.0, 0.3);
  EXPECT_NE(violation.describe().find("inside occupied voxels"), std::string::npos);
}

TEST_F(ShapeCheckTest, NeverStepsOverAThinObstacle) {
  obstacles_.resolution_m = 0.002;  // a needle, far thinner than a step
  obstacles_.occupied_centres_m = {{0.013, 0.0, 0.0}};
  robot_ = flying_ball(0.003);
  settings_.max_step_m = 0.02;
  const Verdict verdict =
      check(rest_to_rest(Eigen::Vector3d(-1, 0, 0), Eigen::Vector3d(1, 0, 0), 2.0));
  EXPECT_EQ(verdict.outcome, Verdict::Outcome::kInvalid) << verdict.describe();
}

TEST_F(ShapeCheckTest, CallsAGrazingPassUnknown) {
  obstacles_.resolution_m = 0.2;
  obstacles_.occupied_centres_m = {{0.0, 0.0, 0.0}};
  const Verdict verdict = check(
      rest_to_rest(Eigen::Vector3d(-1, 0.2 + 1e-5, 0), Eigen::Vector3d(1, 0.2 + 1e-5, 0), 4.0));
  EXPECT_EQ(verdict.outcome, Verdict::Outcome::kUnproven) << verdict.describe();
  ASSERT_FALSE(verdict.violations.empty());
  EXPECT_EQ(verdict.violations[0].kind, Violation::Kind::kUnproven);
}

TEST_F(ShapeCheckTest, MeetsAMovingObjectWhenItIsThere) {
  // A wall that sweeps along x at 0.5 m/s from x = -2 at scene time 0; the ball stands still.
  add_object(
      {"cart", Box{{0.2, 1.0, 1.0}}, {{0.0, at_point(-2, 0, 0)}, {8.0, at_point(2, 0, 0)}}, false});
  const Eigen::Vector3d here(0.0, 0.0, 0.0);
  // Touches when the wall's face (x + 0.1) reaches the ball's side (-0.1): x = -0.2, t = 3.6.
  EXPECT_TRUE(check(rest_to_rest(here, here, 3.59)).valid());
  const Verdict hit = check(rest_to_rest(here, here, 3.7));
  ASSERT_EQ(hit.outcome, Verdict::Outcome::kInvalid) << hit.describe();
  EXPECT_EQ(hit.violations[0].other, "cart");
  EXPECT_GE(hit.violations[0].time_s, 3.6);
  EXPECT_NEAR(hit.violations[0].amount, 0.05, 1e-3);  // at 3.7 s the wall is 5 cm farther
  obstacles_.scene_time_s = 5.0;                      // the wall has gone by: its back is at 0.4
  EXPECT_TRUE(check(rest_to_rest(here, here, 3.0)).valid());
  EXPECT_NEAR(check(rest_to_rest(here, here, 3.0)).min_clearance_m, 0.3, 1e-6);
}

TEST_F(ShapeCheckTest, StandsOnTheFloorOnlyWhereThatIsAllowed) {
  add_object({"floor", HalfSpace{}, {{0.0, at_point(0, 0, 0)}}, false});
  add_object({"shelf", Box{{0.2, 0.2, 0.2}}, {{0.0, at_point(0, 1, 0.5)}}, false});
  const Trajectory roll =
      rest_to_rest(Eigen::Vector3d(-1, 0, 0.099), Eigen::Vector3d(1, 0, 0.099), 3.0);
  const Verdict forbidden = check(roll);
  ASSERT_EQ(forbidden.outcome, Verdict::Outcome::kInvalid);
  EXPECT_EQ(forbidden.violations[0].other, "floor");
  EXPECT_NEAR(forbidden.violations[0].amount, 0.001, 1e-9);
  settings_.allowed_contacts = {{"ball", "floor"}};
  settings_.farthest_m = 2.0;
  const Verdict allowed = check(roll);
  EXPECT_TRUE(allowed.valid()) << allowed.describe();
  // The nearest point of the shelf is its lower edge at y = 0.9, z = 0.4.
  EXPECT_NEAR(allowed.min_clearance_m, std::hypot(0.9, 0.4 - 0.099) - 0.1, 1e-4);
}

TEST_F(ShapeCheckTest, CountsWhatIsFarAsFar) {
  obstacles_.resolution_m = 0.1;
  obstacles_.occupied_centres_m = {{2.5, 2.5, 2.5}};
  const Verdict verdict =
      check(rest_to_rest(Eigen::Vector3d(-1, 0, 0), Eigen::Vector3d(0, 0, 0), 2.0));
  EXPECT_TRUE(verdict.valid());
  EXPECT_EQ(verdict.min_clearance_m, settings_.farthest_m);
  EXPECT_EQ(verdict.min_clearance_link, "");
  EXPECT_TRUE(verdict.clearance_is_bound);
  EXPECT_EQ(verdict.describe(), "valid, at least 0.500 m clear");
  obstacles_.occupied_centres_m = {{-1.0, 0.45, 0.0}};
  EXPECT_FALSE(check(rest_to_rest(Eigen::Vector3d(-1, 0, 0), Eigen::Vector3d(0, 0, 0), 2.0))
                   .clearance_is_bound);
}

TEST_F(ShapeCheckTest, KnowsTheFloorButNotForWhatStandsOnIt) {
  obstacles_.floor = Floor{-0.2, {}};
  const auto at_height = [&](double z_m) {
    return check(rest_to_rest(Eigen::Vector3d(-1, 0, z_m), Eigen::Vector3d(1, 0, z_m), 3.0));
  };
  const Verdict above = at_height(0.0);
  EXPECT_TRUE(above.valid()) << above.describe();
  EXPECT_NEAR(above.min_clearance_m, 0.1, 1e-9);
  EXPECT_FALSE(above.clearance_is_bound);
  const Verdict below = at_height(-0.13);
  ASSERT_EQ(below.outcome, Verdict::Outcome::kInvalid);
  EXPECT_EQ(below.violations[0].what(), "ball is 0.030 m below the floor");
  obstacles_.floor->except_links = {"ball"};
  EXPECT_TRUE(at_height(-0.13).valid());
}

TEST_F(ShapeCheckTest, ChecksOnlyFromTheGivenTimeOn) {
  obstacles_.resolution_m = 0.2;
  obstacles_.occupied_centres_m = {{0.0, 0.0, 0.0}};
  const Trajectory through = rest_to_rest(Eigen::Vector3d(-1, 0, 0), Eigen::Vector3d(1, 0, 0), 4.0);
  EXPECT_FALSE(check(through, 0.0).valid());
  EXPECT_FALSE(check(through, 2.0).valid());
  EXPECT_TRUE(check(through, 2.6).valid());
  EXPECT_TRUE(check(through, 4.0).valid());
  EXPECT_TRUE(check(through, 99.0).valid());
}

TEST_F(ShapeCheckTest, SeesLimitsBetweenSupportStates) {
  testing_support::expect_limits_between_support_states(limits());
}

TEST_F(ShapeCheckTest, SeesAccelerationsBeyondTheirLimitsWhereAsked) {
  testing_support::expect_acceleration_limits_where_asked(limits());
}

TEST_F(ShapeCheckTest, SeesSelfCollisionOfShapes) {
  robot_ = mobile_arm();
  RobotDescription& d = robot_->description();
  d.shapes = {{4, Cylinder{0.25, 0.4}, Transform::Identity()},
              {7, Box{{0.05, 0.1, 0.1}}, at_point(0.0, 0.0, 0.05)}};
  Eigen::VectorXd folded(7);
  folded << 0, 0, 0, 0.2, -2.4, 2.2, 0;
  Eigen::VectorXd stretched = folded;
  stretched[4] = -0.2;
  stretched[5] = 0.3;
  const Verdict free = check(rest_to_rest(stretched, stretched, 1.0));
  EXPECT_TRUE(free.valid()) << free.describe();
  // The hand's box against the mast's cylinder, from the robot's own kinematics.
  std::vector<Transform> poses(d.links.size());
  Scratch scratch;
  bool is_hit = false;
  for (int k = 0; k <= 1000; ++k) {
    const Eigen::VectorXd q = stretched + (folded - stretched) * k / 1000.0;
    robot_->link_poses({q.data(), 7}, poses, scratch);
    for (int c = 0; c < 27; ++c) {
      const Eigen::Vector3d p(0.025 * (c % 3 - 1), 0.05 * (c / 3 % 3 - 1),
                              0.05 + 0.05 * (c / 9 - 1));
      const Eigen::Vector3d in_mast = poses[4].inverse() * (poses[7] * p);
      is_hit |= signed_distance_m(Cylinder{0.25, 0.4}, in_mast) < 0.0;
    }
  }
  const Verdict verdict = check(rest_to_rest(stretched, folded, 3.0));
  EXPECT_EQ(verdict.outcome == Verdict::Outcome::kInvalid, is_hit) << verdict.describe();
  ASSERT_TRUE(is_hit);
  EXPECT_EQ(verdict.violations[0].kind, Violation::Kind::kSelfCollision);
  EXPECT_EQ(verdict.violations[0].subject, "hand");
  EXPECT_EQ(verdict.violations[0].other, "mast");
  EXPECT_LT(verdict.min_self_clearance_m, 0.0);
}

TEST_F(ShapeCheckTest, TakesTrajectoriesOfOneState) {
  obstacles_.resolution_m = 0.2;
  obstacles_.occupied_centres_m = {{0.0, 0.0, 0.0}};
  Trajectory one = make_trajectory(3, 2, 1.0);
  one.times_s.resize(1);
  one.positions.resize(3);
  one.velocities.resize(3);
  EXPECT_EQ(check(one).outcome, Verdict::Outcome::kInvalid);
  one.positions = {1.0, 0.0, 3.5};
  const Verdict beyond = check(one);
  ASSERT_EQ(beyond.violations.size(), 1u);
  EXPECT_EQ(beyond.violations[0].subject, "z");
  EXPECT_NEAR(beyond.violations[0].amount, 0.5, 1e-12);
}

TEST_F(ShapeCheckTest, RefusesWhatMakesNoSense) {
  const auto its = make_shape_check(robot_, obstacles_, settings_);
  ASSERT_TRUE(its);
  Trajectory broken = make_trajectory(3, 3, 0.5);
  broken.positions[4] = std::nan("");
  EXPECT_EQ((*its)->check(broken, 0.0, Deadline()).error().code, ErrorCode::kInvalidArgument);
  EXPECT_EQ((*its)->check(make_trajectory(2, 3, 0.5), 0.0, Deadline()).error().code,
            ErrorCode::kInvalidArgument);
  EXPECT_EQ((*its)->check(make_trajectory(3, 3, 0.5), std::nan(""), Deadline()).error().code,
            ErrorCode::kInvalidArgument);
  EXPECT_EQ((*its)->check(make_trajectory(3, 3, 0.5), 0.0, Deadline::after_s(0.0)).error().code,
            ErrorCode::kDeadlineExceeded);

  settings_.allowed_contacts = {{"bal", "floor"}};
  EXPECT_NE(refusal().find("\"bal\""), std::string::npos) << refusal();
  EXPECT_NE(refusal().find("did you mean 'ball'?"), std::string::npos) << refusal();
  settings_.allowed_contacts.clear();
  obstacles_.occupied_centres_m = {{0, 0, 0}};
  EXPECT_NE(refusal().find("no size"), std::string::npos) << refusal();
  obstacles_.occupied_centres_m.clear();
  robot_->description().shapes.clear();
  EXPECT_NE(refusal().find("no collision shapes"), std::string::npos) << refusal();
}

}  // namespace
}  // namespace sidestep
