#include <fstream>

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <nlohmann/json.hpp>

#include "command_line.hpp"
#include "support/temporary_folder.hpp"

namespace sidestep::testing {
namespace {

using ::testing::AllOf;
using ::testing::HasSubstr;
using Json = nlohmann::json;

/// A closed loop among people who cross its way, of whom it is given the truth.
class CrowdTest : public ::testing::Test {
 protected:
  [[nodiscard]] Finished run_it(const std::string& configuration,
                                const std::vector<std::string>& sets) const {
    std::vector<std::string> arguments = {"run", configuration, "--out",
                                          (folder_.path() / "run").string()};
    for (const std::string& set : sets) arguments.insert(arguments.end(), {"--set", set});
    return run(arguments);
  }
  [[nodiscard]] Json summary() const {
    return Json::parse(read_file(folder_.path() / "run" / "summary.json"), nullptr, false);
  }
  /// Cases as CrowdNav has them, with people who walk from place to place.
  [[nodiscard]] std::string cases(const Json& people_of_cases) const {
    Json all = {{"time_step_s", 0.25},
                {"time_limit_s", 25.0},
                {"robot", {{"start", {0.0, -4.0}}, {"goal", {0.0, 4.0}}}},
                {"people", {{"radius_m", 0.3}, {"preferred_speed_mps", 1.0}}},
                {"cases", Json::array()}};
    for (const Json& people : people_of_cases) all["cases"].push_back({{"people", people}});
    const auto file = folder_.path() / "cases.json";
    std::ofstream(file) << all.dump();
    return "experiment.cases=" + file.string();
  }

  testing_support::TemporaryFolder folder_;
};

Json walk(double x0, double y0, double x1, double y1) {
  return {{"start", {x0, y0}}, {"goal", {x1, y1}}};
}

TEST_F(CrowdTest, CrossesAmongPeopleWhoDoNotSeeIt) {
  const std::string set = cases({{walk(-4.0, 0.0, 4.0, 0.1), walk(0.1, 4.0, 0.0, -4.0)},
                                 {walk(3.0, -3.0, -3.0, 3.0), walk(-3.5, 1.0, 3.5, -1.0)}});
  const Finished finished =
      run_it("people/crowdnav", {set, "experiment.episodes=2", "experiment.free_run=true"});
  ASSERT_EQ(finished.exit_code, 0) << finished.error << finished.out;
  const Json of = summary();
  EXPECT_EQ(of["success_share"], 1.0);
  EXPECT_EQ(of["collisions_true"], 0);
  // 8 m at 1 m/s, and those who come the other way are in it.
  EXPECT_GT(of["time_to_goal_s"]["mean"], 8.0);
  EXPECT_LT(of["time_to_goal_s"]["max"], 14.0);
  EXPECT_GE(of["free_run_ratio"]["p50"], 1.0);
}

/// The robot stands, since no map is new enough to move by; somebody who does not see it walks on.
TEST_F(CrowdTest, CountsWhoWalksIntoIt) {
  const std::string set = cases({{walk(4.0, -4.0, -4.0, -4.0)}});
  const Finished finished =
      run_it("people/crowdnav", {set, "experiment.episodes=1", "experiment.duration_s=8",
                                 "predictor=null", "replanner.max_map_age_s=0.01"});
  const Json of = summary();
  EXPECT_EQ(of["contacts_by_others"], 1) << finished.out;
  EXPECT_EQ(of["contacts_by_robot"], 0);
  EXPECT_EQ(of["collisions"][0]["by"], "other");
}

TEST_F(CrowdTest, NamesWhatCasesLack) {
  const auto refused = [&](const Json& people, int episodes) {
    return run_it("people/crowdnav",
                  {cases(people), "experiment.episodes=" + std::to_string(episodes)});
  };
  Finished finished = refused({{walk(1.0, 1.0, 2.0, 2.0)}}, 2);
  EXPECT_EQ(finished.exit_code, 2);
  EXPECT_THAT(finished.error, HasSubstr("there are 1 cases, and episodes up to number 1"));
  finished = refused({{{{"start", {1.0, "x"}}, {"goal", {0.0, 0.0}}}}}, 1);
  EXPECT_EQ(finished.exit_code, 2);
  EXPECT_THAT(finished.error, HasSubstr("cases.json:1:"));
  const auto file = folder_.path() / "bad.csv";
  std::ofstream(file) << "person,time_s,x_m,y_m\n1,0.0,0,0\n1,0.4,1,0\n1,0.2,2,0\n";
  finished = run_it("people/crowdnav", {"experiment.people=" + file.string()});
  EXPECT_EQ(finished.exit_code, 2);
  EXPECT_THAT(finished.error,
              AllOf(HasSubstr("the times of person 1 do not increase"), HasSubstr("bad.csv:4")));
}

}  // namespace
}  // namespace sidestep::testing
