// Goals that come over topics while the robot runs: what becomes of them as whoever sent them hears
// it (`rostopic echo`), and where the simulated robot says that it truly is.

#include <cmath>
#include <csignal>

#include <gtest/gtest.h>

#include "ros_world.hpp"

namespace sidestep::testing {
namespace {

constexpr const char* kOpenHall = SIDESTEP_SOURCE_DIR "/tests/ros/hall.yaml";
constexpr const char* kBase = "/move_base_simple/goal";
constexpr const char* kEndEffector = "/sidestep/goal/end_effector";
constexpr const char* kJoints = "/sidestep/goal/joints";
constexpr const char* kPose = "/sidestep/goal/pose";
constexpr double kPatience_s = 60.0;

class GoalsOverRos : public ::testing::Test {
 protected:
  void SetUp() override {
    if (!RosWorld::is_possible()) GTEST_SKIP() << RosWorld::kMissing;
    if (!RosWorld::has_tool("rostopic")) GTEST_SKIP() << "install python3-rostopic";
    world_.start_master();
    world_.start_fake(kOpenHall, {});
    world_.start_run("hsr_goals", {"executor.keep_in.lower_m=[-1.0, -1.0]",
                                   "executor.keep_in.upper_m=[1.5, 1.0]"});
    for (const char* name : {"result", "feedback"}) {
      auto& echo = std::string(name) == "result" ? results_ : feedback_;
      echo = world_.start_tool(name,
                               {"rostopic", "echo", "-p", std::string("/sidestep/goal/") + name});
    }
  }

  /// Says it, and whether what has become of the goal holds `text`.
  ::testing::AssertionResult answers(const std::vector<std::string>& words,
                                     const std::string& text) {
    if (!world_.say(words)) return ::testing::AssertionFailure() << "nobody listens";
    return hears(*results_, text);
  }
  ::testing::AssertionResult hears(ChildProcess& echo, const std::string& text) {
    if (echo.says(text, kPatience_s)) return ::testing::AssertionSuccess();
    return ::testing::AssertionFailure() << "not heard: " << text << "\n"
                                         << echo.log() << world_.run().log();
  }

  RosWorld world_;
  std::unique_ptr<ChildProcess> results_;
  std::unique_ptr<ChildProcess> feedback_;
};

TEST_F(GoalsOverRos, RefusesWhatMakesNoSenseAndSaysWhy) {
  const auto base = [](const std::string& frame, const std::string& x,
                       const std::vector<std::string>& orientation) {
    std::vector<std::string> words{"pose", kBase, frame, x, "0", "0"};
    words.insert(words.end(), orientation.begin(), orientation.end());
    return words;
  };
  const std::vector<std::string> upright{"0", "0", "0", "1"};
  // rostopic writes the status, here REJECTED, between id and text.
  const std::string refused = ",5,refused: ";
  const std::string of_base = refused + kBase + ": ";
  EXPECT_TRUE(answers(base("odom", "nan", upright), ",base_pose/1" + of_base + "a figure is not"));
  EXPECT_TRUE(answers(base("odom", "0.5", {"0", "0", "0", "0"}),
                      ",base_pose/2" + of_base + "a figure is not finite, or the orientation is"));
  EXPECT_TRUE(
      answers(base("moon", "0.5", upright), ",base_pose/3" + of_base + "tf knows no frame 'moon'"));
  EXPECT_TRUE(answers(base("", "0.5", upright), ",base_pose/4" + of_base + "it names no frame"));
  EXPECT_TRUE(answers(base("odom", "2.0", upright),
                      of_base + "the base is to be out of keep_in: odom_x at 2 m"));
  EXPECT_TRUE(answers(base("odom", "0.5", {"0.7071", "0", "0", "0.7071"}),
                      of_base + "the pose is not level"));
  EXPECT_TRUE(
      answers({"joints", kJoints, "arm_flex_joint=nan"},
              refused + kJoints + ": the position of joint 'arm_flex_joint' is not finite"));
  // What the robot itself cannot: its limits and names are the deployment's to check.
  EXPECT_TRUE(answers({"joints", kJoints, "arm_lift_joint=0.9"}, ",joints/8" + refused));
  EXPECT_TRUE(answers({"joints", kJoints, "arm_lift=0.2"}, ",joints/9" + refused));
  EXPECT_TRUE(answers({"text", kPose, "handstand"}, ",pose/10" + refused));
  // The hand, beside the column, would be lifted into the head.
  EXPECT_TRUE(answers({"joints", kJoints, "arm_lift_joint=0.2"}, ",joints/11" + refused));
  EXPECT_TRUE(answers({"pose", kEndEffector, "odom", "1.0", "0", "4.0", "0", "0", "0", "1"},
                      ",end_effector/12,4,failed: "))
      << "above any reach";
  for (const char* said :
       {"arm_lift_joint", "'arm_lift'", "'handstand'", "inside head_tilt_link"}) {
    EXPECT_NE(results_->log().find(said), std::string::npos) << results_->log();
  }
  world_.run().send(SIGINT);
  EXPECT_TRUE(world_.run().wait(kPatience_s));
  EXPECT_NE(world_.run().log().find("tf knows no frame 'moon'"), std::string::npos);
  const auto truth = world_.end_fake();
  ASSERT_TRUE(truth.is_object());
  EXPECT_EQ(truth["last_moved_unix_s"], 0.0);
}

TEST_F(GoalsOverRos, GoesWhereEachKindSaysAndStopsWhenTold) {
  // Who looks at the map meanwhile sees it: all old markers removed, and one list. Before the first
  // image there is no list.
  const auto look_at = [&](const std::string& name) {
    return world_.start_tool(name, {"rostopic", "echo", "--noarr", "/sidestep/" + name});
  };
  const auto voxels = look_at("voxels");
  const auto slice = look_at("field_slice");
  EXPECT_TRUE(answers({"text", kPose, "neutral"}, ",pose/1,3,reached"));
  EXPECT_TRUE(hears(*feedback_, ",pose/1,1,active"));
  // Half a metre ahead and a little to the left, turned to the left, as seen from the robot.
  const double yaw = 0.4;
  EXPECT_TRUE(answers({"pose", kBase, "base_footprint", "0.5", "0.2", "0", "0", "0",
                       std::to_string(std::sin(0.5 * yaw)), std::to_string(std::cos(0.5 * yaw))},
                      ",base_pose/2,3,reached"));
  EXPECT_TRUE(hears(*feedback_, "m or rad to go"));
  EXPECT_TRUE(hears(*voxels, "visualization_msgs/Marker, length: 2"));
  EXPECT_TRUE(hears(*slice, "visualization_msgs/Marker, length: 2"));
  EXPECT_TRUE(answers({"joints", kJoints, "wrist_roll_joint=0.6"}, ",joints/3,3,reached"));
  // Away, and called back; the next goal replaces nothing.
  ASSERT_TRUE(world_.say({"pose", kBase, "odom", "-0.9", "0", "0", "0", "0", "0", "1"}));
  ASSERT_TRUE(hears(*feedback_, ",base_pose/4,1,active"));
  EXPECT_TRUE(answers({"cancel", "/sidestep/goal/cancel", "base_pose/4"},
                      ",base_pose/4,2,replaced: told to stop"));
  ASSERT_TRUE(world_.say({"pose", kBase, "odom", "-0.9", "0", "0", "0", "0", "0", "1"}));
  ASSERT_TRUE(hears(*feedback_, ",base_pose/6,1,active"));
  EXPECT_TRUE(answers(
      {"pose", kEndEffector, "odom", "0.7", "0.1", "0.85", "0", "0.7071068", "0", "0.7071068"},
      ",base_pose/6,2,replaced: another goal came: end_effector/7"));
  EXPECT_TRUE(hears(*results_, ",end_effector/7,3,reached"));
  world_.run().send(SIGINT);
  EXPECT_TRUE(world_.run().wait(kPatience_s));

  const auto truth = world_.end_fake();
  ASSERT_TRUE(truth.is_object());
  EXPECT_EQ(truth["collisions_true"], 0) << truth.dump(2);
  EXPECT_EQ(truth["commands_refused"], 0);
  const auto palm_m = truth["at_end"]["links_m"]["hand_palm_link"];
  constexpr double kNear_m = 0.03;
  EXPECT_NEAR(palm_m[0].get<double>(), 0.7, kNear_m) << truth["at_end"].dump(2);
  EXPECT_NEAR(palm_m[1].get<double>(), 0.1, kNear_m);
  EXPECT_NEAR(palm_m[2].get<double>(), 0.85, kNear_m);
}

}  // namespace
}  // namespace sidestep::testing
