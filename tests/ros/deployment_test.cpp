// The HSR's deployment over ROS 1, in wall-clock time, against a simulated robot of the same
// topics. What the robot touched is judged by that robot: the shapes of its URDF against the true
// scene.

#include <chrono>
#include <csignal>

#include <gtest/gtest.h>

#include "ros_world.hpp"

namespace sidestep::testing {
namespace {

double unix_now_s() {
  return std::chrono::duration<double>(std::chrono::system_clock::now().time_since_epoch()).count();
}

/// In which nothing moves, and a metre ahead is free.
constexpr const char* kHall = SIDESTEP_SOURCE_DIR "/tests/ros/hall.yaml";

class Deployment : public ::testing::Test {
 protected:
  void SetUp() override {
    if (!RosWorld::is_possible()) GTEST_SKIP() << "install python3-rosmaster";
  }

  /// From full speed of the base, 0.12 m/s, at its 0.05 m/s^2.
  static constexpr double kBraking_s = 2.4;
  /// Beyond what detection and braking take, for a machine of two cores that does other things,
  /// too.
  static constexpr double kGrace_s = 1.0;
  static constexpr double kLongestRun_s = 120.0;
  RosWorld world_;
};

TEST_F(Deployment, PicksUpFromTheFloorWithoutTouchingAnything) {
  world_.start("floor_pickup", "floor_pickup", {}, {});
  const auto code = world_.run().wait(kLongestRun_s);
  const auto truth = world_.end_fake();
  ASSERT_EQ(code, 0) << world_.run().log();
  ASSERT_TRUE(truth.is_object());
  EXPECT_EQ(truth["collisions_true"], 0) << truth.dump(2);
  EXPECT_GT(truth["min_true_clearance_m"], 0.0);
  EXPECT_GT(truth["poses_judged"].get<double>() / truth["duration_s"].get<double>(), 100.0);
  EXPECT_EQ(truth["commands_refused"], 0);
  const auto summary = world_.run_summary();
  ASSERT_TRUE(summary.is_object());
  std::printf(
      "image stamp to trajectory command: p50 %.1f ms, p95 %.1f ms; least true clearance %.3f m\n",
      summary["stamp_to_trajectory_ms"]["p50"].get<double>(),
      summary["stamp_to_trajectory_ms"]["p95"].get<double>(),
      truth["min_true_clearance_m"].get<double>());
}

/// A fault that passes: the robot stops in time, says why, and goes on to its goal.
struct PassingFault {
  std::string part;
  std::string cause;  ///< Of the stop.
  double detected_s;  ///< Within which it is noticed.

  friend void PrintTo(const PassingFault& fault, std::ostream* out) { *out << fault.part; }
};

class PassingFaults : public Deployment, public ::testing::WithParamInterface<PassingFault> {};

TEST_P(PassingFaults, StopTheRobotWhichThenGoesOn) {
  const PassingFault& fault = GetParam();
  // At full speed by 2.4 s.
  world_.start("hsr_deploy", kHall, {"--silence", fault.part + "@3+6"},
               {"experiment.duration_s=40"});
  const auto code = world_.run().wait(kLongestRun_s);
  const auto truth = world_.end_fake();
  ASSERT_TRUE(truth.is_object());
  EXPECT_EQ(code, 0) << world_.run().log();
  EXPECT_NE(world_.run().log().find(fault.cause), std::string::npos) << world_.run().log();
  EXPECT_EQ(truth["collisions_true"], 0);
  const auto silence = truth["silences"][0];
  ASSERT_GT(silence["speed_then"].get<double>(), 0.05) << truth.dump(2);
  ASSERT_TRUE(silence["at_rest_after_s"].is_number()) << truth.dump(2);
  EXPECT_LE(silence["at_rest_after_s"].get<double>(), fault.detected_s + kBraking_s + kGrace_s)
      << truth.dump(2);
  std::printf("%s silent: at rest after %.2f s\n", fault.part.c_str(),
              silence["at_rest_after_s"].get<double>());
}

INSTANTIATE_TEST_SUITE_P(OfEachParticipant, PassingFaults,
                         ::testing::Values(
                             // max_map_age_s of the replanner; of the executor's watch, the others.
                             PassingFault{"camera", "has given no frame since", 0.5},
                             PassingFault{"joint_states", "the newest joint state of joint", 0.2},
                             PassingFault{"odom", "the newest odometry of joint", 0.2},
                             PassingFault{"tf", "source ros1: dropped", 0.6},
                             PassingFault{"controller",
                                          "/hsrb/omni_base_controller/state has been silent", 0.5}),
                         [](const auto& tested) { return tested.param.part; });

TEST_F(Deployment, StopsWhenTheMasterIsGone) {
  world_.start("hsr_deploy", kHall, {}, {"experiment.duration_s=12"});
  ASSERT_TRUE(world_.run().says("episode 0", 30.0)) << world_.run().log();
  (void)world_.run().wait(5.0);  // Under way.
  ASSERT_FALSE(world_.run().poll()) << world_.run().log();
  world_.master().send(SIGKILL);
  const double killed_s = unix_now_s();
  const auto code = world_.run().wait(kLongestRun_s);
  const auto truth = world_.end_fake();
  EXPECT_EQ(code, 1) << world_.run().log();
  EXPECT_NE(world_.run().log().find("the ROS master has not answered"), std::string::npos)
      << world_.run().log();
  ASSERT_TRUE(truth.is_object());
  constexpr double kMasterSilence_s = 2.5;
  const double stopped_s = truth["last_moved_unix_s"].get<double>() - killed_s;
  EXPECT_GT(stopped_s, 0.0) << "it did not move when the master died";
  EXPECT_LE(stopped_s, kMasterSilence_s + kBraking_s + kGrace_s);
  EXPECT_EQ(truth["collisions_true"], 0);
  std::printf("master gone: at rest after %.2f s\n", stopped_s);
}

TEST_F(Deployment, ComesToRestByItselfWhenNobodyCommandsItAnyMore) {
  world_.start("hsr_deploy", kHall, {}, {"experiment.duration_s=40"});
  ASSERT_TRUE(world_.run().says("episode 0", 30.0)) << world_.run().log();
  (void)world_.run().wait(5.0);
  ASSERT_FALSE(world_.run().poll()) << world_.run().log();
  world_.run().send(SIGKILL);
  const double killed_s = unix_now_s();
  (void)world_.run().wait(5.0);
  // Longer than it may take, so that what still moved would be seen.
  constexpr double kHorizon_s = 1.0;
  (void)world_.master().wait(kHorizon_s + kBraking_s + 2.0 * kGrace_s);
  const auto truth = world_.end_fake();
  ASSERT_TRUE(truth.is_object());
  const double stopped_s = truth["last_moved_unix_s"].get<double>() - killed_s;
  EXPECT_GT(stopped_s, 0.0) << "it did not move when the run was killed";
  EXPECT_LE(stopped_s, kHorizon_s + kBraking_s + kGrace_s);
  EXPECT_LT(truth["speed_at_end"].get<double>(), 1e-3);
  std::printf("sidestep killed: at rest after %.2f s\n", stopped_s);
}

TEST_F(Deployment, WithoutAMasterSaysWhereItLooked) {
  world_.start_run("hsr_deploy", {"source.connect_wait_s=0.5"});
  EXPECT_NE(world_.run().wait(kLongestRun_s).value_or(0), 0);
  EXPECT_NE(world_.run().log().find("no ROS master answers at ROS_MASTER_URI=http://127.0.0.1:"),
            std::string::npos)
      << world_.run().log();
}

TEST_F(Deployment, WithoutACameraSaysWhatIsMissing) {
  world_.start_master();
  world_.start_fake(kHall, {});
  world_.start_run("hsr_deploy", {"source.topic=/elsewhere", "source.connect_wait_s=2.0"});
  EXPECT_NE(world_.run().wait(kLongestRun_s).value_or(0), 0);
  EXPECT_NE(world_.run().log().find("nothing has come on /elsewhere"), std::string::npos)
      << world_.run().log();
}

TEST_F(Deployment, ShadowCommandsNothing) {
  world_.start("hsr_deploy", kHall, {}, {"executor.mode=shadow", "experiment.duration_s=20"});
  const auto code = world_.run().wait(kLongestRun_s);
  const auto truth = world_.end_fake();
  EXPECT_EQ(code, 0) << world_.run().log();
  ASSERT_TRUE(truth.is_object());
  for (const auto& [controller, count] : truth["commands"].items()) {
    EXPECT_EQ(count, 0) << controller;
  }
  EXPECT_EQ(truth["last_moved_unix_s"], 0.0);
}

TEST_F(Deployment, ConfirmDoesNotMoveWithoutAYes) {
  world_.start("hsr_deploy", kHall, {}, {"executor.mode=confirm", "experiment.duration_s=4"});
  EXPECT_EQ(world_.run().wait(kLongestRun_s), 1) << world_.run().log();
  const auto truth = world_.end_fake();
  EXPECT_NE(world_.run().log().find("waits for a yes on /sidestep/confirm"), std::string::npos)
      << world_.run().log();
  ASSERT_TRUE(truth.is_object());
  EXPECT_EQ(truth["last_moved_unix_s"], 0.0);
}

TEST_F(Deployment, ConfirmMovesOnceAYesHasCome) {
  world_.start("hsr_deploy", kHall, {}, {"executor.mode=confirm", "experiment.duration_s=40"});
  ASSERT_TRUE(world_.run().says("waits for a yes on /sidestep/confirm", 30.0))
      << world_.run().log();
  ASSERT_TRUE(world_.say("/sidestep/confirm", true));
  EXPECT_EQ(world_.run().wait(kLongestRun_s), 0) << world_.run().log();
  EXPECT_NE(world_.run().log().find("the operator confirmed the motion"), std::string::npos);
  const auto truth = world_.end_fake();
  ASSERT_TRUE(truth.is_object());
  EXPECT_GT(truth["last_moved_unix_s"], 0.0);
  EXPECT_EQ(truth["collisions_true"], 0);
}

TEST_F(Deployment, StopsWhileTheEmergencyStopIsPressed) {
  world_.start("hsr_deploy", kHall, {},
               {"experiment.duration_s=40", "executor.watch.stop_topic=/hsrb/runstop_button"});
  ASSERT_TRUE(world_.run().says("episode 0", 30.0)) << world_.run().log();
  (void)world_.run().wait(4.0);  // Under way.
  ASSERT_FALSE(world_.run().poll()) << world_.run().log();
  ASSERT_TRUE(world_.say("/hsrb/runstop_button", true));
  ASSERT_TRUE(world_.run().says("the emergency stop on /hsrb/runstop_button is pressed", 5.0))
      << world_.run().log();
  ASSERT_TRUE(world_.say("/hsrb/runstop_button", false));
  EXPECT_EQ(world_.run().wait(kLongestRun_s), 0) << world_.run().log();
  const auto truth = world_.end_fake();
  ASSERT_TRUE(truth.is_object());
  EXPECT_EQ(truth["collisions_true"], 0);
  EXPECT_GE(world_.run_summary()["stops"].get<int>(), 1);
}

TEST_F(Deployment, RefusesToLeaveTheBox) {
  world_.start("hsr_deploy", kHall, {},
               {"experiment.duration_s=4", "executor.keep_in.lower_m=[-0.5, -0.5]",
                "executor.keep_in.upper_m=[0.5, 0.5]"});
  EXPECT_EQ(world_.run().wait(kLongestRun_s), 1) << world_.run().log();
  const auto truth = world_.end_fake();
  ASSERT_TRUE(truth.is_object());
  EXPECT_EQ(truth["last_moved_unix_s"], 0.0);
  const auto summary = world_.run_summary();
  ASSERT_TRUE(summary.is_object());
  EXPECT_NE(summary.dump().find("out of keep_in"), std::string::npos) << summary.dump(2);
}

}  // namespace
}  // namespace sidestep::testing
