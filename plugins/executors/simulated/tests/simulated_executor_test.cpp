#include "../simulated_executor.hpp"

#include <cmath>
#include <limits>
#include <thread>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <sidestep/runtime/yaml_document.hpp>
#include <sidestep/trajectory/robot_motion.hpp>

#include "conformance/gaze_conformance.hpp"
#include "conformance/localiser_conformance.hpp"
#include "conformance/manual_clock.hpp"
#include "conformance/test_host.hpp"
#include "support/chain_robot.hpp"

namespace sidestep::simulated {
namespace {

using ::testing::HasSubstr;

Stamp at_s(double seconds) { return Stamp::from_seconds(seconds); }

/// From (0, 0, 0) to (1, -1, 0) in 2 s: peak velocity 0.75.
Trajectory smooth_step(double scale = 1.0) {
  Trajectory made = make_trajectory(3, 41, 0.05);
  for (int i = 0; i < made.size(); ++i) {
    const double t = made.times_s[static_cast<std::size_t>(i)];
    for (std::size_t j = 0; j < 2; ++j) {
      const double sign = j == 0 ? scale : -scale;
      made.q(i)[j] = sign * 0.25 * t * t * (3.0 - t);
      made.qdot(i)[j] = sign * 0.75 * t * (2.0 - t);
    }
  }
  return made;
}
double smooth_position(double t) {
  const double in = std::clamp(t, 0.0, 2.0);
  return 0.25 * in * in * (3.0 - in);
}

class SimulatedExecutorTest : public ::testing::Test {
 protected:
  SimulatedExecutorTest() {
    robot_ = testing_support::flying_ball(0.1);
    for (Joint& joint : robot_->description().joints) joint.max_acceleration = 2.0;
    restart();
  }
  /// As in a new run, at 0 s.
  void restart() {
    clock_.set_s(0.0);
    motion_ = std::make_shared<RobotMotion>(100.0);
    host_ = std::make_unique<conformance::TestHost>(
        1, conformance::TestHostParts{.robot = robot_, .clock = &clock_, .motion = motion_});
  }
  std::unique_ptr<Executor> make(std::uint64_t seed = 3) {
    auto made = create_executor(options_, host_->context(seed));
    if (!made) throw std::runtime_error(made.error().describe());
    return std::move(*made);
  }
  static Eigen::VectorXd q(Executor& executor) { return executor.current()->state.q; }
  static Node start(std::string_view yaml) {
    std::vector<Error> errors;
    return parse_yaml(yaml, "run.yaml", errors).value();
  }

  std::shared_ptr<testing_support::ChainRobot> robot_;
  conformance::ManualClock clock_;
  std::shared_ptr<RobotMotion> motion_;
  std::unique_ptr<conformance::TestHost> host_;
  Options options_;
};

TEST_F(SimulatedExecutorTest, FollowsATrajectoryLateByItsDelay) {
  options_.delay_s = 0.12;
  const auto executor = make();
  ASSERT_TRUE(executor->follow(smooth_step(), at_s(0.5)));
  for (double t = 0.0; t < 3.0; t += 0.02) {
    clock_.set_s(t);
    const double exact = smooth_position(t - 0.5 - 0.12);
    EXPECT_NEAR(q(*executor)[0], exact, 1e-7) << t;
    EXPECT_NEAR(q(*executor)[1], -exact, 1e-7) << t;
  }
}

TEST_F(SimulatedExecutorTest, KnowsTheTruthOfAMomentThatNobodyMeasured) {
  const auto executor = make();
  ASSERT_TRUE(executor->follow(smooth_step(), at_s(0.5)));
  clock_.set_s(2.0);
  EXPECT_NEAR(dynamic_cast<TrueRobot&>(*executor).true_state(at_s(2.0)).q[0], smooth_position(1.5),
              1e-7);
}

/// Odometry says 1 m along x, the robot has gone 1.02 m and turned by 0.05 rad on the way.
TEST_F(SimulatedExecutorTest, DriftsAwayFromItsOdometry) {
  host_ = std::make_unique<conformance::TestHost>(
      1, conformance::TestHostParts{
             .robot = conformance::turning_robot(), .clock = &clock_, .motion = motion_});
  options_.drift_share = 0.02;
  options_.drift_rad_per_m = 0.05;
  const auto executor = make();
  Trajectory ahead = make_trajectory(3, 2, 4.0);
  ahead.q(1)[0] = 1.0;
  ASSERT_TRUE(executor->follow(ahead, at_s(0.0)));
  clock_.set_s(6.0);
  EXPECT_NEAR(q(*executor)[0], 1.0, 1e-6);
  const auto truth = dynamic_cast<TrueRobot&>(*executor).true_state(at_s(6.0)).q;
  EXPECT_NEAR(std::abs(truth[2]), 0.05, 1e-6);
  const double share = (truth.head<2>().norm() - 1.0) / (1.0 - 0.05 * 0.05 / 24.0);
  EXPECT_NEAR(std::abs(share), 0.02, 1e-3);
  // On an arc: half of the turn aside.
  EXPECT_NEAR(std::abs(truth[1]), 0.5 * 0.05, 2e-3);
  EXPECT_EQ(motion_->truth(at_s(3.0))->q.size(), 3);
  EXPECT_NE(motion_->truth(at_s(3.0))->q[2], motion_->measured(at_s(3.0))->q[2]);
}

TEST_F(SimulatedExecutorTest, CannotDriftWithoutABaseThatTurns) {
  options_.drift_share = 0.01;
  const auto made = create_executor(options_, host_->context(3));
  ASSERT_FALSE(made);
  EXPECT_THAT(made.error().describe(), HasSubstr("base"));
}

TEST_F(SimulatedExecutorTest, MovesTheSameHoweverOftenItIsAsked) {
  options_.lag_s = 0.05;
  options_.position_noise = 0.001;
  std::vector<RobotState> ends;
  std::vector<RobotState> measured;
  for (const double period_s : {0.0011, 0.004, 0.31}) {
    restart();
    const auto executor = make();
    ASSERT_TRUE(executor->follow(smooth_step(), at_s(0.3)));
    for (double t = 0.0; t < 2.0; t += period_s) {
      clock_.set_s(t);
      EXPECT_TRUE(executor->current());
    }
    clock_.set_s(2.0);
    ends.push_back(executor->current()->state);
    measured.push_back(*motion_->measured(at_s(1.2345)));
  }
  for (const RobotState& end : ends) EXPECT_EQ(end.q, ends[0].q);
  for (const RobotState& state : measured) EXPECT_EQ(state.q, measured[0].q);
}

TEST_F(SimulatedExecutorTest, ReportsWhatItMeasuresWhatIsTrueAndWhatItFollows) {
  options_.position_noise = 0.01;
  const auto executor = make();
  auto* truth = dynamic_cast<TrueRobot*>(executor.get());
  ASSERT_NE(truth, nullptr);
  ASSERT_TRUE(executor->follow(smooth_step(), at_s(0.0)));
  clock_.set_s(20.0);
  EXPECT_EQ(executor->current()->stamp, at_s(20.0));
  EXPECT_EQ(motion_->newest(), at_s(20.0));
  double squares = 0.0;
  int count = 0;
  for (std::int64_t k = 0; k <= 4000; ++k) {
    const Stamp stamp{k * 5'000'000};
    const RobotState exact = truth->true_state(stamp);
    EXPECT_NEAR(exact.q[0], smooth_position(stamp.seconds()), 1e-7);
    EXPECT_LT((motion_->truth(stamp)->q - exact.q).norm(), 1e-12);
    const Eigen::VectorXd error = motion_->measured(stamp)->q - exact.q;
    squares += error.squaredNorm();
    count += 3;
  }
  EXPECT_NEAR(std::sqrt(squares / count), 0.01, 3.0 * 0.01 / std::sqrt(2.0 * count));
  EXPECT_NEAR(motion_->planned(at_s(1.0))->q[0], 0.5, 1e-12);
}

TEST_F(SimulatedExecutorTest, StopsWithinItsAccelerationFromTheEndOfTheDelay) {
  options_.delay_s = 0.1;
  const auto executor = make();
  ASSERT_TRUE(executor->follow(smooth_step(), at_s(0.0)));
  clock_.set_s(1.0);  // is where the trajectory was at 0.9 s, and will see its first second
  ASSERT_TRUE(executor->stop());
  EXPECT_FALSE(motion_->planned(at_s(1.0)));
  clock_.set_s(5.0);
  const auto rest = executor->current();
  EXPECT_EQ(rest->state.qdot, Eigen::VectorXd::Zero(3));
  // At 1.1 s: position 0.5, velocity 0.75; brakes with 2.
  EXPECT_NEAR(rest->state.q[0], 0.5 + 0.75 * 0.75 / 4.0, 1e-3);
  EXPECT_NEAR(rest->state.q[1], -rest->state.q[0], 1e-9);
}

TEST_F(SimulatedExecutorTest, FollowsAStopThatBrakesHarderThanMotionsMay) {
  // x goes at 0.75 per s at 1 s, and stops by braking with 6: from 0.5 to 0.5 + 0.75^2 / 12.
  Trajectory stop = make_trajectory(3, 2, 0.125);
  stop.qdot(0)[0] = 0.75;
  stop.q(0)[0] = 0.5;
  stop.q(1)[0] = 0.5 + 0.5 * 0.75 * 0.125;
  const auto farthest_off = [&] {
    restart();
    const auto executor = make();
    Trajectory go = smooth_step();
    for (int i = 0; i < go.size(); ++i) go.q(i)[1] = go.qdot(i)[1] = 0.0;
    EXPECT_TRUE(executor->follow(go, at_s(0.0)));
    clock_.set_s(0.99);
    const auto accepted = executor->follow(stop, at_s(1.0));
    EXPECT_TRUE(accepted) << accepted.error().describe();
    double farthest = 0.0;
    for (int ms = 1000; ms <= 2000; ++ms) {
      clock_.set_s(1e-3 * ms);
      const double t = std::min(1e-3 * ms - 1.0, 0.125);
      const double exact = 0.5 + 0.75 * t - 3.0 * t * t;
      farthest = std::max(farthest, std::abs(q(*executor)[0] - exact));
    }
    return farthest;
  };
  EXPECT_GT(farthest_off(), 0.05) << "2 per s^2 need 0.14, not 0.05";
  for (Joint& joint : robot_->description().joints) joint.max_braking = 6.0;
  EXPECT_LT(farthest_off(), 1e-6);
}

TEST_F(SimulatedExecutorTest, StopsByItsBrakes) {
  for (Joint& joint : robot_->description().joints) joint.max_braking = 6.0;
  const auto executor = make();
  ASSERT_TRUE(executor->follow(smooth_step(), at_s(0.0)));
  clock_.set_s(1.0);  // at 0.5, with velocity 0.75
  ASSERT_TRUE(executor->stop());
  clock_.set_s(1.0 + 0.75 / 6.0 + 0.002);
  EXPECT_EQ(executor->current()->state.qdot, Eigen::VectorXd::Zero(3));
  EXPECT_NEAR(q(*executor)[0], 0.5 + 0.75 * 0.75 / 12.0, 1e-3);
}

TEST_F(SimulatedExecutorTest, TakesOverAtOnceWhereTheStartHasPassed) {
  const auto executor = make();
  clock_.set_s(0.4);
  // 0.2 s in, the trajectory is 0.028 away: near enough, and the robot catches up.
  ASSERT_TRUE(executor->follow(smooth_step(), at_s(0.2)));
  clock_.set_s(1.7);
  EXPECT_NEAR(q(*executor)[0], smooth_position(1.5), 1e-6);
  EXPECT_EQ(motion_->planned(at_s(1.2))->q[0], 0.5);
}

TEST_F(SimulatedExecutorTest, RefusesWhatItCannotFollowAndGoesOnAsBefore) {
  const auto executor = make();
  ASSERT_TRUE(executor->follow(smooth_step(), at_s(0.0)));
  clock_.set_s(0.5);
  const auto why = [&](const Trajectory& trajectory, double start_s = 1.0) {
    const auto done = executor->follow(trajectory, at_s(start_s));
    if (done) return std::string("followed");
    EXPECT_EQ(done.error().code, ErrorCode::kInvalidArgument);
    return done.error().describe();
  };
  EXPECT_THAT(why({}), HasSubstr("no joints"));
  EXPECT_THAT(why(make_trajectory(2, 3, 0.1)), HasSubstr("2 joints, robot 'ball' has 3"));
  Trajectory broken = smooth_step();
  broken.positions[7] = std::numeric_limits<double>::quiet_NaN();
  EXPECT_THAT(why(broken), HasSubstr("position at state 2, joint 1 is not a finite number"));
  // At 1 s the robot will be at 0.5, not at the origin.
  EXPECT_THAT(why(smooth_step()), HasSubstr("joint 'x' at 0, it will be at 0.5 then (at 1 s)"));
  // Peaks between support states that are slow themselves: 1.5 * 1 / 0.5.
  Trajectory fast = make_trajectory(3, 2, 0.5);
  fast.positions = {0.5, -0.5, 0.0, 0.5, -0.5, 1.0};
  EXPECT_THAT(why(fast), HasSubstr("joint 'z' at 3 per s after 0 s, its limit is 2"));
  EXPECT_THAT(why(smooth_step(2.9)), HasSubstr("its limit is 2"));
  clock_.set_s(1.5);
  EXPECT_NEAR(q(*executor)[0], smooth_position(1.5), 1e-7);
}

TEST_F(SimulatedExecutorTest, ExpectsAStoppedRobotWhereItsBrakesWillHaveBroughtIt) {
  const auto executor = make();
  ASSERT_TRUE(executor->follow(smooth_step(), at_s(0.0)));
  clock_.set_s(1.0);
  ASSERT_TRUE(executor->stop());
  Trajectory on = make_trajectory(3, 2, 1.0);
  const double rest = 0.5 + 0.75 * 0.75 / 4.0;
  on.positions = {rest, -rest, 0.0, rest, -rest, 0.3};
  EXPECT_TRUE(executor->follow(on, at_s(1.6)));
  on.positions = {0.5, -0.5, 0.0, rest, -rest, 0.3};
  EXPECT_FALSE(executor->follow(on, at_s(1.6)));
  clock_.set_s(3.0);
  EXPECT_NEAR(q(*executor)[2], 0.3, 1e-6);
}

TEST_F(SimulatedExecutorTest, StandsStillWhereTheClockJumpsBack) {
  const auto executor = make();
  ASSERT_TRUE(executor->follow(smooth_step(), at_s(0.0)));
  clock_.set_s(1.0);
  const Eigen::VectorXd before = q(*executor);
  clock_.set_s(0.2);
  EXPECT_EQ(q(*executor), before);
  EXPECT_EQ(executor->current()->stamp, at_s(1.0));
  clock_.set_s(1.5);
  EXPECT_NEAR(q(*executor)[0], smooth_position(1.5), 1e-7);
}

TEST_F(SimulatedExecutorTest, StartsWhereItIsToldTo) {
  options_.start = start("{z: -2.5, x: 1}");
  EXPECT_EQ(q(*make()), Eigen::Vector3d(1.0, 0.0, -2.5));
  const auto why = [&] {
    const auto made = create_executor(options_, host_->context());
    return made ? std::string("made") : made.error().describe();
  };
  options_.start = start("{z: -2.5, xx: 1}");
  EXPECT_THAT(why(), HasSubstr("run.yaml:1:15: robot 'ball' has no joint 'xx'"));
  options_.start = start("{z: 3.5}");
  EXPECT_THAT(why(), HasSubstr("run.yaml:1:5: joint 'z' cannot start at 3.5"));
  options_.start = start("{z: high}");
  EXPECT_THAT(why(), HasSubstr("run.yaml:1:5"));
  options_.start = start("[1, 2]");
  EXPECT_THAT(why(), HasSubstr("must be a map"));
  options_.start = Node();
  robot_->description().joints[1].lower = 0.5;
  EXPECT_THAT(why(), HasSubstr("joint 'y' cannot start at 0"));
}

TEST_F(SimulatedExecutorTest, NeedsARobot) {
  conformance::TestHost host;
  const auto made = create_executor(options_, host.context());
  ASSERT_FALSE(made);
  EXPECT_EQ(made.error().code, ErrorCode::kUnsupported);
}

TEST_F(SimulatedExecutorTest, CanBeStoppedFromAnotherThread) {
  const auto executor = make();
  ASSERT_TRUE(executor->follow(smooth_step(), at_s(0.0)));
  clock_.set_s(1.0);
  {
    const std::jthread other([&] { EXPECT_TRUE(executor->stop()); });
    for (int i = 0; i < 200; ++i) {
      clock_.set_s(1.0 + 0.001 * i);
      EXPECT_TRUE(executor->current());
    }
  }
  clock_.set_s(5.0);
  EXPECT_EQ(executor->current()->state.qdot, Eigen::VectorXd::Zero(3));
}

class SimulatedHead : public ::testing::Test {
 protected:
  std::unique_ptr<Executor> make(std::shared_ptr<const RobotModel> robot) {
    host_ = std::make_unique<conformance::TestHost>(
        1,
        conformance::TestHostParts{.robot = std::move(robot), .clock = &clock_, .motion = motion_});
    auto made = create_executor(options_, host_->context(3));
    if (!made) throw std::runtime_error(made.error().describe());
    return std::move(*made);
  }
  Options options_;
  conformance::ManualClock clock_;
  std::shared_ptr<RobotMotion> motion_ = std::make_shared<RobotMotion>(100.0);
  std::unique_ptr<conformance::TestHost> host_;
};

TEST_F(SimulatedHead, TurnsWithinItsLimitsLateAndStays) {
  options_.delay_s = 0.2;
  const auto executor = make(conformance::robot_with_head());
  ASSERT_TRUE(dynamic_cast<HeadTurner&>(*executor).turn_head({1.0, -0.4}));
  double pan_rad = 0.0, speed_radps = 0.0;
  for (int i = 1; i <= 400; ++i) {
    clock_.set_s(0.01 * i);
    ASSERT_TRUE(executor->current());
    const HeadAngles head = *motion_->head(at_s(0.01 * i));
    const double now_radps = (head.pan_rad - pan_rad) / 0.01;
    EXPECT_LE(now_radps, 1.0 + 1e-6) << i;                           // rad/s
    EXPECT_LE(std::abs(now_radps - speed_radps), 0.03 + 1e-3) << i;  // of 3 rad/s^2 in 10 ms
    if (i <= 20) {
      EXPECT_EQ(head.pan_rad, 0.0) << i;
    }
    pan_rad = head.pan_rad;
    speed_radps = now_radps;
  }
  EXPECT_NEAR(pan_rad, 1.0, 1e-4);
  EXPECT_NEAR(motion_->head(at_s(4.0))->tilt_rad, -0.4, 1e-4);
}

TEST_F(SimulatedHead, IsRefusedOfARobotWithoutOne) {
  const auto executor = make(testing_support::flying_ball(0.1));
  const auto turned = dynamic_cast<HeadTurner&>(*executor).turn_head({});
  ASSERT_FALSE(turned);
  EXPECT_THAT(turned.error().message, HasSubstr("has no head"));
}

}  // namespace
}  // namespace sidestep::simulated
