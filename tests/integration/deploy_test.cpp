#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <nlohmann/json.hpp>

#include "command_line.hpp"
#include "support/temporary_folder.hpp"

namespace sidestep::testing {
namespace {

using ::testing::HasSubstr;
using Json = nlohmann::json;

class DeployTest : public ::testing::Test {
 protected:
  Finished run_it(const std::vector<std::string>& sets = {}) {
    std::vector<std::string> arguments = {
        "run", std::string(SIDESTEP_SOURCE_DIR) + "/tests/integration/configs/tiny_deploy.yaml",
        "--out", folder_.path().string()};
    for (const std::string& set : sets) arguments.insert(arguments.end(), {"--set", set});
    Finished finished = run(arguments);
    summary_ = Json::parse(read_file(folder_.path() / "summary.json"), nullptr, false);
    return finished;
  }

  testing_support::TemporaryFolder folder_;
  Json summary_;
};

TEST_F(DeployTest, GoesWhereItIsSentOneGoalAfterTheOther) {
  const Finished finished = run_it();
  EXPECT_EQ(finished.exit_code, 1) << "two goals were given up" << finished.error;
  EXPECT_EQ(summary_["experiment"], "deploy");
  EXPECT_EQ(summary_["episodes"], 4);
  EXPECT_EQ(summary_["collisions_true"], 0);
  ASSERT_EQ(summary_["failures"].size(), 2U);
  EXPECT_EQ(summary_["failures"][0]["episode"], 1);
  EXPECT_EQ(summary_["failures"][0]["reason"], "another goal came: 4");
  EXPECT_EQ(summary_["failures"][1]["episode"], 3);
  EXPECT_EQ(summary_["failures"][1]["reason"], "told to stop");
  EXPECT_THAT(finished.error, HasSubstr("goal 3: refused"));
  EXPECT_THAT(finished.error, HasSubstr("robot 'point' has no joint 'z'"));
  EXPECT_THAT(finished.error, HasSubstr("goal 4: reached"));
}

TEST_F(DeployTest, EndsAfterSoManyGoals) {
  const Finished finished = run_it({"experiment.goals=1"});
  EXPECT_EQ(finished.exit_code, 0) << finished.error;
  EXPECT_EQ(summary_["episodes"], 1);
  EXPECT_EQ(summary_["success_share"], 1.0);
}

TEST_F(DeployTest, AGoalThatComesAtNoTimeIsAMistakeInTheConfiguration) {
  const Finished finished = run_it({"executor.goals=[{goal: {joints: {x: 1.0}}}]"});
  EXPECT_EQ(finished.exit_code, 2);
  EXPECT_THAT(finished.error, HasSubstr("the goal has no `at_s`"));
}

}  // namespace
}  // namespace sidestep::testing
