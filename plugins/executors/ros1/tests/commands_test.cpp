#include "commands.hpp"

#include <algorithm>
#include <cmath>
#include <random>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <sidestep/trajectory/braking.hpp>

#include "conversions.hpp"
#include "motion_checks.hpp"

namespace sidestep::ros1_executor {
namespace {

using ::testing::ElementsAre;
using ::testing::HasSubstr;

constexpr int kDof = 3;
const Eigen::Vector3d kFrom(0.0, 0.0, 0.2);
const Eigen::Vector3d kTo(1.2, -0.6, 1.0);

RobotDescription robot_of_three() {
  RobotDescription robot;
  robot.name = "three";
  for (const char* name : {"x", "y", "arm"}) {
    robot.joints.push_back({name, Joint::Type::kPrismatic, -10.0, 10.0, 0.5, 0.25});
  }
  return robot;
}

MotionLimits limits_of_three() { return motion_limits(robot_of_three(), {}); }

/// Along a straight line in 10 s: a quintic, at rest at both ends.
Trajectory there_and_rest() {
  Trajectory trajectory = make_trajectory(kDof, 41, 0.25);
  const double T = trajectory.duration_s();
  for (int i = 0; i < trajectory.size(); ++i) {
    const double s = trajectory.times_s[static_cast<std::size_t>(i)] / T;
    const double way = s * s * s * (10.0 - 15.0 * s + 6.0 * s * s);
    const double rate = 30.0 * s * s * (1.0 - s) * (1.0 - s) / T;
    const Eigen::Vector3d q = kFrom + way * (kTo - kFrom);
    const Eigen::Vector3d qdot = rate * (kTo - kFrom);
    std::ranges::copy(q, trajectory.q(i).begin());
    std::ranges::copy(qdot, trajectory.qdot(i).begin());
  }
  return trajectory;
}

struct Sample {
  Eigen::Vector3d q, qdot;
};
Sample sample(const Trajectory& trajectory, double at_s) {
  Sample found;
  trajectory.sample(at_s, {found.q.data(), kDof}, {found.qdot.data(), kDof});
  return found;
}

Options two_controllers() {
  Options options;
  options.mode = "drive";
  options.controllers = {{"/base", {}, {"y", "x"}}, {"/arm", {}, {"head", "arm"}}};
  options.hold = {{"head", -0.3}};
  options.command_rate_hz = 20.0;
  return options;
}

TEST(CommandWindow, IsTheMotionAndThenAStopOnItsPath) {
  const Trajectory motion = there_and_rest();
  const double from_s = 3.0, horizon_s = 1.5;
  const Trajectory window = command_window(motion, from_s, horizon_s, limits_of_three());
  ASSERT_TRUE(window.validate());
  for (double t = 0.0; t <= horizon_s; t += 0.01) {
    EXPECT_LT((sample(window, t).q - sample(motion, from_s + t).q).norm(), 1e-12) << t;
    EXPECT_LT((sample(window, t).qdot - sample(motion, from_s + t).qdot).norm(), 1e-12) << t;
  }
  // All of the path is one line: how far off it is, and never back.
  const Eigen::Vector3d direction = (kTo - kFrom).normalized();
  double reached = 0.0;
  for (double t = 0.0; t <= window.duration_s(); t += 0.01) {
    const Eigen::Vector3d way = sample(window, t).q - kFrom;
    const double along = way.dot(direction);
    EXPECT_LT((way - along * direction).norm(), 1e-4) << t;
    EXPECT_GE(along, reached - 1e-9) << t;
    reached = along;
  }
  EXPECT_LT(sample(window, window.duration_s()).qdot.norm(), 1e-6);
  EXPECT_LT(window.duration_s(), motion.duration_s() - from_s);
}

TEST(CommandWindow, EndsInAStopByTheLimitsOfBraking) {
  const Trajectory motion = there_and_rest();  // a straight line: its fastest joint brakes longest
  const Eigen::Vector3d speed = sample(motion, 4.3).qdot.cwiseAbs();
  MotionLimits limits = limits_of_three();
  EXPECT_NEAR(command_window(motion, 3.3, 1.0, limits).duration_s(), 1.0 + speed.maxCoeff() / 0.25,
              0.02);
  limits.braking = {2.5, 2.5, 2.5};
  EXPECT_NEAR(command_window(motion, 3.3, 1.0, limits).duration_s(), 1.0 + speed.maxCoeff() / 2.5,
              0.002);
}

TEST(CommandWindow, IsTheRestWhereThatIsShorterOrAllOfItIsWanted) {
  const Trajectory motion = there_and_rest();
  EXPECT_NEAR(command_window(motion, 9.5, 1.0, limits_of_three()).duration_s(), 0.5, 1e-12);
  EXPECT_NEAR(command_window(motion, 2.0, 0.0, limits_of_three()).duration_s(), 8.0, 1e-12);
}

TEST(CommandWriter, CutsAllMessagesFromOneTrajectoryOnOneClock) {
  const auto writer = CommandWriter::create(robot_of_three(), two_controllers());
  ASSERT_TRUE(writer) << writer.error().describe();
  const Trajectory motion = there_and_rest();
  const auto messages = writer->write(motion, Stamp::from_seconds(1234.5));
  ASSERT_EQ(messages.size(), 2U);
  EXPECT_THAT(messages[0].joint_names, ElementsAre("y", "x"));
  EXPECT_THAT(messages[1].joint_names, ElementsAre("head", "arm"));
  for (const auto& message : messages) {
    EXPECT_EQ(ros_messages::to_stamp(message.header.stamp), Stamp::from_seconds(1234.5));
    ASSERT_EQ(message.points.size(), 201U);
  }
  for (std::size_t i = 0; i < 201; ++i) {
    const double t = static_cast<double>(i) / 20.0;
    const auto [q, qdot] = sample(motion, t);
    for (const auto& message : messages) {
      EXPECT_NEAR(message.points[i].time_from_start.toSec(), t, 1e-9);
    }
    EXPECT_THAT(messages[0].points[i].positions, ElementsAre(q[1], q[0]));
    EXPECT_THAT(messages[0].points[i].velocities, ElementsAre(qdot[1], qdot[0]));
    EXPECT_THAT(messages[1].points[i].positions, ElementsAre(-0.3, q[2]));
    EXPECT_THAT(messages[1].points[i].velocities, ElementsAre(0.0, qdot[2]));
  }
}

HeadDescription pan_and_tilt() {
  const auto joint = [](const char* name) {
    return Joint{name, Joint::Type::kRevolute, -2.0, 2.0, 1.0, 4.0};
  };
  return {{joint("pan")}, {joint("tilt")}};
}

TEST(CommandWriter, TurnsAHeadWithoutItsMotions) {
  Options options = two_controllers();
  options.controllers[1].joints = {"arm"};
  options.controllers.push_back({"/head", {}, {"tilt", "light", "pan"}});
  options.hold = {{"pan", 0.0}, {"tilt", -0.3}, {"light", 0.7}};
  auto writer = CommandWriter::create(robot_of_three(), options);
  ASSERT_TRUE(writer) << writer.error().describe();
  const Trajectory motion = there_and_rest();
  EXPECT_THAT(writer->write(motion, {})[2].points[0].positions, ElementsAre(-0.3, 0.7, 0.0));
  const auto turned =
      writer->turn_head(pan_and_tilt(), {0.0, -0.3}, {1.0, -0.5}, Stamp::from_seconds(3.0));
  ASSERT_TRUE(turned) << turned.error().describe();
  EXPECT_TRUE((*turned)[0].joint_names.empty());
  EXPECT_TRUE((*turned)[1].joint_names.empty());
  const auto& message = (*turned)[2];
  EXPECT_EQ(ros_messages::to_stamp(message.header.stamp), Stamp::from_seconds(3.0));
  EXPECT_THAT(message.joint_names, ElementsAre("tilt", "light", "pan"));
  ASSERT_EQ(message.points.size(), 1U);
  EXPECT_THAT(message.points[0].positions, ElementsAre(-0.5, 0.7, 1.0));
  // By a cubic d t^2 (3 - 2 t): 1.5 d / T is at most 1 rad/s, 6 d / T^2 at most 4 rad/s^2.
  const double time_s = message.points[0].time_from_start.toSec();
  EXPECT_NEAR(time_s, 1.5, 1e-9);
  double fastest = 0.0, hardest = 0.0;
  for (double t = 0.0; t <= 1.0; t += 1e-3) {
    fastest = std::max(fastest, 6.0 * t * (1.0 - t) / time_s);
    hardest = std::max(hardest, std::abs(6.0 - 12.0 * t) / (time_s * time_s));
  }
  EXPECT_LE(fastest, 1.0 + 1e-9);
  EXPECT_LE(hardest, 4.0 + 1e-9);
  // Motions leave the head alone from then on.
  EXPECT_TRUE(writer->write(motion, {})[2].joint_names.empty());
  EXPECT_FALSE(writer->write(motion, {})[1].points.empty());
}

TEST(CommandWriter, TurnsNoHeadThatItsControllersDoNotTurnAlone) {
  Options options = two_controllers();
  auto without = CommandWriter::create(robot_of_three(), options);
  const auto missed = without->turn_head(pan_and_tilt(), {}, {}, {});
  ASSERT_FALSE(missed);
  EXPECT_THAT(missed.error().message, HasSubstr("no controller moves 'pan' and 'tilt'"));
  // One that moves half of it goes on as it was.
  options.controllers.push_back({"/neck", {}, {"pan"}});
  options.hold.push_back({"pan", 0.0});
  auto half = CommandWriter::create(robot_of_three(), options);
  ASSERT_TRUE(half);
  EXPECT_FALSE(half->turn_head(pan_and_tilt(), {}, {1.0, 0.0}, {}));
  EXPECT_THAT(half->write(there_and_rest(), {})[2].joint_names, ElementsAre("pan"));
  options.controllers.pop_back();
  options.controllers[1].joints = {"pan", "tilt", "arm"};
  options.hold = {{"pan", 0.0}, {"tilt", 0.0}};
  auto together = CommandWriter::create(robot_of_three(), options);
  const auto shared = together->turn_head(pan_and_tilt(), {}, {}, {});
  ASSERT_FALSE(shared);
  EXPECT_THAT(shared.error().message, HasSubstr("moves planned joints, too"));
}

/// A controller goes between points by cubics of their positions and velocities.
TEST(CommandWriter, LosesNothingBetweenItsPoints) {
  const auto writer = CommandWriter::create(robot_of_three(), two_controllers());
  ASSERT_TRUE(writer);
  const Trajectory window = command_window(there_and_rest(), 3.3, 1.0, limits_of_three());
  const auto arm = writer->write(window, {})[1];
  const auto middle = [](double h, double q0, double v0, double q1, double v1) {
    return 0.5 * (q0 + q1) + 0.125 * h * (v0 - v1);
  };
  double worst = 0.0;
  for (std::size_t i = 0; i + 1 < arm.points.size(); ++i) {
    const auto& a = arm.points[i];
    const auto& b = arm.points[i + 1];
    const double t = a.time_from_start.toSec(), h = b.time_from_start.toSec() - t;
    ASSERT_GT(h, 0.0);
    const double controlled =
        middle(h, a.positions[1], a.velocities[1], b.positions[1], b.velocities[1]);
    worst = std::max(worst, std::abs(controlled - sample(window, t + 0.5 * h).q[2]));
  }
  // What a jump of the acceleration between two points costs at most, where braking begins: less
  // than a h^2 / 16.
  EXPECT_LT(worst, 0.25 * 0.05 * 0.05 / 16.0);
}

TEST(CommandWriter, RefusesJointsNobodyKnowsAndJointsNobodyMoves) {
  Options unknown = two_controllers();
  unknown.hold.clear();
  const auto refused = CommandWriter::create(robot_of_three(), unknown);
  ASSERT_FALSE(refused);
  EXPECT_THAT(refused.error().message, HasSubstr("no joint 'head', which /arm is to move"));

  Options unmoved = two_controllers();
  unmoved.controllers.erase(unmoved.controllers.begin());
  const auto also_refused = CommandWriter::create(robot_of_three(), unmoved);
  ASSERT_FALSE(also_refused);
  EXPECT_THAT(also_refused.error().message, HasSubstr("no controller moves joint 'x'"));
  unmoved.mode = "shadow";
  EXPECT_TRUE(CommandWriter::create(robot_of_three(), unmoved));
  unmoved.mode = "drive";
  unmoved.odometry = OdometryOptions{};
  unmoved.odometry->x_joint = "x";
  unmoved.odometry->y_joint = "y";
  unmoved.twist = TwistOptions{};
  EXPECT_TRUE(CommandWriter::create(robot_of_three(), unmoved));
}

/// Against the motion sampled so finely that little is missed between two samples.
TEST(JointExtent, IsWhatFineSamplesReach) {
  std::mt19937_64 random(5);
  std::uniform_real_distribution<double> any(-1.0, 1.0);
  for (int round = 0; round < 20; ++round) {
    Trajectory motion = make_trajectory(kDof, 6, 0.7);
    for (double& value : motion.positions) value = any(random);
    for (double& value : motion.velocities) value = 3.0 * any(random);
    Eigen::Vector3d low = sample(motion, 0.0).q, high = low, fast = Eigen::Vector3d::Zero();
    for (int i = 0; i <= 35000; ++i) {
      const auto [q, qdot] = sample(motion, 1e-4 * i);
      low = low.cwiseMin(q);
      high = high.cwiseMax(q);
      fast = fast.cwiseMax(qdot.cwiseAbs());
    }
    for (int joint = 0; joint < kDof; ++joint) {
      const JointExtent extent = extent_of(motion, joint);
      EXPECT_NEAR(extent.lowest, low[joint], 1e-6);
      EXPECT_NEAR(extent.highest, high[joint], 1e-6);
      EXPECT_NEAR(extent.fastest, fast[joint], 1e-5);
      EXPECT_LE(extent.lowest, low[joint] + 1e-12);
      EXPECT_GE(extent.highest, high[joint] - 1e-12);
      EXPECT_GE(extent.fastest, fast[joint] - 1e-12);
    }
  }
}

TEST(CheckMotion, NamesTheJointThatIsTooFast) {
  Trajectory motion = make_trajectory(kDof, 3, 1.0);
  motion.q(2)[1] = 0.45;  // Between two states at rest, a cubic peaks at 1.5 of its mean velocity.
  const auto refused = check_motion(motion, robot_of_three(), 0.05);
  ASSERT_FALSE(refused);
  EXPECT_THAT(refused.error().message, HasSubstr("joint 'y' at 0.675 per s after 1 s"));
  EXPECT_TRUE(check_motion(motion, robot_of_three(), 0.36));
}

TEST(ExecutorOptions, AreCheckedTogether) {
  const auto names = [](const Options& options) {
    std::vector<std::string> list;
    for (const OptionMistake& mistake : options.check()) list.push_back(mistake.parameters.front());
    return list;
  };
  EXPECT_THAT(names(two_controllers()), ElementsAre());
  Options options = two_controllers();
  options.controllers[1].joints.push_back("x");
  EXPECT_THAT(names(options), ElementsAre("controllers"));
  options = two_controllers();
  options.hold.push_back({"tail", 0.0});
  EXPECT_THAT(names(options), ElementsAre("hold"));
  options = two_controllers();
  options.command_renewal_s = 1.0;
  EXPECT_THAT(names(options), ElementsAre("command_renewal_s"));
  options = two_controllers();
  options.keep_in = KeepInBox{{0.0, 1.0}, {1.0, 1.0}};
  options.odometry = OdometryOptions{};
  EXPECT_THAT(names(options), ElementsAre("keep_in"));
  options = {};
  options.mode = "drive";
  EXPECT_THAT(names(options), ElementsAre("mode"));
  options.twist = TwistOptions{};
  EXPECT_THAT(names(options), ElementsAre("twist"));  // without odometry
  options.odometry = OdometryOptions{};
  EXPECT_THAT(names(options), ElementsAre());
  options.controllers = {{"/base", {}, {options.odometry->yaw_joint}}};
  EXPECT_THAT(names(options), ElementsAre("controllers"));
}

}  // namespace
}  // namespace sidestep::ros1_executor
