#include "../simulated_robot.hpp"

#include <cmath>
#include <functional>

#include <gtest/gtest.h>

namespace sidestep::simulated {
namespace {

constexpr double kStep_s = 1e-3;

Stamp moment(double seconds) { return Stamp::from_seconds(seconds); }

MotionLimits limits(double velocity, double acceleration) {
  return {{velocity}, {acceleration}, {"joint"}};
}

Eigen::VectorXd one(double q) { return Eigen::VectorXd::Constant(1, q); }

/// Support states every 50 ms of a motion given with its derivative.
std::shared_ptr<const Trajectory> trajectory(const std::function<double(double)>& q,
                                             const std::function<double(double)>& qdot,
                                             double duration_s) {
  auto made = std::make_shared<Trajectory>(
      make_trajectory(1, static_cast<int>(std::lround(duration_s / 0.05)) + 1, 0.05));
  for (int i = 0; i < made->size(); ++i) {
    made->q(i)[0] = q(made->times_s[static_cast<std::size_t>(i)]);
    made->qdot(i)[0] = qdot(made->times_s[static_cast<std::size_t>(i)]);
  }
  return made;
}

/// From 0 to 1 in 2 s, at rest at both ends: peak velocity 0.75, peak acceleration 1.5.
std::shared_ptr<const Trajectory> one_joint_step() {
  return trajectory([](double t) { return 0.25 * t * t * (3.0 - t); },
                    [](double t) { return 0.75 * t * (2.0 - t); }, 2.0);
}

TEST(SimulatedRobot, FollowsWhatItsLimitsAllowExactly) {
  SimulatedRobot robot(limits(0.8, 1.6), 0.0, one(0.0), moment(0.0));
  robot.follow(one_joint_step(), moment(0.5), moment(0.5));
  while (robot.time() < moment(3.0)) {
    robot.step();
    const double t = std::clamp(robot.time().seconds() - 0.5, 0.0, 2.0);
    EXPECT_NEAR(robot.state().q[0], 0.25 * t * t * (3.0 - t), 1e-8) << t;
    EXPECT_NEAR(robot.state().qdot[0], 0.75 * t * (2.0 - t), 1e-6) << t;
  }
}

TEST(SimulatedRobot, LagsBehindARampByVelocityTimesLag) {
  SimulatedRobot robot(limits(1.0, 10.0), 0.2, one(0.0), moment(0.0));
  robot.follow(trajectory([](double t) { return 0.5 * t; }, [](double) { return 0.5; }, 4.0),
               moment(0.0), moment(0.0));
  while (robot.time() < moment(4.0)) {
    robot.step();
    const double t = robot.time().seconds();
    // x' = (0.5 t - x) / 0.2, x(0) = 0.
    const double exact = 0.5 * t - 0.1 * (1.0 - std::exp(-t / 0.2));
    EXPECT_NEAR(robot.state().q[0], exact, 2e-6) << t;
  }
}

TEST(SimulatedRobot, KeepsItsLimitsWhateverItIsToldAndCatchesUp) {
  SimulatedRobot robot(limits(0.4, 0.5), 0.0, one(0.0), moment(0.0));
  // A jump by 1, then twice as fast as it can, then back and forth.
  robot.follow(trajectory([](double) { return 1.0; }, [](double) { return 0.0; }, 1.0), moment(0.1),
               moment(0.1));
  robot.follow(trajectory([](double t) { return std::sin(2.0 * t); },
                          [](double t) { return 2.0 * std::cos(2.0 * t); }, 5.0),
               moment(6.0), moment(6.0));
  robot.follow(trajectory([](double) { return -0.5; }, [](double) { return 0.0; }, 1.0),
               moment(11.0), moment(11.0));
  RobotState before = robot.state();
  double overshoot = 0.0;
  while (robot.time() < moment(20.0)) {
    robot.step();
    const RobotState& now = robot.state();
    EXPECT_LE(std::abs(now.qdot[0]), 0.4 + 1e-12);
    EXPECT_LE(std::abs(now.qdot[0] - before.qdot[0]), 0.5 * kStep_s + 1e-12);
    EXPECT_NEAR(now.q[0] - before.q[0], 0.5 * (now.qdot[0] + before.qdot[0]) * kStep_s, 1e-12);
    if (robot.time() < moment(6.0)) overshoot = std::max(overshoot, now.q[0] - 1.0);
    if (robot.time() == moment(6.0)) {
      EXPECT_NEAR(now.q[0], 1.0, 1e-3);
    }
    before = now;
  }
  EXPECT_LT(overshoot, 5e-3);
  EXPECT_NEAR(before.q[0], -0.5, 1e-6);
  EXPECT_NEAR(before.qdot[0], 0.0, 1e-6);
}

TEST(SimulatedRobot, BrakesWithinVelocitySquaredOverTwiceTheAcceleration) {
  SimulatedRobot robot(limits(1.0, 0.8), 0.0, one(0.0), moment(0.0));
  robot.follow(trajectory([](double t) { return t < 1.0 ? 0.3 * t * t : 0.6 * t - 0.3; },
                          [](double t) { return t < 1.0 ? 0.6 * t : 0.6; }, 3.0),
               moment(0.0), moment(0.0));
  robot.brake(moment(2.0));
  while (robot.time() < moment(1.999)) robot.step();
  EXPECT_NEAR(robot.state().qdot[0], 0.6, 1e-6);
  const double from = robot.state().q[0];
  EXPECT_NEAR(robot.told_position(moment(9.0))[0], from + 0.36 / 1.6, 1e-5);
  while (robot.time() < moment(2.7)) robot.step();
  EXPECT_GT(robot.state().qdot[0], 0.0);
  while (robot.time() < moment(2.76)) robot.step();
  EXPECT_EQ(robot.state().qdot[0], 0.0);
  EXPECT_NEAR(robot.state().q[0], from + 0.36 / 1.6, 1e-5);
}

TEST(SimulatedRobot, LosesSpeedByItsBrakesAndGainsItByItsAcceleration) {
  // From rest to 0.6, then told to be there the other way: with 0.8 up, with 3 down to rest, and
  // with 0.8 again from there on.
  const auto ramp = [](double sign) {
    return trajectory([=](double t) { return sign * 0.6 * t; }, [=](double) { return sign * 0.6; },
                      4.0);
  };
  MotionLimits own = limits(1.0, 0.8);
  own.braking = {3.0};
  SimulatedRobot robot(own, 0.0, one(0.0), moment(0.0));
  robot.follow(ramp(1.0), moment(0.0), moment(0.0));
  robot.follow(ramp(-1.0), moment(2.0), moment(2.0));
  double before = 0.0, gained = 0.0, lost = 0.0;
  while (robot.time() < moment(4.0)) {
    robot.step();
    const double v = robot.state().qdot[0];
    if (v * before > 0.0) {  // a step that goes through rest does both
      const double change = (std::abs(v) - std::abs(before)) / kStep_s;
      gained = std::max(gained, change);
      lost = std::max(lost, -change);
    }
    before = v;
  }
  EXPECT_NEAR(gained, 0.8, 1e-9);
  EXPECT_NEAR(lost, 3.0, 1e-9);
}

TEST(SimulatedRobot, ComesToRestByItsBrakes) {
  MotionLimits own = limits(1.0, 0.8);
  own.braking = {3.0};
  SimulatedRobot robot(own, 0.0, one(0.0), moment(0.0));
  robot.follow(trajectory([](double t) { return t < 1.0 ? 0.3 * t * t : 0.6 * t - 0.3; },
                          [](double t) { return t < 1.0 ? 0.6 * t : 0.6; }, 3.0),
               moment(0.0), moment(0.0));
  robot.brake(moment(2.0));
  while (robot.time() < moment(1.999)) robot.step();
  const double from = robot.state().q[0];
  while (robot.time() < moment(2.19)) robot.step();
  EXPECT_GT(robot.state().qdot[0], 0.0);
  while (robot.time() < moment(2.21)) robot.step();
  EXPECT_EQ(robot.state().qdot[0], 0.0);
  EXPECT_NEAR(robot.state().q[0], from + 0.36 / 6.0, 1e-4);
}

TEST(SimulatedRobot, StopsAtOnceWhereAccelerationHasNoLimit) {
  SimulatedRobot robot(limits(1.0, std::numeric_limits<double>::infinity()), 0.0, one(0.0),
                       moment(0.0));
  robot.follow(one_joint_step(), moment(0.0), moment(0.0));
  robot.brake(moment(1.0));
  while (robot.time() < moment(1.0)) robot.step();
  EXPECT_EQ(robot.state().qdot[0], 0.0);
  EXPECT_TRUE(std::isfinite(robot.state().q[0]));
}

TEST(SimulatedRobot, FollowsTheOldTrajectoryUntilTheNewOneTakesOverWithoutAJump) {
  SimulatedRobot robot(limits(0.8, 1.6), 0.0, one(0.0), moment(0.0));
  robot.follow(one_joint_step(), moment(0.0), moment(0.0));
  // Leaves the first at 1 s, with its position 0.5 and velocity 0.75, and brakes by 0.75 per s^2.
  robot.follow(trajectory([](double t) { return 0.5 + 0.75 * t - 0.375 * t * t; },
                          [](double t) { return 0.75 - 0.75 * t; }, 1.0),
               moment(1.0), moment(1.0));
  double before = 0.0;
  while (robot.time() < moment(2.0)) {
    robot.step();
    const double t = robot.time().seconds();
    const double exact = t <= 1.0 ? 0.25 * t * t * (3.0 - t)
                                  : 0.5 + 0.75 * (t - 1.0) - 0.375 * (t - 1.0) * (t - 1.0);
    EXPECT_NEAR(robot.state().q[0], exact, 1e-8) << t;
    EXPECT_LE(std::abs(robot.state().qdot[0] - before), 1.6 * kStep_s + 1e-12);
    before = robot.state().qdot[0];
  }
}

TEST(SimulatedRobot, ForgetsWhatWasToBeginAfterANewCommand) {
  SimulatedRobot robot(limits(1.0, 1.0), 0.0, one(0.0), moment(0.0));
  robot.follow(one_joint_step(), moment(1.0), moment(1.0));
  robot.brake(moment(0.5));
  while (robot.time() < moment(3.0)) robot.step();
  EXPECT_EQ(robot.state().q[0], 0.0);
}

TEST(SimulatedRobot, BeginsAtTheLastWholeStepAlsoBeforeZero) {
  EXPECT_EQ(SimulatedRobot(limits(1, 1), 0.0, one(0.0), {1'999'999}).time().ns, 1'000'000);
  EXPECT_EQ(SimulatedRobot(limits(1, 1), 0.0, one(0.0), {-1}).time().ns, -1'000'000);
  EXPECT_EQ(SimulatedRobot(limits(1, 1), 0.0, one(0.0), {-2'000'000}).time().ns, -2'000'000);
}

}  // namespace
}  // namespace sidestep::simulated
