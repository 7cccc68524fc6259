#include <gtest/gtest.h>
#include <nlohmann/json.hpp>

#include "command_line.hpp"
#include "support/temporary_folder.hpp"

namespace sidestep::testing {
namespace {

using Json = nlohmann::json;

/// The closed loops that are shipped (configs/replan, and one of configs/sudden).
class Scenario : public ::testing::TestWithParam<const char*> {
 protected:
  /// The summary of the first episodes.
  [[nodiscard]] Json run_episodes(int count, const std::vector<std::string>& sets = {}) const {
    const std::string folder = std::string(GetParam()) == "living_room" ? "sudden/" : "replan/";
    const std::string config =
        std::string(SIDESTEP_SOURCE_DIR) + "/configs/" + folder + GetParam() + ".yaml";
    std::vector<std::string> arguments = {"run",   config,
                                          "--out", (folder_.path() / "run").string(),
                                          "--set", "experiment.episodes=" + std::to_string(count),
                                          "--set", "experiment.truth.measure=false"};
    for (const std::string& set : sets) arguments.insert(arguments.end(), {"--set", set});
    const Finished finished = run(arguments);
    EXPECT_LE(finished.exit_code, 1) << finished.error;
    return Json::parse(read_file(folder_.path() / "run" / "summary.json"), nullptr, false);
  }

  testing_support::TemporaryFolder folder_;
};

TEST_P(Scenario, ReachesItsGoalWithoutTouchingAnything) {
  const Json of = run_episodes(1);
  ASSERT_TRUE(of.contains("success_share"));
  EXPECT_EQ(of["success_share"], 1.0) << of["failures"];
  EXPECT_EQ(of["collisions_true"], 0);
  EXPECT_GT(of["min_true_clearance_m"], 0.0);
}

/// Or it would say nothing for the map. A robot moves only once something is in its map: what the
/// camera beside the arm sees nearer than this is air. It drives where it has not looked, or it
/// would stay where it is.
TEST_P(Scenario, IsNotPassedByARobotThatSeesNothing) {
  constexpr int kEpisodes = 5;
  const std::string range_m = std::string(GetParam()) == "arm_reach" ? "0.6" : "0.2";
  const Json of =
      run_episodes(kEpisodes, {"mapper.max_range_m=" + range_m, "replanner.unseen_start_m=100"});
  ASSERT_TRUE(of.contains("success_share"));
  EXPECT_EQ(of["success_share"], 0.0);
  EXPECT_GE(of["collisions_true"], kEpisodes);
}

INSTANTIATE_TEST_SUITE_P(Replan, Scenario,
                         ::testing::Values("floor_pickup", "shelf_pickup", "table_pickup",
                                           "room_navigation", "arm_reach", "living_room"),
                         [](const auto& scenario) { return std::string(scenario.param); });

}  // namespace
}  // namespace sidestep::testing
