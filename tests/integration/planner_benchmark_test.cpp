#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <nlohmann/json.hpp>

#include "command_line.hpp"
#include "support/temporary_folder.hpp"

namespace sidestep::testing {
namespace {

namespace fs = std::filesystem;
using ::testing::HasSubstr;
using Json = nlohmann::json;

const std::string kConfig =
    std::string(SIDESTEP_SOURCE_DIR) + "/tests/integration/configs/tiny_planners.yaml";

Json box(const char* name, double x, double y, double size_x, double size_y) {
  return {{"name", name},
          {"type", "box"},
          {"size", {size_x, size_y, 1.0}},
          {"position", {x, y, 0.0}},
          {"quaternion_xyzw", {0.0, 0.0, 0.0, 1.0}}};
}

Json problem(int index, const Json& obstacles) {
  return {
      {"index", index}, {"start", {-1.0, 0.0}}, {"goals", {{1.0, 0.0}}}, {"obstacles", obstacles}};
}

/// Nothing in the way; a wall that a line cannot be bent around within its reach; a closed cell.
Json problems() {
  const Json wall = {box("wall", 0.0, 0.6, 0.1, 2.4)};
  const Json cell = {box("east", 1.4, 0.0, 0.1, 0.9), box("west", 0.6, 0.0, 0.1, 0.9),
                     box("north", 1.0, 0.4, 0.9, 0.1), box("south", 1.0, -0.4, 0.9, 0.1)};
  return {{"format", "mbm-neutral/1"},
          {"family", "plane"},
          {"joint_names", {"x", "y"}},
          {"problems", {problem(1, Json::array()), problem(2, wall), problem(3, cell)}}};
}

class PlannerBenchmarkTest : public ::testing::Test {
 protected:
  [[nodiscard]] Finished run_it(const Json& content) const {
    return run({"run", kConfig, "--out", out_.string(), "--set",
                "experiment.problems=" + folder_.write("plane.json", content.dump()).string()});
  }
  [[nodiscard]] Json planner(const std::string& name) const {
    const Json summary = Json::parse(read_file(out_ / "summary.json"), nullptr, false);
    for (const Json& planner : summary["planners"]) {
      if (planner["name"] == name) return planner;
    }
    return {};
  }

  testing_support::TemporaryFolder folder_;
  fs::path out_ = folder_.path() / "run";
};

TEST_F(PlannerBenchmarkTest, TellsWhoSolvesWhat) {
  const Finished finished = run_it(problems());
  ASSERT_EQ(finished.exit_code, 0) << finished.error << finished.out;
  for (const char* name : {"raced", "sampling"}) {
    const Json of = planner(name);
    EXPECT_EQ(of["problems"], 3) << of;
    EXPECT_NEAR(of["solved_share"]["s5"].get<double>(), 2.0 / 3.0, 1e-9) << of;
    EXPECT_EQ(of["refused_by_check"], 0) << of;
    EXPECT_GE(of["path_length_rad"]["p50"].get<double>(), 2.0) << of;
  }
  // A smooth motion is found by whoever has an optimiser.
  EXPECT_NEAR(planner("raced")["smooth_share"].get<double>(), 2.0 / 3.0, 1e-9);
  EXPECT_GE(planner("line")["solved_share"]["s5"].get<double>(), 0.33);
  EXPECT_LE(planner("line")["solved_share"]["s5"].get<double>(), 0.67);
  EXPECT_THAT(read_file(out_ / "report.html"), HasSubstr("raced"));
}

TEST_F(PlannerBenchmarkTest, NamesTheMistakeInAProblemSet) {
  Json content = problems();
  content["problems"][1]["obstacles"][0]["type"] = "cone";
  const Finished finished = run_it(content);
  EXPECT_NE(finished.exit_code, 0);
  EXPECT_THAT(finished.error, HasSubstr("problems[1].obstacles[0].type"));
}

TEST_F(PlannerBenchmarkTest, NeedsProblems) {
  const Finished finished = run({"run", kConfig, "--out", out_.string()});
  EXPECT_NE(finished.exit_code, 0);
  EXPECT_THAT(finished.error, HasSubstr("experiment.problems"));
}

}  // namespace
}  // namespace sidestep::testing
