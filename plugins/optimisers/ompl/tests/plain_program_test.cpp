// The program of benchmarks/plain_driver, as it is called.

#include <cstdio>
#include <filesystem>

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <nlohmann/json.hpp>

#include "integration/command_line.hpp"
#include "support/temporary_folder.hpp"

namespace sidestep::plain_driver {
namespace {

using ::testing::HasSubstr;
using Json = nlohmann::json;

constexpr double kTurn_rad = 1.571;  // of the first joint, to either side

Json obstacle(const char* type, const Json& position) {
  return {{"name", type},
          {"type", type},
          {"position", position},
          {"quaternion_xyzw", {0.0, 0.0, 0.0, 1.0}}};
}

/// From one side of the robot to the other, the hand 0.3 m ahead and 0.5 m up.
Json problem(int index, const Json& obstacles) {
  return {{"index", index},
          {"start", {kTurn_rad, -0.785, 0.0, -2.356, 0.0, 1.571, 0.785}},
          {"goals", {{-kTurn_rad, -0.785, 0.0, -2.356, 0.0, 1.571, 0.785}}},
          {"obstacles", obstacles}};
}

Json family(const std::string& name, const Json& problems) {
  Json joints = Json::array();
  for (int j = 1; j <= 7; ++j) joints.push_back("panda_joint" + std::to_string(j));
  return {{"format", "mbm-neutral/1"},
          {"family", name},
          {"joint_names", joints},
          {"problems", problems}};
}

/// In the way of the straight line.
Json pole() {
  Json pole = obstacle("cylinder", {0.3, 0.0, 0.35});
  pole.update({{"radius", 0.03}, {"height", 0.7}});
  return pole;
}

/// In the hand, at the goal.
Json block() {
  Json block = obstacle("box", {0.0, -0.38, 0.5});
  block.update({{"size", {0.1, 0.1, 0.3}}});
  return block;
}

class PlainProgram : public ::testing::Test {
 protected:
  [[nodiscard]] testing::Finished call(std::vector<std::string> options) const {
    options.insert(options.begin(), folder_.path().string());
    return testing::run(options);
  }
  /// What it says in JSON; it must succeed.
  [[nodiscard]] Json summary(std::vector<std::string> options) const {
    options.emplace_back("--json");
    const testing::Finished finished = call(options);
    EXPECT_EQ(finished.exit_code, 0) << finished.error;
    return Json::parse(finished.out, nullptr, false);
  }
  void write(const std::string& name, const Json& problems) const {
    (void)folder_.write(name + ".json", family(name, problems).dump());
  }
  /// A mistake in a problem set: the exit code must be 2. Returns what is said.
  [[nodiscard]] std::string mistake(const std::string& content) const {
    (void)folder_.write("set.json", content);
    const testing::Finished finished = call({});
    EXPECT_EQ(finished.exit_code, 2);
    EXPECT_EQ(finished.out, "");
    return finished.error;
  }

  testing_support::TemporaryFolder folder_;
};

Json row_of(const Json& summary, const std::string& family) {
  for (const Json& row : summary["rows"]) {
    if (row["family"] == family) return row;
  }
  ADD_FAILURE() << "no row '" << family << "' in " << summary;
  return {};
}

TEST_F(PlainProgram, SolvesAndSaysWhatItTook) {
  write("free", Json::array({problem(1, Json::array())}));
  write("pole", Json::array({problem(1, Json::array({pole()}))}));
  const Json said = summary({"--seconds", "60", "--shapes"});
  ASSERT_EQ(said["rows"].size(), 3u) << said;
  const Json all = row_of(said, "all");
  EXPECT_EQ(all["problems"], 2);
  EXPECT_EQ(all["solved"], 2);
  EXPECT_TRUE(said["unsolved"].empty());
  // The straight line turns the first joint only, and meets nothing but the pole.
  const Json free = row_of(said, "free"), around = row_of(said, "pole");
  EXPECT_NEAR(free["path_length_rad"]["p50"].get<double>(), 2.0 * kTurn_rad, 1e-6);
  EXPECT_EQ(free["in_collision"]["paths"], 0);
  EXPECT_EQ(free["unproven"], 0);
  EXPECT_EQ(free["shapes_touching"], 0);
  EXPECT_GT(around["path_length_rad"]["p50"].get<double>(), 2.0 * kTurn_rad + 0.1);
  for (const Json& row : said["rows"]) {
    EXPECT_GT(row["setup_ms"]["p50"], 0.0) << row;
    EXPECT_GT(row["search_ms"]["p50"], 0.0) << row;
    EXPECT_GT(row["simplified_ms"]["p50"], row["search_ms"]["p50"]) << row;
    EXPECT_GT(row["state_check_us"], 0.0) << row;
    EXPECT_GT(row["states"]["p50"], 2.0 * kTurn_rad * 32.0) << row;
  }
  EXPECT_EQ(said["provenance"]["seed"], 7);
}

TEST_F(PlainProgram, ItsTableSaysTheSame) {
  write("pole", Json::array({problem(1, Json::array({pole()})), problem(2, Json::array())}));
  const Json all = row_of(summary({"--seconds", "60"}), "all");
  const testing::Finished finished = call({"--seconds", "60"});
  ASSERT_EQ(finished.exit_code, 0) << finished.error;
  for (const char* column : {"family", "solved", "search p50", "simplified p50", "state check",
                             "path p50", "in collision"}) {
    EXPECT_THAT(finished.out, HasSubstr(column));
  }
  EXPECT_TRUE(all["shapes_touching"].is_null());
  char length[32];
  std::snprintf(length, sizeof length, "%.2f rad", all["path_length_rad"]["p50"].get<double>());
  EXPECT_THAT(finished.out, HasSubstr(length));  // repeatable, too
}

TEST_F(PlainProgram, TakesEveryNthProblemOfAFamily) {
  write("free", Json::array({problem(1, Json::array()), problem(2, Json::array()),
                             problem(3, Json::array())}));
  write("pole", Json::array({problem(8, Json::array({pole()}))}));
  const Json said = summary({"--every", "2", "--seconds", "60"});
  EXPECT_EQ(row_of(said, "free")["problems"], 2);
  EXPECT_EQ(row_of(said, "pole")["problems"], 1);
}

TEST_F(PlainProgram, NamesWhatItCannotSolve) {
  write("shut", Json::array({problem(4, Json::array({block()}))}));
  const Json said = summary({"--seconds", "0.05"});
  EXPECT_EQ(row_of(said, "all")["solved"], 0);
  EXPECT_TRUE(row_of(said, "all")["search_ms"]["p50"].is_null());
  EXPECT_EQ(said["unsolved"], Json::array({"shut 4"}));
  EXPECT_THAT(call({"--seconds", "0.05"}).out, HasSubstr("without a path: shut 4"));
}

TEST_F(PlainProgram, NamesTheFileOfAMistake) {
  EXPECT_THAT(mistake("{"), HasSubstr("set.json:1:2"));
  Json cone = pole();
  cone["type"] = "cone";
  EXPECT_THAT(mistake(family("set", Json::array({problem(1, Json::array({cone}))})).dump()),
              HasSubstr("set.json: problems[0].obstacles[0].type"));
  Json other = family("set", Json::array({problem(1, Json::array())}));
  other["joint_names"][6] = "wrist_roll_joint";
  EXPECT_THAT(mistake(other.dump()), HasSubstr("'panda_joint7'"));
  EXPECT_THAT(mistake(family("set", Json::array()).dump()), HasSubstr("no problem to solve"));
}

TEST_F(PlainProgram, NamesWhatIsMissing) {
  const std::string nowhere = (folder_.path() / "nowhere").string();
  const testing::Finished finished = testing::run({nowhere});
  EXPECT_EQ(finished.exit_code, 2);
  EXPECT_THAT(finished.error, HasSubstr(nowhere + ": there is no such folder or file"));
  EXPECT_THAT(call({}).error, HasSubstr("no problems in this folder"));
  const testing::Finished nothing = testing::run({});
  EXPECT_EQ(nothing.exit_code, 2);
  EXPECT_THAT(nothing.error, HasSubstr("PROBLEMS"));
  EXPECT_EQ(call({"--every", "0"}).exit_code, 2);
  EXPECT_THAT(call({"--every", "0"}).error, HasSubstr("--every"));
}

TEST_F(PlainProgram, SolvesTheFirstProblemOfEachFamilyOfMotionBenchMaker) {
  const auto problems = std::filesystem::path(SIDESTEP_SHARED_DATA) / "mbm" / "panda";
  if (!std::filesystem::exists(problems)) GTEST_SKIP() << "no data at " << problems;
  const testing::Finished finished =
      testing::run({problems.string(), "--every", "1000", "--seconds", "120", "--json"});
  ASSERT_EQ(finished.exit_code, 0) << finished.error;
  const Json said = Json::parse(finished.out, nullptr, false);
  ASSERT_EQ(said["rows"].size(), 8u) << said;
  EXPECT_EQ(row_of(said, "all")["problems"], 7);
  EXPECT_EQ(row_of(said, "all")["solved"], 7);
}

}  // namespace
}  // namespace sidestep::plain_driver
