// The HSR's deployment over ROS 1, in wall-clock time, against a simulated robot of the same
// topics. What the robot touched is judged by that robot: the shapes of its URDF against the true
// scene.

#include <chrono>
#include <csignal>
#include <fstream>
#include <iterator>

#include <gtest/gtest.h>

#include "ros_world.hpp"
#include "support/temporary_folder.hpp"

namespace sidestep::testing {
namespace {

double unix_now_s() {
  return std::chrono::duration<double>(std::chrono::system_clock::now().time_since_epoch()).count();
}

/// In which nothing moves, and a metre ahead is free.
constexpr const char* kHall = SIDESTEP_SOURCE_DIR "/tests/ros/hall.yaml";
/// For tests that need no more than that the robot moves.
constexpr const char* kNear = "experiment.goal.joints.odom_x=0.3";

class Deployment : public ::testing::Test {
 protected:
  void SetUp() override {
    if (!RosWorld::is_possible()) GTEST_SKIP() << RosWorld::kMissing;
  }

  /// From full speed of the base, 0.12 m/s, at its 0.05 m/s^2.
  static constexpr double kBraking_s = 2.4;
  /// Beyond what detection and braking take, for a machine of two cores that does other things,
  /// too.
  static constexpr double kGrace_s = 1.0;
  static constexpr double kLongestRun_s = 120.0;
  RosWorld world_;
};

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
  world_.start("hsr_deploy", kHall, {"--silence", fault.part + "@3+5"},
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
                             PassingFault{"tf", ": dropped", 0.6},
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

TEST_F(Deployment, StopsWhenTheClockJumps) {
  world_.start_master();
  world_.start_fake(kHall, {});  // By the system's time, which does not jump.
  const auto time = world_.start_program("time", {ROS_SAY, "time", "3.0"});
  ASSERT_TRUE(time->says("the time is told", 20.0)) << time->log();
  world_.start_run("hsr_deploy", {"experiment.duration_s=12", "source.clock_tolerance_s=1.0",
                                  "executor.watch.clock_tolerance_s=1.0"});
  ASSERT_TRUE(world_.run().says("episode 0", 30.0)) << world_.run().log();
  (void)world_.run().wait(5.0);  // Under way.
  ASSERT_FALSE(world_.run().poll()) << world_.run().log();
  time->send(SIGUSR1);
  const double jumped_s = unix_now_s();
  EXPECT_EQ(world_.run().wait(kLongestRun_s), 1) << world_.run().log();
  EXPECT_NE(world_.run().log().find("ROS time jumped against the run's clock"), std::string::npos)
      << world_.run().log();
  const auto truth = world_.end_fake();
  ASSERT_TRUE(truth.is_object());
  const double stopped_s = truth["last_moved_unix_s"].get<double>() - jumped_s;
  EXPECT_GT(stopped_s, 0.0) << "it did not move when the clock jumped";
  EXPECT_LE(stopped_s, kBraking_s + kGrace_s);
  EXPECT_EQ(truth["collisions_true"], 0);
  std::printf("clock jumped: at rest after %.2f s\n", stopped_s);
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

/// The HSR's base by speeds in place of its controller, as it is and on two wheels.
class BaseDrivenByTwists : public Deployment, public ::testing::WithParamInterface<const char*> {
 protected:
  /// A run with these, of the robot whose base is of the type that the test is of.
  void start(const std::vector<std::string>& set) {
    std::ifstream in(SIDESTEP_SOURCE_DIR "/robots/hsr/profile.yaml");
    std::string profile(std::istreambuf_iterator<char>(in), {});
    const auto replace = [&](const std::string& from, const std::string& to) {
      const auto at = profile.find(from);
      ASSERT_NE(at, std::string::npos) << from;
      profile.replace(at, from.size(), to);
    };
    replace("type: holonomic", std::string("type: ") + GetParam());
    replace("urdf: robot.urdf", "urdf: " SIDESTEP_SOURCE_DIR "/robots/hsr/robot.urdf");
    const std::string file = folder_.path() / "profile.yaml";
    std::ofstream(file) << profile;
    std::vector<std::string> all{
        "robot.profile=" + file, "executor.twist.topic=/hsrb/command_velocity",
        "executor.controllers=[{command_topic: /hsrb/arm_trajectory_controller/command, joints: "
        "[arm_lift_joint, arm_flex_joint, arm_roll_joint, wrist_flex_joint, wrist_roll_joint]}, "
        "{command_topic: /hsrb/head_trajectory_controller/command, joints: "
        "[head_pan_joint, head_tilt_joint]}]"};
    all.insert(all.end(), set.begin(), set.end());
    world_.start("hsr_deploy", kHall, {"--profile", file}, all);
  }

  testing_support::TemporaryFolder folder_;
};

TEST_P(BaseDrivenByTwists, ReachesAGoalToTheSide) {
  start({"experiment.duration_s=60", "experiment.goal.joints.odom_y=-0.5",
         "experiment.goal.joints.odom_t=-0.6"});
  EXPECT_EQ(world_.run().wait(kLongestRun_s), 0) << world_.run().log();
  const auto truth = world_.end_fake();
  ASSERT_TRUE(truth.is_object());
  EXPECT_EQ(truth["collisions_true"], 0);
  EXPECT_EQ(truth["commands"]["omni_base_controller"], 0);
  EXPECT_GT(truth["commands"]["command_velocity"], 100);
  EXPECT_LT(truth["speed_at_end"].get<double>(), 0.02);
  const auto summary = world_.run_summary();
  std::printf("%s: %.1f s, %d stops\n", GetParam(), truth["duration_s"].get<double>(),
              summary["stops"].get<int>());
}

TEST_P(BaseDrivenByTwists, ComesToRestWhenNobodyDrivesItAnyMore) {
  start({"experiment.duration_s=40"});
  ASSERT_TRUE(world_.fake().says("motion 1 begins", 30.0)) << world_.run().log();
  (void)world_.run().wait(4.0);
  ASSERT_FALSE(world_.run().poll()) << world_.run().log();
  world_.run().send(SIGKILL);
  const double killed_s = unix_now_s();
  (void)world_.run().wait(5.0);
  constexpr double kTwistPatience_s = 0.25;  // the fake's
  (void)world_.master().wait(kBraking_s + 2.0 * kGrace_s);
  const auto truth = world_.end_fake();
  ASSERT_TRUE(truth.is_object());
  const double stopped_s = truth["last_moved_unix_s"].get<double>() - killed_s;
  EXPECT_GT(stopped_s, 0.0) << "it did not move when the run was killed";
  EXPECT_LE(stopped_s, kTwistPatience_s + kBraking_s + kGrace_s);
}

INSTANTIATE_TEST_SUITE_P(OfEachType, BaseDrivenByTwists,
                         ::testing::Values("holonomic", "differential"),
                         [](const auto& tested) { return std::string(tested.param); });

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
  world_.start("hsr_deploy", kHall, {},
               {"executor.mode=shadow", "experiment.duration_s=20", kNear});
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
  world_.start("hsr_deploy", kHall, {},
               {"executor.mode=confirm", "experiment.duration_s=40", kNear});
  ASSERT_TRUE(world_.run().says("waits for a yes on /sidestep/confirm", 30.0))
      << world_.run().log();
  ASSERT_TRUE(world_.say({"bool", "/sidestep/confirm", "true"}));
  EXPECT_EQ(world_.run().wait(kLongestRun_s), 0) << world_.run().log();
  EXPECT_NE(world_.run().log().find("the operator confirmed the motion"), std::string::npos);
  const auto truth = world_.end_fake();
  ASSERT_TRUE(truth.is_object());
  EXPECT_GT(truth["last_moved_unix_s"], 0.0);
  EXPECT_EQ(truth["collisions_true"], 0);
}

TEST_F(Deployment, StopsWhileTheEmergencyStopIsPressedAndWhileTheBatteryIsLow) {
  world_.start("hsr_deploy", kHall, {},
               {"experiment.duration_s=60", "executor.watch.stop_topic=/hsrb/runstop_button",
                "executor.watch.battery_topic=/hsrb/battery_state"});
  ASSERT_TRUE(world_.run().says("episode 0", 30.0)) << world_.run().log();
  (void)world_.run().wait(4.0);  // Under way.
  ASSERT_FALSE(world_.run().poll()) << world_.run().log();
  ASSERT_TRUE(world_.say({"bool", "/hsrb/runstop_button", "true"}));
  ASSERT_TRUE(world_.run().says("the emergency stop on /hsrb/runstop_button is pressed", 5.0))
      << world_.run().log();
  ASSERT_TRUE(world_.fake().says("motion 1 ends", 10.0)) << world_.fake().log();
  ASSERT_TRUE(world_.say({"bool", "/hsrb/runstop_button", "false"}));
  ASSERT_TRUE(world_.fake().says("motion 2 begins", 20.0)) << world_.run().log();
  ASSERT_TRUE(world_.say({"battery", "/hsrb/battery_state", "0.08"}));
  ASSERT_TRUE(world_.run().says("the battery on /hsrb/battery_state is at 0.08", 5.0))
      << world_.run().log();
  ASSERT_TRUE(world_.say({"battery", "/hsrb/battery_state", "0.5"}));
  EXPECT_EQ(world_.run().wait(kLongestRun_s), 0) << world_.run().log();
  const auto truth = world_.end_fake();
  ASSERT_TRUE(truth.is_object());
  EXPECT_EQ(truth["collisions_true"], 0);
  EXPECT_GE(world_.run_summary()["stops"].get<int>(), 2);
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

/// As the tutorial has it: roslaunch starts the robot's stand-in and the run, and ends with the
/// run.
TEST_F(Deployment, IsLaunchedByRoslaunch) {
  if (!RosWorld::has_tool("roslaunch")) GTEST_SKIP() << "install python3-roslaunch";
  world_.start_master();
  const auto launched = world_.start_tool(
      "roslaunch",
      {"roslaunch", "sidestep", "hsr.launch", std::string("fake:=") + kHall,
       "configuration:=" SIDESTEP_SOURCE_DIR "/configs/ros1/hsr_deploy.yaml",
       "out:=" + world_.run_folder().string(), "options:=--set experiment.goal.joints.odom_x=0.2"});
  if (!launched->wait(kLongestRun_s)) {
    // What it started leads groups of its own, and ends with it only where it is asked to end.
    launched->send(SIGINT);
    EXPECT_TRUE(launched->wait(kLongestRun_s));
    FAIL() << launched->log();
  }
  const auto summary = world_.run_summary();
  ASSERT_TRUE(summary.is_object()) << launched->log();
  EXPECT_EQ(summary["success"], true) << summary.dump(2);
}

}  // namespace
}  // namespace sidestep::testing
