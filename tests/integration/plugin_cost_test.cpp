#include <algorithm>
#include <filesystem>
#include <limits>

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <nlohmann/json.hpp>

#include <sidestep/runtime/results_store.hpp>

#include "command_line.hpp"
#include "support/temporary_folder.hpp"

namespace sidestep::testing {
namespace {

using ::testing::HasSubstr;

/// The ball around the pillar, with a cost that the template's plugin makes.
class PluginCostTest : public ::testing::Test {
 protected:
  [[nodiscard]] Finished run_with(const std::string& costs, const std::string& out) {
    return run({"run", std::string(SIDESTEP_SOURCE_DIR) + "/tests/integration/configs/tiny.yaml",
                "--out", (folder_.path() / out).string(), "--set", "optimiser.plugin=gp_chain",
                "--set", "plugin_paths=[" EXAMPLE_PLUGINS "]", "--set",
                "experiment.plans.0.costs=" + costs});
  }
  /// The lowest y of the trajectory.
  [[nodiscard]] double lowest_y_m(const std::string& out) const {
    auto results = ResultsReader::open(folder_.path() / out / "results.sqlite");
    EXPECT_TRUE(results) << results.error().describe();
    const auto y = (*results)->column("trajectory/0", "q.y").value();
    return y.empty() ? std::numeric_limits<double>::quiet_NaN() : *std::ranges::min_element(y);
  }

  testing_support::TemporaryFolder folder_;
};

TEST_F(PluginCostTest, IsFeltByThePlan) {
  const Finished without = run_with("[]", "without");
  ASSERT_EQ(without.exit_code, 0) << without.error << without.out;
  const Finished with = run_with(
      "[{cost: {plugin: keep_side, link: body, point_m: [0, -0.8, 0], normal: [0, -1, 0], "
      "sigma_m: 0.1}, at: support}]",
      "with");
  ASSERT_EQ(with.exit_code, 0) << with.error << with.out;
  EXPECT_LT(lowest_y_m("with"), lowest_y_m("without") - 0.1);
  const std::string effective = read_file(folder_.path() / "with" / "effective_config.yaml");
  EXPECT_THAT(effective, HasSubstr("keep_side"));
}

TEST_F(PluginCostTest, IsCheckedBeforeTheRun) {
  const auto refused = [&](const std::string& costs) {
    const Finished finished = run_with(costs, "refused");
    EXPECT_NE(finished.exit_code, 0) << costs;
    EXPECT_FALSE(std::filesystem::exists(folder_.path() / "refused" / "summary.json"));
    return finished.error;
  };
  EXPECT_THAT(refused("[{cost: {plugin: keep_sde, link: body}}]"), HasSubstr("keep_side"));
  EXPECT_THAT(refused("[{cost: {plugin: keep_side}}]"), HasSubstr("'link' is missing"));
  EXPECT_THAT(refused("[{cost: {plugin: keep_side, link: bdy}}]"), HasSubstr("no link 'bdy'"));
  EXPECT_THAT(refused("[{cost: {plugin: keep_side, link: body, normal: [0, 0, 0]}}]"),
              HasSubstr("has no direction"));
  EXPECT_THAT(refused("[{cost: {plugin: keep_side, link: body}, at: everywhere}]"),
              HasSubstr("everywhere"));
  EXPECT_THAT(refused("[{cost: {plugin: keep_side, link: body}, frees_goal: true}]"),
              HasSubstr("only a cost at the goal can free it"));
}

}  // namespace
}  // namespace sidestep::testing
