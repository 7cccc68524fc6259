#include <algorithm>
#include <csignal>
#include <fstream>
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

const std::string kConfigs = std::string(SIDESTEP_SOURCE_DIR) + "/tests/integration/configs/";
const std::string kTiny = kConfigs + "tiny_study.yaml";
constexpr int kProblems = 5 * 15;  // scenes x pairs, for each of two robots
const std::vector<std::string> kLong = {"experiment.scenes=300"};

/// (item, key) -> value of a series.
using Rows = std::map<std::pair<std::int64_t, std::string>, double>;

bool is_time(std::string_view key) { return key.ends_with("_ms") || key.ends_with("wall_s"); }

class FieldStudyTest : public ::testing::Test {
 protected:
  [[nodiscard]] std::string at(const std::string& out) const { return (folder_ / out).string(); }
  [[nodiscard]] static std::vector<std::string> arguments(const std::vector<std::string>& sets,
                                                          std::vector<std::string> options) {
    std::vector<std::string> list = {"run", kTiny};
    for (const std::string& set : sets) {
      list.emplace_back("--set");
      list.push_back(set);
    }
    list.insert(list.end(), options.begin(), options.end());
    return list;
  }
  [[nodiscard]] Finished study(const std::string& out, const std::vector<std::string>& sets = {},
                               std::vector<std::string> options = {}) const {
    options.insert(options.end(), {"--out", at(out)});
    return run(arguments(sets, std::move(options)));
  }
  [[nodiscard]] Json summary(const std::string& out) const {
    return Json::parse(read_file(folder_ / out / "summary.json"), nullptr, false);
  }
  /// The rows of a series; those of times only where asked for.
  [[nodiscard]] Rows rows(const std::string& out, const std::string& series, bool times) const {
    Rows rows;
    const auto reader = ResultsReader::open(folder_ / out / "results.sqlite");
    EXPECT_TRUE(reader);
    if (!reader) return rows;
    EXPECT_TRUE((*reader)->visit(series, [&](std::int64_t item, std::string_view key, double v) {
      if (is_time(key) == times) rows[{item, std::string(key)}] = v;
    }));
    return rows;
  }
  /// That two runs have found the same.
  void expect_equal_outcomes(const std::string& a, const std::string& b) const {
    for (const char* series : {"problem/0", "problem/1", "scene/0", "scene/1", "state/0"}) {
      const Rows rows_a = rows(a, series, false);
      EXPECT_FALSE(rows_a.empty());
      EXPECT_EQ(rows_a, rows(b, series, false)) << series;
    }
    Json summary_a = summary(a), summary_b = summary(b);
    for (Json* json : {&summary_a, &summary_b}) {
      json->erase("time");
      json->at("provenance").erase("threads");
      for (Json& robot : json->at("robots")) {
        for (const char* field : {"unsigned", "signed"}) {
          robot.at(field).erase("solve_ms");
          robot.at(field).erase("check_ms");
        }
      }
    }
    EXPECT_EQ(summary_a, summary_b);
  }

  testing_support::TemporaryFolder own_folder_;
  fs::path folder_ = own_folder_.path();
};

TEST_F(FieldStudyTest, ComparesBothFieldsOnEveryProblem) {
  const Finished finished = study("run");
  ASSERT_EQ(finished.exit_code, 0) << finished.error << finished.out;
  EXPECT_THAT(finished.out, HasSubstr("Somebody 2020"));
  const Json all = summary("run");
  EXPECT_EQ(all.at("complete"), true);
  ASSERT_EQ(all.at("robots").size(), 2u);
  for (const Json& robot : all.at("robots")) {
    SCOPED_TRACE(robot.at("name").dump());
    EXPECT_EQ(robot.at("problems"), kProblems);
    const int counted = robot.at("solved_by_both").get<int>() +
                        robot.at("only_unsigned").get<int>() + robot.at("only_signed").get<int>() +
                        robot.at("neither").get<int>();
    EXPECT_EQ(counted, kProblems);
    EXPECT_LE(robot.at("solvable").get<int>(),
              kProblems - robot.at("start_or_goal_in_collision").get<int>());
    EXPECT_GT(robot.at("solvable").get<int>(), kProblems / 2);
    for (const char* field : {"unsigned", "signed"}) {
      EXPECT_GT(robot.at(field).at("iterations").at("mean"), 0.0);
      EXPECT_EQ(robot.at(field).at("valid_cost").at("count"), robot.at("solved_by_both"));
    }
  }
  EXPECT_EQ(all["/robots/0/published/signed/failure_percent"_json_pointer], 0.25);
  EXPECT_TRUE(all["/robots/1/published"_json_pointer].is_null());
  const std::string csv = read_file(folder_ / "run" / "table.csv");
  EXPECT_EQ(std::ranges::count(csv, '\n'), 5) << "a head, two robots with two fields each";
  for (const char* picture :
       {"study_failures", "study_iterations", "study_costs", "study_scatter"}) {
    EXPECT_TRUE(fs::exists(folder_ / "run" / (std::string(picture) + ".png"))) << picture;
  }
  EXPECT_THAT(read_file(folder_ / "run" / "report.html"), HasSubstr("Unsigned against signed"));
}

TEST_F(FieldStudyTest, WithoutObstaclesCostsAreThoseOfTheSmoothestMotionFromRestToRest) {
  ASSERT_EQ(study("run", {"experiment.boxes_per_scene=0", "experiment.scenes=1"}).exit_code, 0);
  // Least integral of a^2 over a way L in time T from rest to rest: 12 L^2 / T^3; cost: half, by
  // qc.
  const Rows states = rows("run", "state/0", false), found = rows("run", "problem/0", false);
  std::int64_t problem = 0;
  for (std::int64_t i = 0; i < 6; ++i) {
    for (std::int64_t j = i + 1; j < 6; ++j, ++problem) {
      const double dx = states.at({i, "q.0"}) - states.at({j, "q.0"});
      const double dy = states.at({i, "q.1"}) - states.at({j, "q.1"});
      const double expected = 0.5 * 12.0 * (dx * dx + dy * dy) / (64.0 * 0.5);
      for (const std::string field : {"unsigned", "signed"}) {
        EXPECT_NEAR(found.at({problem, field + ".cost"}), expected, 1e-3 * expected);
        EXPECT_EQ(found.at({problem, field + ".collision_free"}), 1.0);
      }
    }
  }
  EXPECT_EQ(summary("run")["/robots/0/unsigned/failures"_json_pointer], 0);
}

TEST_F(FieldStudyTest, FindsTheSameOnAnyNumberOfThreads) {
  ASSERT_EQ(study("one", {}, {"--threads", "1"}).exit_code, 0);
  ASSERT_EQ(study("three", {}, {"--threads", "3"}).exit_code, 0);
  expect_equal_outcomes("one", "three");
  ASSERT_EQ(study("seed", {}, {"--seed", "4"}).exit_code, 0);
  EXPECT_NE(rows("one", "problem/0", false), rows("seed", "problem/0", false));
}

TEST_F(FieldStudyTest, ShardsMakeUpTheWhole) {
  ASSERT_EQ(study("whole").exit_code, 0);
  std::vector<std::string> report = {"report"};
  std::size_t in_shards = 0;
  for (const std::string i : {"3", "1", "2"}) {
    ASSERT_EQ(study("shard" + i, {}, {"--shard", i + "/3"}).exit_code, 0);
    EXPECT_EQ(summary("shard" + i)["/shard/index"_json_pointer], std::stoi(i));
    in_shards += rows("shard" + i, "problem/0", false).size();
    report.push_back(at("shard" + i));
  }
  EXPECT_EQ(in_shards, rows("whole", "problem/0", false).size());
  report.insert(report.end(), {"--merged", at("merged")});
  const Finished merged = run(report);
  ASSERT_EQ(merged.exit_code, 0) << merged.error;
  expect_equal_outcomes("whole", "merged");
  EXPECT_TRUE(fs::exists(folder_ / "merged" / "report.html"));
  EXPECT_TRUE(fs::exists(folder_ / "merged" / "effective_config.yaml"));

  const Finished partial = run({"report", at("shard1"), at("shard2"), "--merged", at("partial")});
  EXPECT_EQ(partial.exit_code, 1) << "a shard is missing";
  EXPECT_THAT(partial.out, HasSubstr("Incomplete"));
}

TEST_F(FieldStudyTest, ShardsThatDoNotFitTogetherAreRefused) {
  ASSERT_EQ(study("a", {}, {"--shard", "1/2"}).exit_code, 0);
  ASSERT_EQ(study("b", {"experiment.scenes=4"}, {"--shard", "2/2"}).exit_code, 0);
  ASSERT_EQ(study("c", {}, {"--shard", "2/3"}).exit_code, 0);
  const auto refusal = [&](const std::string& other) {
    const Finished finished = run({"report", at("a"), at(other), "--merged", at("m")});
    EXPECT_EQ(finished.exit_code, 2);
    return finished.error;
  };
  EXPECT_THAT(refusal("b"), HasSubstr("`scenes: 5` there, `scenes: 4` here"));
  EXPECT_THAT(refusal("c"), HasSubstr("the shard is 2/3, the first one is 1/2"));
  EXPECT_THAT(refusal("a"), HasSubstr("shard 1/2 is there twice"));
  EXPECT_FALSE(fs::exists(folder_ / "m"));
  const Finished into_itself = run({"report", at("a"), at("c"), "--merged", at("a")});
  EXPECT_EQ(into_itself.exit_code, 2);
  EXPECT_THAT(into_itself.error, HasSubstr("holds one of the shards"));
}

TEST_F(FieldStudyTest, GoesOnAfterBeingKilledWithoutSolvingAnythingTwice) {
  ASSERT_EQ(study("whole", kLong).exit_code, 0);
  {
    CommandLine command(arguments(kLong, {"--out", at("killed")}));
    // The first robot is done and saved when the second one is first heard of.
    ASSERT_TRUE(command.wait_for("large "));
    command.send(SIGKILL);
    (void)command.wait();
  }
  fs::copy(folder_ / "killed", folder_ / "before", fs::copy_options::recursive);
  const Finished resumed = run(arguments(kLong, {"--resume", at("killed")}));
  ASSERT_EQ(resumed.exit_code, 0) << resumed.error;
  expect_equal_outcomes("whole", "killed");
  const Rows times = rows("before", "problem/0", true);
  EXPECT_EQ(times.size(), 300u * 15u * 4u) << "two times for each of two fields";
  EXPECT_EQ(times, rows("killed", "problem/0", true)) << "solved once, timed once";
}

TEST_F(FieldStudyTest, AnInterruptedRunSavesWhatItHasAndGoesOn) {
  ASSERT_EQ(study("whole", kLong).exit_code, 0);
  CommandLine command(arguments(kLong, {"--out", at("half")}));
  ASSERT_TRUE(command.wait_for("large "));
  command.send(SIGINT);
  const Finished interrupted = command.wait();
  if (interrupted.exit_code != 0) {  // else it was faster than the signal
    EXPECT_EQ(interrupted.exit_code, 1) << interrupted.error;
    EXPECT_EQ(summary("half").at("interrupted"), true);
    EXPECT_EQ(summary("half").at("complete"), false);
    EXPECT_TRUE(fs::exists(folder_ / "half" / "report.html"));
  }
  ASSERT_EQ(run(arguments(kLong, {"--resume", at("half")})).exit_code, 0);
  expect_equal_outcomes("whole", "half");
}

TEST_F(FieldStudyTest, ResumesOnlyTheSameStudy) {
  ASSERT_EQ(study("run").exit_code, 0);
  const std::string before = read_file(folder_ / "run" / "summary.json");
  const Finished other = run(arguments({"planning.epsilon_m=0.25"}, {"--resume", at("run")}));
  EXPECT_EQ(other.exit_code, 2);
  EXPECT_THAT(other.error, HasSubstr("`epsilon_m: 0.2` there, `epsilon_m: 0.25` here"));
  const Finished shard = run(arguments({}, {"--resume", at("run"), "--shard", "1/2"}));
  EXPECT_EQ(shard.exit_code, 2);
  EXPECT_THAT(shard.error, HasSubstr("the run to resume is shard 1/1"));
  EXPECT_EQ(read_file(folder_ / "run" / "summary.json"), before);
  EXPECT_EQ(run(arguments({}, {"--resume", at("run"), "--threads", "1"})).exit_code, 0)
      << "threads change nothing, and there is nothing left to do";
  const Finished nowhere = run(arguments({}, {"--resume", at("none")}));
  EXPECT_EQ(nowhere.exit_code, 2);
  EXPECT_THAT(nowhere.error, HasSubstr("no run to go on with"));
}

TEST_F(FieldStudyTest, OptionsThatMakeNoSenseAreRefused) {
  for (const char* shard : {"0/2", "3/2", "1", "1/", "a/b", "1/2x", "-1/2"}) {
    const Finished finished = study("run", {}, {std::string("--shard=") + shard});
    EXPECT_EQ(finished.exit_code, 2) << shard;
    EXPECT_THAT(finished.error, HasSubstr("expected i/n")) << shard;
  }
  const Finished many = study("run", {}, {"--shard", "1/11"});
  EXPECT_EQ(many.exit_code, 2);
  EXPECT_THAT(many.error, HasSubstr("10 scenes, too few for 11 shards"));
  const Finished plan = run({"run", kConfigs + "tiny.yaml", "--shard", "1/2", "--out", at("plan")});
  EXPECT_EQ(plan.exit_code, 2);
  EXPECT_THAT(
      plan.error,
      HasSubstr("'plan' cannot be divided into shards: its plans share one map, which each part "
                "would have to make anew (these can: field_study"));
}

TEST_F(FieldStudyTest, BothOptimisersAgree) {
  ASSERT_EQ(study("chain").exit_code, 0);
  ASSERT_EQ(study("ceres", {"optimiser.plugin=gp_ceres"}).exit_code, 0);
  int problems = 0, same_verdict = 0, same_cost = 0, compared = 0;
  for (const char* series : {"problem/0", "problem/1"}) {
    const Rows chain = rows("chain", series, false), ceres = rows("ceres", series, false);
    for (const auto& [at, free] : chain) {
      if (!at.second.ends_with("collision_free")) continue;
      ++problems;
      if (ceres.at(at) != free) continue;
      ++same_verdict;
      if (free == 0.0) continue;
      const std::string cost = at.second.substr(0, at.second.find('.')) + ".cost";
      const double a = chain.at({at.first, cost}), b = ceres.at({at.first, cost});
      ++compared;
      if (std::abs(a - b) <= 0.01 * std::max(a, b)) ++same_cost;
    }
  }
  EXPECT_EQ(problems, 4 * kProblems);
  EXPECT_GE(same_verdict, 0.97 * problems);
  EXPECT_GE(same_cost, 0.95 * compared);
}

TEST_F(FieldStudyTest, MistakesAreToldBeforeAnythingRuns) {
  const std::pair<const char*, const char*> mistakes[] = {
      {"field.signed=true", "'signed' is set by the study"},
      {"field={plugin: esdf, unknown: ignored}", "needs the view"},
      {"field.max_distance_m=0.4", "look 0.6 m far, beyond 'max_distance_m'"},
      {"experiment.robots.0.state_ranges={z: [0, 1]}", "has no joint 'z'"},
      {"experiment.robots.0.state_ranges={x: [1, 0]}", "must be ascending"},
      {"experiment.robots.0.state_ranges={x: [-20, 0]}", "within its limits"},
      {"experiment.robots.1.name=small", "named 'small', too"},
      {"experiment.robots.1.planning={epsilon: 0.3}", "epsilon_m"},
      {"experiment.robots.0.box_upper_m=[-3, 0, 0.3]", "must not be below 'box_lower_m'"},
      {"experiment.robots.0.side_lower_m=[-1, 0, 0]", "must not be below 0"},
      {"experiment.robots.0.extent_m=[1, 0, 1]", "above 0"},
      {"experiment.robots=[]", "no robot to study"},
      {"experiment.robots.0.robot={plugin: nobody}", "nobody"}};
  for (const auto& [set, message] : mistakes) {
    const Finished finished = run({"check", kTiny, "--set", set});
    EXPECT_NE(finished.exit_code, 0) << set;
    EXPECT_THAT(finished.error, HasSubstr(message)) << set;
  }
}

}  // namespace
}  // namespace sidestep::testing
