#include <gtest/gtest.h>

#include <sidestep/planning/validity_check.hpp>
#include <sidestep/robot/kinematic_tree.hpp>

#include "cubic_motion.hpp"
#include "field_check_testing.hpp"
#include "support/chain_robot.hpp"
#include "support/limit_checks.hpp"
#include "support/voxel_field.hpp"

namespace sidestep {
namespace {

using testing_support::Aabb;
using testing_support::ChainRobot;
using testing_support::flying_ball;
using testing_support::mobile_arm;
using testing_support::rest_to_rest;
using testing_support::VoxelWorld;

TEST_F(FieldCheckTest, MeasuresTheClearance) {
  // Parallel to the wall's end face (centres at y = 0.45) at y = 0.95: 0.5 - 0.1 clear.
  const Verdict verdict =
      check(rest_to_rest(Eigen::Vector3d(-1, 0.95, 0.05), Eigen::Vector3d(1, 0.95, 0.05), 2.0));
  EXPECT_TRUE(verdict.valid()) << verdict.describe();
  EXPECT_NEAR(verdict.min_clearance_m, 0.4, 1e-3);
  EXPECT_EQ(verdict.min_clearance_link, "ball");
  EXPECT_NEAR(verdict.min_clearance_time_s, 1.0, 0.1);
  EXPECT_EQ(verdict.unknown_share, 0.0);
  EXPECT_EQ(verdict.min_self_clearance_m, std::numeric_limits<double>::infinity());
}

TEST_F(FieldCheckTest, NamesLinkDepthAndTime) {
  const Verdict verdict =
      check(rest_to_rest(Eigen::Vector3d(-1, 0, 0), Eigen::Vector3d(1, 0, 0), 2.0));
  EXPECT_EQ(verdict.outcome, Verdict::Outcome::kInvalid);
  ASSERT_EQ(verdict.violations.size(), 1u);
  EXPECT_EQ(verdict.violations[0].kind, Violation::Kind::kCollision);
  EXPECT_EQ(verdict.violations[0].subject, "ball");
  EXPECT_EQ(verdict.violations[0].other, "an obstacle");
  EXPECT_NEAR(verdict.violations[0].amount, 0.1, 1e-6);  // the distance inside is 0
  EXPECT_NEAR(verdict.violations[0].time_s, 1.0, 0.1);
}

/// A foot of 0.15 m at the origin, which stands, and a hand that turns half a metre from it.
std::shared_ptr<const RobotModel> standing_arm() {
  RobotDescription robot;
  robot.name = "arm";
  robot.joints = {{"turn", Joint::Type::kRevolute, -3.0, 3.0, 1.0, 2.0}};
  robot.links = {{"foot", -1}, {"hand", 0}};
  robot.spheres = {{0, Eigen::Vector3d::Zero(), 0.15}, {1, {0.5, 0.0, 0.0}, 0.05}};
  std::vector<TreeJoint> joints{{"root"}, {"turn", TreeJoint::Motion::kRotation}};
  joints[1].axis = Eigen::Vector3d::UnitZ();
  joints[1].joint = 0;
  return std::move(*KinematicTree::create(std::move(robot), std::move(joints)));
}

TEST_F(FieldCheckTest, PassesOverWhatNoJointMoves) {
  const auto arm = standing_arm();
  EXPECT_EQ(fixed_spheres(*arm), (std::vector<bool>{true, false}));
  const auto outcome = [&](double from, double to) {
    const auto check = make_field_check(arm, world_.field(), space_, settings_);
    return check
        ->check(
            rest_to_rest(Eigen::VectorXd::Constant(1, from), Eigen::VectorXd::Constant(1, to), 4.0),
            0.0, Deadline())
        .value();
  };
  // The wall goes through the foot; the hand meets it at -pi / 2.
  EXPECT_EQ(outcome(0.0, 0.3).violations.at(0).subject, "foot");
  space_.counts_fixed = false;
  EXPECT_TRUE(outcome(0.0, 0.3).valid()) << outcome(0.0, 0.3).describe();
  EXPECT_EQ(outcome(0.0, -1.5).violations.at(0).subject, "hand");
}

TEST_F(FieldCheckTest, DemandsTheMargin) {
  const Trajectory pass =
      rest_to_rest(Eigen::Vector3d(-1, 0.65, 0.05), Eigen::Vector3d(1, 0.65, 0.05), 2.0);
  settings_.margin_m = 0.09;  // it keeps 0.1
  EXPECT_TRUE(check(pass).valid());
  settings_.margin_m = 0.12;
  const Verdict verdict = check(pass);
  ASSERT_EQ(verdict.outcome, Verdict::Outcome::kInvalid);
  EXPECT_EQ(verdict.violations[0].other, "the margin of an obstacle");
  EXPECT_NEAR(verdict.violations[0].amount, 0.02, 1e-3);
}

TEST_F(FieldCheckTest, CallsUnknownWhatItCannotShow) {
  // Exactly at the margin: no spacing of checks is short enough.
  settings_.margin_m = 0.1;
  const Verdict verdict =
      check(rest_to_rest(Eigen::Vector3d(-1, 0.65, 0.05), Eigen::Vector3d(1, 0.65, 0.05), 2.0));
  EXPECT_EQ(verdict.outcome, Verdict::Outcome::kUnproven) << verdict.describe();
  ASSERT_EQ(verdict.violations.size(), 1u);
  EXPECT_EQ(verdict.violations[0].kind, Violation::Kind::kUnproven);
  EXPECT_EQ(verdict.violations[0].subject, "ball");
}

TEST_F(FieldCheckTest, NeverStepsOverAThinWall) {
  world_ = {};
  world_.grid = {{-1.0, -1.0, -1.0}, 0.02, {100, 100, 100}};
  world_.occupied = {Aabb{{0.0, -0.02, -0.02}, {0.02, 0.02, 0.02}}};
  robot_ = flying_ball(0.002);
  settings_.max_step_m = 10.0;  // both ends only, to begin with
  const Verdict verdict =
      check(rest_to_rest(Eigen::Vector3d(-0.9, 0, 0), Eigen::Vector3d(0.9, 0, 0), 2.0));
  EXPECT_EQ(verdict.outcome, Verdict::Outcome::kInvalid);
}

TEST_F(FieldCheckTest, TellsTheLinkThatIsUnseenTheMost) {
  world_.unknown = {Aabb{{0.0, 1.3, -1.0}, {2.0, 2.0, 1.0}}};
  space_.unknown = Space::kFree;
  // A hand of one sphere, all the way where nobody looked, beside a body of nine.
  RobotDescription& robot = robot_->description();
  robot.spheres.assign(9, robot.spheres.front());
  robot.links.push_back({"hand", robot.spheres.front().link});
  robot_->steps().push_back({{0.0, 0.6, 0.0}});
  robot.spheres.push_back(
      {static_cast<int>(robot.links.size()) - 1, Eigen::Vector3d::Zero(), 0.05});
  const Verdict verdict =
      check(rest_to_rest(Eigen::Vector3d(0.3, 0.9, 0), Eigen::Vector3d(0.7, 0.9, 0), 2.0));
  EXPECT_LT(verdict.unknown_share, 0.2);
  EXPECT_EQ(verdict.most_unknown_share, 1.0);
  EXPECT_EQ(verdict.most_unknown_link, "hand");
}

TEST_F(FieldCheckTest, LeavesWhatNoJointMovesToStandWhereNobodyLooked) {
  world_.unknown = {Aabb{{0.0, 1.3, -1.0}, {2.0, 2.0, 1.0}}};
  space_.unknown = Space::kFree;
  RobotDescription& robot = robot_->description();
  robot.links.push_back({"foot", -1});
  robot_->steps().push_back({{0.5, 1.6, 0.0}});
  robot.spheres.push_back(
      {static_cast<int>(robot.links.size()) - 1, Eigen::Vector3d::Zero(), 0.05});
  const Verdict verdict =
      check(rest_to_rest(Eigen::Vector3d(0.3, 0.9, 0), Eigen::Vector3d(0.7, 0.9, 0), 2.0));
  EXPECT_GT(verdict.unknown_share, 0.0);
  EXPECT_EQ(verdict.most_unknown_share, 0.0);
  EXPECT_EQ(verdict.most_unknown_link, "");
}

/// From x = -1 to 1 in 2 s at y = 1, through what nobody has seen between x = 0.5 and 0.7.
class ObservedSpaceTest : public FieldCheckTest {
 protected:
  ObservedSpaceTest() {
    world_.unknown = {Aabb{{0.5, 0.5, -1.0}, {0.7, 1.5, 1.0}}};
    space_.unknown = Space::kFree;
    space_.observed = ObservedSpace{{"ball"}, {-1.0, 1.0}, 0.5};
  }
  const Trajectory through_ =
      rest_to_rest(Eigen::Vector3d(-1, 1, 0), Eigen::Vector3d(1, 1, 0), 2.0);
};

TEST_F(ObservedSpaceTest, IsKeptToByItsLinks) {
  const Verdict verdict = check(through_);
  ASSERT_EQ(verdict.outcome, Verdict::Outcome::kInvalid) << verdict.describe();
  EXPECT_EQ(verdict.violations[0].subject, "ball");
  EXPECT_EQ(verdict.violations[0].other, "unknown space");
  EXPECT_NEAR(verdict.violations[0].amount, 0.1, 1e-9);  // all of the ball, from its centre on
  // 3 s^2 - 2 s^3 of the way at the share s of the time: 0.75 of it at 1.35 s.
  EXPECT_NEAR(verdict.first_violation_s, 1.35, 0.06);
  space_.observed->links = {"another"};
  EXPECT_TRUE(check(through_).valid());
}

TEST_F(ObservedSpaceTest, IsWiderAroundTheStart) {
  // The voxels' centres lie 1.55 and 1.65 m from it.
  space_.observed->start_radius_m = 1.66;
  EXPECT_TRUE(check(through_).valid());
  space_.observed->start_radius_m = 1.6;
  EXPECT_FALSE(check(through_).valid());
  // Horizontally: height is none.
  space_.observed->start_radius_m = 1.66;
  EXPECT_TRUE(
      check(rest_to_rest(Eigen::Vector3d(-1, 1, 0.7), Eigen::Vector3d(1, 1, 0.7), 2.0)).valid());
}

TEST_F(ObservedSpaceTest, IsKeptToBetweenTheInstantsThatAreLookedAt) {
  // One layer of voxels, which a check of both ends alone steps over.
  world_.unknown = {Aabb{{0.0, 0.5, -1.0}, {0.1, 1.5, 1.0}}};
  settings_.max_step_m = 10.0;
  EXPECT_FALSE(check(through_).valid());
}

TEST_F(ObservedSpaceTest, IsKeptToForAWhile) {
  settings_.first_violation_only = true;
  settings_.observed_s = 0.5;
  EXPECT_TRUE(check(through_).valid());
  EXPECT_FALSE(check(through_, 1.0).valid());
  // Obstacles are there for ever.
  world_.occupied = {Aabb{{0.5, 0.5, -1.0}, {0.7, 1.5, 1.0}}};
  EXPECT_FALSE(check(through_).valid());
}

TEST_F(FieldCheckTest, FollowsThePolicyForUnknownSpaceAndOutside) {
  world_.unknown = {Aabb{{0.5, 0.9, -1.0}, {0.7, 1.1, 1.0}}};
  const Trajectory through =
      rest_to_rest(Eigen::Vector3d(0.05, 1, 0), Eigen::Vector3d(1.0, 1, 0), 2.0);
  const Verdict blocked = check(through);
  ASSERT_EQ(blocked.outcome, Verdict::Outcome::kInvalid);
  EXPECT_EQ(blocked.violations[0].other, "unknown space");
  EXPECT_GT(blocked.unknown_share, 0.1);
  EXPECT_LT(blocked.unknown_share, 0.4);
  space_.unknown = Space::kFree;
  EXPECT_TRUE(check(through).valid());
  EXPECT_EQ(check(through).unknown_share, blocked.unknown_share);

  const Trajectory out = rest_to_rest(Eigen::Vector3d(1, 1, 0), Eigen::Vector3d(2.5, 1, 0), 2.0);
  const Verdict left = check(out);
  ASSERT_EQ(left.outcome, Verdict::Outcome::kInvalid);
  EXPECT_EQ(left.violations[0].other, "the space outside the map");
  EXPECT_NEAR(left.violations[0].amount, 0.6, 1e-3);  // 0.5 outside, and its radius
  space_.outside = Space::kFree;
  EXPECT_TRUE(check(out).valid());
}

TEST_F(FieldCheckTest, CountsSpaceOutsideTheMapAsUnseen) {
  space_.outside = Space::kFree;
  // Rests at both ends: half of the checks, give or take those near the border, are outside.
  const Verdict half = check(rest_to_rest(Eigen::Vector3d(1, 1, 0), Eigen::Vector3d(3, 1, 0), 2.0));
  EXPECT_NEAR(half.unknown_share, 0.5, 0.1);
  const Verdict all =
      check(rest_to_rest(Eigen::Vector3d(40, 40, 0), Eigen::Vector3d(41, 40, 0), 2.0));
  EXPECT_EQ(all.unknown_share, 1.0);
}

TEST_F(FieldCheckTest, TellsAClearanceFromTheFieldsOwnLimit) {
  const Trajectory pass =
      rest_to_rest(Eigen::Vector3d(-1, 0.95, 0.05), Eigen::Vector3d(1, 0.95, 0.05), 2.0);
  EXPECT_FALSE(check(pass).clearance_is_bound);
  world_.max_distance_m = 0.3;  // the wall is at 0.5
  const Verdict bound = check(pass);
  EXPECT_TRUE(bound.clearance_is_bound);
  EXPECT_NEAR(bound.min_clearance_m, 0.3 - 0.1, 1e-6);
  EXPECT_EQ(bound.describe(), "valid, at least 0.200 m clear");
  space_.floor = Floor{0.05 - 0.1 - 0.15, {}};  // 0.15 m below the ball: that is known
  const Verdict above_floor = check(pass);
  EXPECT_FALSE(above_floor.clearance_is_bound);
  EXPECT_NEAR(above_floor.min_clearance_m, 0.15, 1e-12);
}

/// Goes down and up again between its two states; its lowest centre is at z = `low_m`.
Trajectory dip(const Eigen::Vector3d& from, double low_m) {
  Trajectory trajectory = rest_to_rest(from, from, 1.0);
  // z(t) = z0 - v t (1 - t), lowest at t = 1/2.
  trajectory.qdot(0)[2] = -4.0 * (from.z() - low_m);
  trajectory.qdot(1)[2] = 4.0 * (from.z() - low_m);
  return trajectory;
}

TEST_F(FieldCheckTest, SeesTheFloorBetweenChecks) {
  space_.floor = Floor{0.2, {"ball_x", "ball_y"}};
  settings_.max_step_m = 10.0;  // at thirds only, to begin with: 0.9 times as low as it comes
  settings_.speed_fraction = 10.0;
  const Eigen::Vector3d from(1.0, 1.0, 0.7);
  const Verdict clear = check(dip(from, 0.302));
  EXPECT_TRUE(clear.valid()) << clear.describe();
  const Verdict verdict = check(dip(from, 0.29));
  ASSERT_EQ(verdict.outcome, Verdict::Outcome::kInvalid);
  ASSERT_EQ(verdict.violations.size(), 1u);
  EXPECT_EQ(verdict.violations[0].describe(), "ball is 0.010 m below the floor at 0.50 s");
  EXPECT_NEAR(verdict.min_clearance_m, -0.01, 1e-12);
  EXPECT_FALSE(check(dip(from, 0.2999)).valid());
  settings_.margin_m = 0.01;
  EXPECT_EQ(check(dip(from, 0.302)).violations.at(0).what(),
            "ball is 0.008 m inside the margin of the floor");
  // Along the margin: no spacing of checks is short enough.
  const double along_m = 0.31 + 1e-9;
  const Verdict touching = check(
      rest_to_rest(Eigen::Vector3d(1.0, 1.0, along_m), Eigen::Vector3d(1.5, 1.0, along_m), 1.0));
  ASSERT_EQ(touching.outcome, Verdict::Outcome::kUnproven) << touching.describe();
  EXPECT_EQ(touching.violations[0].what(), "ball could not be shown clear of the floor");
}

TEST_F(FieldCheckTest, LetsLinksStandOnTheFloorThatMay) {
  space_.floor = Floor{0.2, {"ball"}};
  settings_.speed_fraction = 10.0;
  const Verdict verdict = check(dip({1.0, 1.0, 0.7}, -0.5));
  EXPECT_TRUE(verdict.valid()) << verdict.describe();
}

TEST_F(FieldCheckTest, HasTheFloorInUnknownSpaceAndOutside) {
  space_ = {Space::kFree, Space::kFree, Floor{0.0, {}}};
  world_.unknown = {Aabb{{0.5, 0.9, -1.0}, {0.7, 1.1, 1.0}}};
  settings_.speed_fraction = 10.0;
  settings_.max_step_m = 10.0;
  for (const Eigen::Vector3d& from : {Eigen::Vector3d(0.6, 1.0, 0.5), Eigen::Vector3d(2.5, 0, 0.5),
                                      Eigen::Vector3d(2.5, 2.5, 1.5)}) {
    EXPECT_TRUE(check(dip(from, 0.11)).valid()) << from.transpose();
    const Verdict verdict = check(dip(from, 0.06));
    ASSERT_EQ(verdict.outcome, Verdict::Outcome::kInvalid) << from.transpose();
    EXPECT_EQ(verdict.violations[0].what(), "ball is 0.040 m below the floor");
  }
  // Where both are occupied, what it is deeper in is named.
  space_.unknown = space_.outside = Space::kOccupied;
  const auto what_of = [&](const Eigen::Vector3d& p) {
    return check(rest_to_rest(p, p, 1.0)).violations.at(0).what();
  };
  EXPECT_EQ(what_of({0.6, 1.0, 0.06}), "ball is 0.100 m inside unknown space");
  EXPECT_EQ(what_of({0.6, 1.0, -0.06}), "ball is 0.160 m below the floor");
  EXPECT_EQ(what_of({2.5, 1.0, -0.06}), "ball is 0.600 m inside the space outside the map");
}

TEST_F(FieldCheckTest, SeesAMotionClipTheCornerOfUnknownSpace) {
  // The ball's centre crosses 1 mm of an unknown voxel's corner.
  world_.unknown = {Aabb{{1.0, 1.0, -1.0}, {1.1, 1.1, 1.0}}};
  const double past = 0.001;
  const Verdict verdict = check(rest_to_rest(Eigen::Vector3d(0.9 + past, 1.1, 0.05),
                                             Eigen::Vector3d(1.1 + past, 0.9, 0.05), 2.0));
  EXPECT_EQ(verdict.outcome, Verdict::Outcome::kInvalid) << verdict.describe();
  const Verdict clear = check(rest_to_rest(Eigen::Vector3d(0.9 - past, 1.1, 0.05),
                                           Eigen::Vector3d(1.1 - past, 0.9, 0.05), 2.0));
  EXPECT_TRUE(clear.valid()) << clear.describe();
}

TEST_F(FieldCheckTest, ChecksOnlyFromTheGivenTimeOn) {
  const Trajectory through = rest_to_rest(Eigen::Vector3d(-1, 0, 0), Eigen::Vector3d(1, 0, 0), 2.0);
  EXPECT_FALSE(check(through, 0.0).valid());
  EXPECT_FALSE(check(through, 1.0).valid());
  EXPECT_TRUE(check(through, 1.3).valid());
  EXPECT_TRUE(check(through, 2.0).valid());
  EXPECT_TRUE(check(through, 50.0).valid());
  EXPECT_FALSE(check(through, -1.0).valid());
}

TEST_F(FieldCheckTest, SeesLimitsBetweenSupportStates) {
  testing_support::expect_limits_between_support_states(limits());
}

TEST_F(FieldCheckTest, SeesAccelerationsBeyondTheirLimitsWhereAsked) {
  testing_support::expect_acceleration_limits_where_asked(limits());
}

TEST_F(FieldCheckTest, AllowsWhatIsWithinTheTolerance) {
  Trajectory rest = make_trajectory(3, 2, 1.0);
  rest.q(0)[0] = rest.q(1)[0] = -1.0;
  robot_->description().joints[0].lower = -1.0 + 5e-7;
  EXPECT_TRUE(check(rest).valid());
  robot_->description().joints[0].lower = -1.0 + 2e-6;
  const Verdict verdict = check(rest);
  ASSERT_EQ(verdict.violations.size(), 1u);
  EXPECT_EQ(verdict.violations[0].subject, "x");
}

TEST_F(FieldCheckTest, SeesSelfCollision) {
  robot_ = mobile_arm();
  for (Joint& joint : robot_->description().joints) joint.max_velocity = 10.0;
  world_.occupied.clear();
  space_.outside = Space::kFree;
  Eigen::VectorXd stretched(7);
  stretched << 0, 0, 0, 0.0, 0.2, 0.3, 0;
  Eigen::VectorXd folded = stretched;
  folded[4] = -2.4;
  folded[5] = -2.0;
  const Verdict free = check(rest_to_rest(stretched, stretched, 1.0));
  EXPECT_TRUE(free.valid()) << free.describe();
  EXPECT_GT(free.min_self_clearance_m, 0.0);
  const Verdict verdict = check(rest_to_rest(stretched, folded, 2.0));
  ASSERT_EQ(verdict.outcome, Verdict::Outcome::kInvalid) << verdict.describe();
  EXPECT_EQ(verdict.violations[0].kind, Violation::Kind::kSelfCollision);
  EXPECT_LT(verdict.min_self_clearance_m, 0.0);
  EXPECT_EQ(verdict.violations[0].amount, -verdict.min_self_clearance_m);
}

TEST_F(FieldCheckTest, LooksForObstaclesAloneWhereAsked) {
  robot_ = mobile_arm();
  world_.occupied.clear();
  space_.outside = Space::kFree;
  Eigen::VectorXd folded(7);
  folded << 0, 0, 0, 0.0, -2.4, -2.0, 0;
  robot_->description().joints[0].upper = -0.1;
  const Trajectory still = rest_to_rest(folded, folded, 1.0);
  const Verdict all = check(still);
  ASSERT_GE(all.violations.size(), 2u) << all.describe();
  EXPECT_EQ(all.violations.front().kind, Violation::Kind::kSelfCollision);
  EXPECT_EQ(all.violations.back().kind, Violation::Kind::kPositionLimit);
  settings_.obstacles_only = true;
  EXPECT_TRUE(check(still).valid()) << check(still).describe();
  EXPECT_EQ(check(still).min_self_clearance_m, std::numeric_limits<double>::infinity());
  world_.occupied = {Aabb{{-0.1, -2.0, -1.0}, {0.1, 0.5, 1.0}}};
  EXPECT_EQ(check(still).outcome, Verdict::Outcome::kInvalid);
}

/// A mobile arm that drives through a wall: base, mast, arm and hand all pass it.
class ArmThroughWallTest : public FieldCheckTest {
 protected:
  ArmThroughWallTest() {
    robot_ = mobile_arm();
    world_.grid.origin_m.z() = 0.0;
    world_.occupied = {Aabb{{-0.1, -2.0, 0.0}, {0.1, 2.0, 2.0}}};
  }
  [[nodiscard]] static Trajectory drive() {
    Eigen::VectorXd from(7);
    from << -1, 0, 0, 0.2, -0.5, 0.5, 0;
    Eigen::VectorXd to = from;
    to[0] = 1.0;
    return rest_to_rest(from, to, 20.0);
  }
  [[nodiscard]] Verdict check_drive() const { return check(drive()); }
};

TEST_F(ArmThroughWallTest, EndsSoonAfterTheFirstViolationWhereAsked) {
  settings_.first_violation_only = true;
  const Verdict verdict = check_drive();
  EXPECT_EQ(verdict.outcome, Verdict::Outcome::kInvalid);
  // Rest to rest over 2 m in 20 s it drives at 0.14 m/s then: 0.3 m take 2.1 s.
  for (const Violation& violation : verdict.violations) {
    EXPECT_GE(violation.time_s, verdict.first_violation_s);
    EXPECT_LE(violation.time_s, verdict.first_violation_s + 2.2);
  }
  const auto field = world_.field();
  const Trajectory motion = drive();
  std::vector<double> q(7);
  double time_s = 0.0;
  for (; time_s < 20.0; time_s += 1e-3) {
    motion.sample(time_s, q, {});
    if (state_violation(robot_, field, space_, settings_.margin_m, q)) break;
  }
  // The checks are 0.02 m apart.
  EXPECT_NEAR(verdict.first_violation_s, time_s, 0.2);
}

TEST_F(ArmThroughWallTest, ReportsTheWorstOfEachSubjectWorstFirst) {
  const Verdict verdict = check_drive();
  ASSERT_GE(verdict.violations.size(), 4u);
  std::vector<std::string> subjects;
  for (const Violation& violation : verdict.violations) {
    EXPECT_EQ(violation.kind, Violation::Kind::kCollision);
    subjects.push_back(violation.subject);
  }
  EXPECT_EQ(subjects[0], "base");  // the largest spheres
  EXPECT_NEAR(verdict.violations[0].amount, 0.2, 1e-6);
  std::sort(subjects.begin(), subjects.end());
  EXPECT_EQ(std::unique(subjects.begin(), subjects.end()), subjects.end());
  for (std::size_t i = 1; i < verdict.violations.size(); ++i) {
    EXPECT_LE(verdict.violations[i].amount, verdict.violations[i - 1].amount);
  }
}

TEST_F(FieldCheckTest, RefusesMalformedTrajectories) {
  Trajectory broken = make_trajectory(3, 3, 0.5);
  broken.positions[4] = std::nan("");
  EXPECT_EQ(try_check(broken).error().code, ErrorCode::kInvalidArgument);
  EXPECT_EQ(try_check(make_trajectory(2, 3, 0.5)).error().code, ErrorCode::kInvalidArgument);
  EXPECT_EQ(try_check(Trajectory{}).error().code, ErrorCode::kInvalidArgument);
  Trajectory backwards = make_trajectory(3, 3, 0.5);
  backwards.times_s[2] = 0.2;
  EXPECT_EQ(try_check(backwards).error().code, ErrorCode::kInvalidArgument);
  EXPECT_EQ(try_check(make_trajectory(3, 3, 0.5), std::nan("")).error().code,
            ErrorCode::kInvalidArgument);
}

TEST_F(FieldCheckTest, StopsAtTheDeadline) {
  const auto late = try_check(make_trajectory(3, 3, 0.5), 0.0, Deadline::after_s(0.0));
  ASSERT_FALSE(late);
  EXPECT_EQ(late.error().code, ErrorCode::kDeadlineExceeded);
}

TEST_F(FieldCheckTest, SurvivesAbsurdNumbers) {
  Trajectory absurd = make_trajectory(3, 3, 0.5);
  absurd.positions = {1e300, -1e300, 0.0, 1e150, 0.0, 0.0, -1e308, 1e308, 1e10};
  absurd.velocities.assign(9, 1e305);
  const Verdict verdict = check(absurd);
  EXPECT_FALSE(verdict.valid());
  absurd.positions.assign(9, 0.0);
  absurd.q(2)[0] = 1e5;  // finite, but 100 km
  space_ = {Space::kFree, Space::kFree};
  EXPECT_FALSE(check(absurd).valid());
}

TEST(Cubic, VariationIsTheSumOfSmallSteps) {
  for (const auto& [v0, v1] : {std::pair{2.0, -3.0}, {-4.0, -4.0}, {0.0, 0.0}, {5.0, 5.0}}) {
    const Cubic cubic = Cubic::hermite(0.3, v0, 0.9, v1, 0.8);
    for (const auto& [a, b] : {std::pair{0.0, 0.8}, {0.1, 0.5}, {0.6, 0.61}}) {
      double sum = 0.0;
      for (int k = 0; k < 20000; ++k) {
        const double s = a + (b - a) * k / 20000.0;
        sum += std::abs(cubic.position(s + (b - a) / 20000.0) - cubic.position(s));
      }
      EXPECT_NEAR(cubic.variation(a, b), sum, 1e-6 * (1.0 + sum));
    }
  }
}

class StateViolationTest : public FieldCheckTest {
 protected:
  [[nodiscard]] std::optional<Violation> of(const Eigen::VectorXd& q, double margin_m = 0.0) const {
    return state_violation(robot_, world_.field(), space_, margin_m,
                           {q.data(), static_cast<std::size_t>(q.size())});
  }
};

TEST_F(StateViolationTest, IsTheDeepestCollision) {
  EXPECT_FALSE(of(Eigen::Vector3d(-1, 0, 0)));
  EXPECT_FALSE(of(Eigen::Vector3d(-0.35, 0.05, 0.05), 0.19));
  const auto margin = of(Eigen::Vector3d(-0.35, 0.05, 0.05), 0.25);  // 0.3 - 0.1 to the centres
  ASSERT_TRUE(margin);
  EXPECT_EQ(margin->what(), "ball is 0.050 m inside the margin of an obstacle");
  const auto inside = of(Eigen::Vector3d(-0.1, 0.05, 0.05));  // 0.05 to the centres
  ASSERT_TRUE(inside);
  EXPECT_EQ(inside->what(), "ball is 0.050 m inside an obstacle");
}

TEST_F(StateViolationTest, IsTheFloorWhereThatIsDeeper) {
  space_.floor = Floor{-0.1, {}};
  EXPECT_FALSE(of(Eigen::Vector3d(-1, 0, 0.02), 0.02));
  EXPECT_EQ(of(Eigen::Vector3d(-1, 0, 0.02), 0.03)->what(),
            "ball is 0.010 m inside the margin of the floor");
  EXPECT_EQ(of(Eigen::Vector3d(-0.1, 0.05, -0.05))->what(), "ball is 0.050 m below the floor");
  EXPECT_EQ(of(Eigen::Vector3d(-0.1, 0.05, -0.02))->what(), "ball is 0.050 m inside an obstacle");
}

TEST_F(StateViolationTest, IsALimitOrNotANumber) {
  const auto beyond = of(Eigen::Vector3d(-1, 0, 3.5));
  ASSERT_TRUE(beyond);
  EXPECT_EQ(beyond->kind, Violation::Kind::kCollision);  // outside the map is worse
  space_.outside = Space::kFree;
  EXPECT_EQ(of(Eigen::Vector3d(-1, 0, 3.5))->what(), "z is 0.5 beyond its upper limit of 3 m");
  EXPECT_TRUE(of(Eigen::Vector3d(-1, std::nan(""), 0)));
  EXPECT_TRUE(of(Eigen::Vector2d(-1, 0)));
}

}  // namespace
}  // namespace sidestep
