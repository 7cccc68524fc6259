// What must not be called a success: a map of nothing, a way that nobody has seen, a hand below the
// floor; and frames that were left out are told.

#include <regex>

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <nlohmann/json.hpp>

#include "command_line.hpp"
#include "support/temporary_folder.hpp"

namespace sidestep::testing {
namespace {

namespace fs = std::filesystem;
using ::testing::HasSubstr;
using ::testing::Not;
using Json = nlohmann::json;

const std::string kSources = SIDESTEP_SOURCE_DIR;
const std::string kSmall = kSources + "/tests/integration/configs/tiny.yaml";
const std::string kKitchenFrames = std::string(SIDESTEP_SHARED_DATA) + "/kinect_kitchen";

class UnseenTest : public ::testing::Test {
 protected:
  [[nodiscard]] Finished run_it(const std::string& config, const std::vector<std::string>& sets) {
    std::vector<std::string> arguments = {"run", config, "--out", (folder_ / "run").string()};
    for (const std::string& set : sets) {
      arguments.emplace_back("--set");
      arguments.push_back(set);
    }
    return run(arguments);
  }
  [[nodiscard]] Json summary() const {
    return Json::parse(read_file(folder_ / "run" / "summary.json"), nullptr, false);
  }
  [[nodiscard]] std::string reason() const { return summary().at("plans").at(0).at("reason"); }

  testing_support::TemporaryFolder own_folder_;
  fs::path folder_ = own_folder_.path();
};

TEST_F(UnseenTest, AMapOfNothingIsNoSuccessAndTellsWhatWouldHoldThePoints) {
  const std::vector<std::string> elsewhere = {"mapper.origin_m=[40,40,0]", "planning.outside=free"};
  const Finished finished = run_it(kSmall, elsewhere);
  EXPECT_EQ(finished.exit_code, 1) << finished.error;
  EXPECT_THAT(finished.out, HasSubstr("Failed: the map is empty: no point of any frame lies in"));
  EXPECT_TRUE(summary().at("plans").empty());
  EXPECT_EQ(summary().at("success"), false);

  const std::string verdict = summary().at("verdict");
  std::smatch held;
  ASSERT_TRUE(std::regex_search(
      verdict, held,
      std::regex(R"((mapper\.origin_m): (\[.*?\]) and (mapper\.size_vox): (\[.*?\]))")))
      << verdict;
  const Finished moved = run_it(kSmall, {held.str(1) + "=" + held.str(2),
                                         held.str(3) + "=" + held.str(4), "planning.outside=free"});
  EXPECT_GT(summary().at("/map/occupied_vox"_json_pointer), 0) << moved.out;
  EXPECT_THAT(moved.out, Not(HasSubstr("the map is empty")));
}

TEST_F(UnseenTest, AMapWithoutWhatTheCameraSawIsNoSuccess) {
  // All of the room passes for its floor.
  const Finished finished = run_it(kSmall, {"mapper.floor_clearance_m=5"});
  EXPECT_EQ(finished.exit_code, 1) << finished.error;
  EXPECT_EQ(summary().at("/map/occupied_vox"_json_pointer), 0);
  EXPECT_THAT(finished.out, HasSubstr("points lie in the map, but it holds none of them"));
}

TEST_F(UnseenTest, NoRobotMovesInAMapOfNothing) {
  const Finished finished =
      run_it(kSources + "/tests/integration/configs/tiny_deploy.yaml",
             {"mapper.origin_m=[40,40,0]", "planning.outside=free", "experiment.duration_s=5",
              "executor.goals=[{at_s: 0.5, goal: {joints: {x: 0.3}}}]"});
  EXPECT_EQ(finished.exit_code, 1) << finished.out;
  EXPECT_THAT(finished.error, HasSubstr("the map is empty: nothing that frame 0 measured lies in"));
}

TEST_F(UnseenTest, FramesWithoutDepthAreNoSuccess) {
  const Finished finished = run_it(
      kSmall, {"source.camera_path=[{time_s: 0, position_m: [0, 0, 1], look_at_m: [0.1, 0, 9]}]"});
  EXPECT_EQ(finished.exit_code, 1) << finished.error;
  EXPECT_THAT(finished.out, HasSubstr("no frame has a single valid depth"));
}

TEST_F(UnseenTest, AWayThatNobodyHasSeenIsNoSuccess) {
  const std::vector<std::string> far_off = {"planning.outside=free",
                                            "experiment.plans.0.start.joints={x: 6, y: 6}",
                                            "experiment.plans.0.goal.joints={x: 7, y: 6}"};
  const Finished finished = run_it(kSmall, far_off);
  EXPECT_EQ(finished.exit_code, 1) << finished.out;
  EXPECT_EQ(summary().at("/plans/0/unknown_share"_json_pointer), 1.0);
  EXPECT_THAT(reason(),
              HasSubstr("body is in space that no frame has seen or outside the map in 100.0 % "
                        "of its checks"));
  EXPECT_THAT(reason(), HasSubstr("planning.max_unknown_share is 10.0 %"));
  std::vector<std::string> allowed = far_off;
  allowed.emplace_back("planning.max_unknown_share=1");
  const Finished told = run_it(kSmall, allowed);
  EXPECT_EQ(told.exit_code, 0) << told.out;
  EXPECT_THAT(told.out, HasSubstr("at least 0.500 m clear, as far as was looked"));
  EXPECT_EQ(summary().at("/plans/0/clearance_is_bound"_json_pointer), true);
}

TEST_F(UnseenTest, TheLimitOfWhatIsUnseenIsRefusedWhereNothingKeepsIt) {
  for (const std::string config : {"tiny_replan", "tiny_planners", "tiny_study"}) {
    const Finished checked =
        run({"check", kSources + "/tests/integration/configs/" + config + ".yaml", "--set",
             "planning.max_unknown_share=0.5"});
    EXPECT_EQ(checked.exit_code, 2) << config << checked.out;
    EXPECT_THAT(checked.error, HasSubstr("max_unknown_share"));
  }
}

TEST_F(UnseenTest, FramesThatAreLeftOutAreTold) {
  const Finished finished = run_it(kSmall, {"experiment.max_frames=4"});
  EXPECT_THAT(finished.out, HasSubstr("mapped the first 4 of 8 frames"));
  EXPECT_THAT(read_file(folder_ / "run" / "run.log"), HasSubstr("mapped the first 4 of 8 frames"));
  EXPECT_EQ(summary().at("/map/left_out"_json_pointer), "mapped the first 4 of 8 frames");
  EXPECT_EQ(summary().at("frames"), 4);
}

/// The HSR, sent below the floor of a configuration that says nothing of one.
class BelowTheFloor : public UnseenTest {
 protected:
  void expect_refused(const std::string& config, const std::vector<std::string>& source,
                      const std::string& base) {
    const std::string goal =
        "experiment.plans.0.goal={pose: reach_floor, joints: {" + base + ", arm_lift_joint: 0.0}}";
    std::vector<std::string> sets = source;
    sets.push_back(goal);
    const Finished joints = run_it(config, sets);
    EXPECT_EQ(joints.exit_code, 1) << joints.out;
    EXPECT_THAT(reason(), HasSubstr("below the floor"));
    sets.push_back("experiment.plans.0.end_effector={link: hand_palm_link, position_m: " + palm_ +
                   "}");
    const Finished palm = run_it(config, sets);
    EXPECT_EQ(palm.exit_code, 1) << palm.out;
    EXPECT_THAT(reason(), HasSubstr("hand_palm_link is to be 0.030 m below the floor"));
  }
  std::string palm_;
};

TEST_F(BelowTheFloor, IsRefusedInTheRoom) {
  palm_ = "[-0.6, -0.1, -0.03]";
  expect_refused(kSources + "/configs/demo.yaml", {"source.frames=40"},
                 "odom_x: -0.6, odom_y: -0.6, odom_t: 1.57");
}

TEST_F(BelowTheFloor, IsRefusedInTheKitchen) {
  if (!fs::exists(kKitchenFrames)) GTEST_SKIP() << "no data at " << kKitchenFrames;
  palm_ = "[1.3, 1.6, -0.03]";
  expect_refused(kSources + "/configs/kitchen_hsr_gp.yaml",
                 {"source.path=" + kKitchenFrames, "source.stride=10"},
                 "odom_x: 0.95, odom_y: 1.4, odom_t: 0.6");
}

// Its configuration names no floor, nor does the one that it builds on.
TEST_F(BelowTheFloor, IsRefusedInTheClosedLoop) {
  const Finished palm =
      run_it(kSources + "/configs/replan/floor_pickup.yaml",
             {"experiment.duration_s=3",
              "experiment.end_effector={link: hand_palm_link, position_m: [0.9, 0.1, -0.03]}"});
  EXPECT_EQ(palm.exit_code, 1) << palm.out;
  EXPECT_THAT(palm.out, HasSubstr("hand_palm_link is to be 0.030 m below the floor"));
}

}  // namespace
}  // namespace sidestep::testing
