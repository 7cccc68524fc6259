#include <map>

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <nlohmann/json.hpp>

#include <sidestep/runtime/results_store.hpp>

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

/// The same without what takes until the deadline.
Json solvable_problems() {
  Json content = problems();
  content["problems"].erase(2);
  return content;
}

/// (item, key) -> value of a series.
using Rows = std::map<std::pair<std::int64_t, std::string>, double>;

class PlannerBenchmarkTest : public ::testing::Test {
 protected:
  [[nodiscard]] std::vector<std::string> arguments(const fs::path& problems,
                                                   std::vector<std::string> options) const {
    options.insert(options.begin(),
                   {"run", kConfig, "--set", "experiment.problems=" + problems.string()});
    return options;
  }
  [[nodiscard]] fs::path written(const Json& content) const {
    return folder_.write("plane.json", content.dump());
  }
  [[nodiscard]] Finished run_it(const Json& content, std::vector<std::string> options = {}) const {
    options.insert(options.end(), {"--out", out_.string()});
    return run(arguments(written(content), std::move(options)));
  }
  [[nodiscard]] std::string at(const std::string& out) const {
    return (folder_.path() / out).string();
  }
  [[nodiscard]] Json summary(const std::string& out) const {
    return Json::parse(read_file(folder_.path() / out / "summary.json"), nullptr, false);
  }
  [[nodiscard]] Json planner(const std::string& name, const std::string& out = "run") const {
    const Json whole = summary(out);
    for (const Json& planner : whole["planners"]) {
      if (planner["name"] == name) return planner;
    }
    return {};
  }
  /// What a planner has found; with times where asked for.
  [[nodiscard]] Rows rows(const std::string& out, const std::string& planner,
                          bool times = false) const {
    Rows rows;
    const auto reader = ResultsReader::open(folder_.path() / out / "results.sqlite");
    EXPECT_TRUE(reader);
    if (!reader) return rows;
    EXPECT_TRUE((*reader)->visit("solve/" + planner,
                                 [&](std::int64_t item, std::string_view key, double value) {
                                   if (key.ends_with("_ms") == times)
                                     rows[{item, std::string(key)}] = value;
                                 }));
    return rows;
  }
  /// That two runs have found the same, but for who wins a race.
  void expect_equal_outcomes(const std::string& a, const std::string& b) const {
    for (const char* planner : {"sampling", "line"}) {
      EXPECT_FALSE(rows(a, planner).empty());
      EXPECT_EQ(rows(a, planner), rows(b, planner)) << planner;
    }
    EXPECT_EQ(rows(a, "raced").size(), rows(b, "raced").size());
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
    EXPECT_GE(of["acceleration_ratio"]["p50"].get<double>(), 0.999) << of;
    EXPECT_LE(of["acceleration_ratio"]["p50"].get<double>(), 100.0) << of;
  }
  // A smooth motion is found by whoever has an optimiser.
  EXPECT_NEAR(planner("raced")["smooth_share"].get<double>(), 2.0 / 3.0, 1e-9);
  EXPECT_GE(planner("line")["solved_share"]["s5"].get<double>(), 0.33);
  EXPECT_LE(planner("line")["solved_share"]["s5"].get<double>(), 0.67);
  EXPECT_THAT(read_file(out_ / "report.html"), HasSubstr("raced"));
}

/// Two of three problems have answers.
TEST_F(PlannerBenchmarkTest, FailsWhereAPlannerDoesNotDoWhatIsExpected) {
  const auto with = [&](const char* expect, const char* out) {
    const std::string planner =
        "experiment.planners=[{name: sampling, seeds: [sampled], sampler: "
        "{plugin: rrt_connect, max_samples: 2000}, expect: {";
    return run(
        arguments(written(problems()), {"--set", planner + expect + "}}]", "--out", at(out)}));
  };
  const Finished met = with("solved_share_5s: 0.6, first_p95_ms: 5000", "met");
  EXPECT_EQ(met.exit_code, 0) << met.error;
  EXPECT_EQ(summary("met")["unmet"], "");
  const Finished few = with("solved_share_5s: 0.7", "few");
  EXPECT_EQ(few.exit_code, 1) << few.error;
  EXPECT_THAT(few.out, HasSubstr("Failed: sampling: solved_share.s5 is 0.6667 (at least 0.7 was "
                                 "expected)"));
  EXPECT_EQ(summary("few")["success"], false);
  const Finished slow = with("first_p50_ms: 1e-6", "slow");
  EXPECT_EQ(slow.exit_code, 1) << slow.error;
  EXPECT_THAT(slow.out, HasSubstr("first_valid_ms.p50 is "));
  const Finished wrong = with("solved: 1", "wrong");
  EXPECT_EQ(wrong.exit_code, 2);
  EXPECT_THAT(wrong.error, HasSubstr("solved_share_1s"));
}

TEST_F(PlannerBenchmarkTest, IsNoSuccessWhereNothingIsSolved) {
  Json walled_in = problems();
  walled_in["problems"].erase(1);
  walled_in["problems"].erase(0);
  const Finished finished = run_it(walled_in, {"--set", "experiment.deadline_s=0.3"});
  EXPECT_EQ(finished.exit_code, 1) << finished.error;
  EXPECT_THAT(finished.out, HasSubstr("Failed: raced solves nothing; sampling solves nothing"));
}

TEST_F(PlannerBenchmarkTest, LeavesCertificatesOfItsAnswers) {
  EXPECT_TRUE(run_it(problems()).exit_code == 0 && planner("line")["certified_share"].is_null());
  const Finished finished = run_it(problems(), {"--set", "check.certificate=file"});
  ASSERT_EQ(finished.exit_code, 0) << finished.error << finished.out;
  EXPECT_EQ(planner("sampling")["certified_share"], 1.0);
  std::string files;
  for (const auto& entry : fs::directory_iterator(out_ / "certificates" / "sampling")) {
    files += " " + entry.path().string();
  }
  ASSERT_FALSE(files.empty());
  EXPECT_EQ(std::system((std::string(RECHECK) + files + " > /dev/null").c_str()), 0);
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

TEST_F(PlannerBenchmarkTest, EverySeedIsARunWithThatSeed) {
  ASSERT_EQ(run_it(solvable_problems(), {"--set", "experiment.seeds=2"}).exit_code, 0);
  ASSERT_EQ(run(arguments(written(solvable_problems()), {"--seed", "4", "--out", at("fourth")}))
                .exit_code,
            0);
  EXPECT_EQ(planner("sampling")["problems"], 2);
  EXPECT_EQ(planner("sampling")["answers"], 4);
  const Rows both = rows("run", "sampling"), fourth = rows("fourth", "sampling");
  // The seed after 3 is 4, whatever was drawn before in the same process.
  EXPECT_EQ(both.at({3, "path_length"}), fourth.at({1, "path_length"}));
  EXPECT_NE(both.at({3, "path_length"}), both.at({1, "path_length"}));
}

TEST_F(PlannerBenchmarkTest, ShardsMakeUpTheWhole) {
  const fs::path set = written(solvable_problems());
  ASSERT_EQ(run(arguments(set, {"--out", at("whole")})).exit_code, 0);
  for (const std::string i : {"2", "1"}) {
    const Finished part = run(arguments(set, {"--shard", i + "/2", "--out", at("part" + i)}));
    ASSERT_EQ(part.exit_code, 0) << part.error;
    EXPECT_EQ(summary("part" + i)["/shard/index"_json_pointer], std::stoi(i));
    EXPECT_EQ(planner("line", "part" + i)["problems"], 1);
  }
  const Finished merged = run({"report", at("part2"), at("part1"), "--merged", at("merged")});
  ASSERT_EQ(merged.exit_code, 0) << merged.error;
  expect_equal_outcomes("whole", "merged");
  for (const char* file : {"report.html", "effective_config.yaml", "ompl_benchmark.db",
                           "planner_success.png", "planner_families.png"}) {
    EXPECT_TRUE(fs::exists(folder_.path() / "merged" / file)) << file;
  }
  const Finished twice = run({"report", at("part1"), at("part1"), "--merged", at("twice")});
  EXPECT_EQ(twice.exit_code, 2);
  EXPECT_THAT(twice.error, HasSubstr("shard 1/2 is there twice"));
  const Finished many = run(arguments(set, {"--shard", "1/3", "--out", at("many")}));
  EXPECT_EQ(many.exit_code, 2);
  EXPECT_THAT(many.error, HasSubstr("2 problems, too few for 3 shards"));
}

TEST_F(PlannerBenchmarkTest, JobsShareTheWorkAndMakeUpTheWhole) {
  const fs::path set = written(solvable_problems());
  ASSERT_EQ(run(arguments(set, {"--out", at("whole")})).exit_code, 0);
  const Finished finished = run(arguments(set, {"--jobs", "2", "--out", at("shared")}));
  ASSERT_EQ(finished.exit_code, 0) << finished.error;
  EXPECT_THAT(finished.out, HasSubstr("none refused"));
  EXPECT_THAT(finished.error, HasSubstr("2/2 "));
  EXPECT_EQ(summary("shared")["complete"], true);
  expect_equal_outcomes("whole", "shared");
  const Finished refused = run(arguments(set, {"--jobs", "3", "--out", at("many")}));
  EXPECT_EQ(refused.exit_code, 2);
  EXPECT_THAT(refused.error, HasSubstr("too few for 3 shards"));
}

TEST_F(PlannerBenchmarkTest, JobsStopWhenAskedToAndGoOn) {
  const fs::path set = written(solvable_problems());
  const auto with = [&](const char* option) {
    return arguments(set, {option, at("shared"), "--jobs", "2", "--set", "experiment.seeds=50"});
  };
  CommandLine command(with("--out"));
  ASSERT_TRUE(command.wait_for("1/2 info: sampling "));
  command.send(SIGTERM);
  const Finished stopped = command.wait();
  EXPECT_THAT(stopped.exit_code, ::testing::AnyOf(0, 1)) << stopped.error;  // 0: it was faster
  const Rows before = rows("shared/shard-1", "raced", true);
  EXPECT_FALSE(before.empty());
  const Finished resumed = run(with("--resume"));
  ASSERT_EQ(resumed.exit_code, 0) << resumed.error;
  EXPECT_EQ(before, rows("shared/shard-1", "raced", true)) << "solved once, timed once";
  EXPECT_EQ(planner("line", "shared")["answers"], 100);
}

TEST_F(PlannerBenchmarkTest, GoesOnAfterBeingKilledWithoutSolvingAnythingTwice) {
  const fs::path set = written(solvable_problems());
  const std::vector<std::string> many = {"--set", "experiment.seeds=20"};
  const auto with = [&](std::vector<std::string> options) {
    options.insert(options.end(), many.begin(), many.end());
    return arguments(set, std::move(options));
  };
  {
    CommandLine command(with({"--out", at("killed")}));
    ASSERT_TRUE(command.wait_for("sampling "));
    command.send(SIGKILL);
    (void)command.wait();
  }
  fs::copy(folder_.path() / "killed", folder_.path() / "before");
  const Rows before = rows("before", "raced", true);
  EXPECT_EQ(rows("before", "raced").size() % 40, 0u) << "two problems with twenty seeds";
  EXPECT_FALSE(before.empty());
  const Finished resumed = run(with({"--resume", at("killed")}));
  ASSERT_EQ(resumed.exit_code, 0) << resumed.error;
  EXPECT_EQ(before, rows("killed", "raced", true)) << "solved once, timed once";
  EXPECT_EQ(summary("killed")["complete"], true);
  EXPECT_EQ(summary("killed")["/time/sessions"_json_pointer], 2);
  EXPECT_EQ(planner("sampling", "killed")["answers"], 40);
  const Finished other = run(arguments(set, {"--resume", at("killed")}));
  EXPECT_EQ(other.exit_code, 2);
  EXPECT_THAT(other.error, HasSubstr("`seeds: 20` there, `seeds: 1` here"));
}

TEST_F(PlannerBenchmarkTest, ReadsTheSameProblemsAsMotionBenchMakerWritesThem) {
  const fs::path neutral = written(solvable_problems());
  const std::string request = R"(
start_state: {joint_state: {name: [y, x], position: [0, -1]}}
goal_constraints: [{joint_constraints: [{joint_name: x, position: 1}, {joint_name: y, position: 0}]}]
)";
  for (const char* number : {"1", "2"}) {
    (void)folder_.write(std::string("plane/request000") + number + ".yaml", request);
  }
  (void)folder_.write("plane/scene0001.yaml", "world: {collision_objects: []}\n");
  (void)folder_.write("plane/scene0002.yaml", R"(
world:
  collision_objects:
    - id: wall
      primitives: [{type: box, dimensions: [0.1, 2.4, 1.0]}]
      primitive_poses: [{position: [0, 0.6, 0], orientation: [0, 0, 0, 1]}]
)");
  ASSERT_EQ(run(arguments(neutral, {"--out", at("neutral")})).exit_code, 0);
  const Finished finished = run(arguments(folder_.path() / "plane", {"--out", at("moveit")}));
  ASSERT_EQ(finished.exit_code, 0) << finished.error;
  expect_equal_outcomes("neutral", "moveit");
}

/// How many pages a PDF has: its objects of that type.
int pages_of(const std::string& pdf) {
  const std::string page = "/Type /Page ";
  int pages = 0;
  for (std::size_t at = 0; (at = pdf.find(page, at)) != std::string::npos; ++at) ++pages;
  return pages;
}

TEST_F(PlannerBenchmarkTest, OmplsOwnToolReadsTheDatabase) {
  const fs::path tool = "/usr/bin/ompl_benchmark_statistics";
  if (!fs::exists(tool)) GTEST_SKIP() << "no " << tool << " (Debian's ompl-demos)";
  ASSERT_EQ(run_it(problems(), {"--set", "experiment.seeds=2"}).exit_code, 0);
  const fs::path database = out_ / "ompl_benchmark.db", log = folder_.path() / "log";
  // Its caches stay in our folder.
  const std::string home = folder_.path().string();
  const std::string command = "HOME=" + home + " MPLCONFIGDIR=" + home + "/matplotlib " +
                              tool.string() + " -v -p -d " + database.string() + " >" +
                              log.string() + " 2>&1";
  ASSERT_EQ(std::system(command.c_str()), 0) << read_file(log);
  EXPECT_THAT(read_file(log), ::testing::Not(HasSubstr("Skipping")))
      << "there is something in every column";
  const std::string pdf = read_file(out_ / "ompl_benchmark.pdf");
  ASSERT_TRUE(pdf.starts_with("%PDF-")) << read_file(log);
  EXPECT_THAT(pdf.substr(pdf.size() - 16), HasSubstr("%%EOF"));
  EXPECT_EQ(pages_of(pdf), 12) << "ten columns, the progress, and what the experiments were";
}

}  // namespace
}  // namespace sidestep::testing
