#include <filesystem>
#include <string>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <nlohmann/json.hpp>

#include <sidestep/runtime/results_store.hpp>

#include "command_line.hpp"
#include "support/temporary_folder.hpp"

namespace sidestep::testing {
namespace {

using ::testing::HasSubstr;

/// A ball around a pillar to where its goal leaves it, by planners of every kind.
class EndEffectorGoal : public ::testing::Test {
 protected:
  Finished plan(const std::string& optimiser, const std::string& end_effector,
                const std::vector<std::string>& sets = {}) {
    out_ = folder_.path() / std::to_string(++runs_);
    std::vector<std::string> arguments{
        "run",   std::string(SIDESTEP_SOURCE_DIR) + "/tests/integration/configs/tiny.yaml",
        "--out", out_.string(),
        "--set", "optimiser={plugin: " + optimiser + "}",
        "--set", "experiment.plans.0.goal=null",
        "--set", "experiment.plans.0.end_effector=" + end_effector};
    for (const std::string& set : sets) arguments.insert(arguments.end(), {"--set", set});
    return run(arguments);
  }
  /// Where the ball ends.
  [[nodiscard]] Eigen::Vector2d end_m() const {
    auto results = ResultsReader::open(out_ / "results.sqlite");
    EXPECT_TRUE(results) << results.error().describe();
    const auto x = (*results)->column("trajectory/0", "q.x").value();
    const auto y = (*results)->column("trajectory/0", "q.y").value();
    return {x.back(), y.back()};
  }
  [[nodiscard]] std::string reason() const {
    const auto summary = nlohmann::json::parse(read_file(out_ / "summary.json"));
    return summary.at("plans").at(0).at("reason");
  }

  testing_support::TemporaryFolder folder_;
  std::filesystem::path out_;  ///< Of the last run.
  int runs_ = 0;
};

class EveryOptimiser : public EndEffectorGoal, public ::testing::WithParamInterface<const char*> {};

TEST_P(EveryOptimiser, LeadsThere) {
  const Finished finished = plan(GetParam(), "{link: body, position_m: [2.7, -0.1, 0]}",
                                 {"planning.attempts=6", "planning.collision_margin_m=0.05"});
  ASSERT_EQ(finished.exit_code, 0) << finished.error << finished.out;
  EXPECT_LE((end_m() - Eigen::Vector2d(2.7, -0.1)).norm(), 3.1e-3);
}
INSTANTIATE_TEST_SUITE_P(Optimisers, EveryOptimiser,
                         ::testing::Values("gp_chain", "gp_ceres", "rrt_connect", "ompl", "chomp",
                                           "stomp", "trajopt"));

TEST_F(EndEffectorGoal, TakesTheNearestOfSeveral) {
  const std::string places =
      "{link: body, position_m: [2.7, 1.4, 0], within_m: [0.05, 0.05, 0], alternatives: "
      "[{position_m: [0.3, 0.8, 0]}]}";
  const Finished finished = plan("rrt_connect", places);
  ASSERT_EQ(finished.exit_code, 0) << finished.error << finished.out;
  EXPECT_NEAR(end_m().x(), 0.3, 0.06);
  EXPECT_NEAR(end_m().y(), 0.8, 0.06);
}

TEST_F(EndEffectorGoal, IsOfAToolsFrameToo) {
  const std::string tip =
      "experiment.plans.0.attached=[{name: tip, link: body, position_m: [0, 0.2, 0], frame_only: "
      "true}]";
  const Finished finished =
      plan("gp_chain", "{link: tip, position_m: [2.7, 0.3, 0]}", {tip, "planning.attempts=6"});
  ASSERT_EQ(finished.exit_code, 0) << finished.error << finished.out;
  EXPECT_LE((end_m() - Eigen::Vector2d(2.7, 0.1)).norm(), 3.1e-3);
}

/// What no configuration reaches is missed by as much as the ball is too low, whoever plans.
TEST_F(EndEffectorGoal, SaysWhereTheNearestIs) {
  for (const char* optimiser : {"gp_chain", "rrt_connect"}) {
    const Finished finished = plan(optimiser, "{link: body, position_m: [2.7, -0.1, 0.4]}");
    EXPECT_EQ(finished.exit_code, 1) << finished.out;
    EXPECT_THAT(reason(), HasSubstr("within the joints' limits none reaches the goal; the nearest "
                                    "ends with the position of body 0.4 m off its target"));
    EXPECT_THAT(reason(), HasSubstr("position_m: [2.7, -0.1, 0]"));
  }
}

TEST_F(EndEffectorGoal, OrAGoalIsNeeded) {
  const Finished finished = plan("gp_chain", "null");
  EXPECT_EQ(finished.exit_code, 2) << finished.out;
  EXPECT_THAT(finished.error, HasSubstr("plan 'around' says nowhere where the robot is to be"));
}

/// The sampler's path is a first guess where the straight line leads nowhere.
TEST_F(EndEffectorGoal, IsPlannedFromASamplersPathWhereOthersFail) {
  const std::vector<std::string> alone{"planning.attempts=1",
                                       "experiment.plans.0.end_effector=null",
                                       "experiment.plans.0.goal={joints: {x: 2.7, y: 0.05}}"};
  std::vector<std::string> sampled = alone;
  sampled.emplace_back("sampler={plugin: rrt_connect}");
  const Finished without = plan("gp_chain", "null", alone);
  EXPECT_EQ(without.exit_code, 1) << without.out;  // straight through the pillar
  const Finished with = plan("gp_chain", "null", sampled);
  EXPECT_EQ(with.exit_code, 0) << with.error << with.out;
}

}  // namespace
}  // namespace sidestep::testing
