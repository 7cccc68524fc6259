#include <algorithm>

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <nlohmann/json.hpp>

#include <sidestep/runtime/results_store.hpp>

#include "command_line.hpp"
#include "support/recorded_file.hpp"
#include "support/stored_numbers.hpp"
#include "support/temporary_folder.hpp"

namespace sidestep::testing {
namespace {

namespace fs = std::filesystem;
using ::testing::HasSubstr;
using ::testing::Not;
using Json = nlohmann::json;
using testing_support::recorded_disc;

const std::string kConfig = std::string(SIDESTEP_SOURCE_DIR) + "/configs/peers/gpmp2.yaml";

class RecordedBenchmarkTest : public ::testing::Test {
 protected:
  [[nodiscard]] Finished run_it(const fs::path& problems,
                                const std::vector<std::string>& sets = {}) const {
    std::vector<std::string> arguments = {"run",   kConfig,
                                          "--out", out_.string(),
                                          "--set", "experiment.problems=" + problems.string()};
    for (const std::string& set : sets) {
      arguments.emplace_back("--set");
      arguments.push_back(set);
    }
    return run(arguments);
  }
  [[nodiscard]] Finished run_json(const Json& problems,
                                  const std::vector<std::string>& sets = {}) const {
    return run_it(folder_.write("problems.json", problems.dump()), sets);
  }
  [[nodiscard]] Json summary() const {
    return Json::parse(read_file(out_ / "summary.json"), nullptr, false);
  }
  [[nodiscard]] std::vector<double> column(const std::string& series, const char* key) const {
    auto results = ResultsReader::open(out_ / "results.sqlite");
    return results ? (*results)->column(series, key).value() : std::vector<double>{};
  }

  testing_support::TemporaryFolder folder_;
  fs::path out_ = folder_.path() / "run";
};

class KnownProblemsTest : public RecordedBenchmarkTest,
                          public ::testing::WithParamInterface<std::string> {};

/// The costs of recorded_disc() are known: 6 D^2 / T^3.
TEST_P(KnownProblemsTest, FindsTheCostsThatAreKnown) {
  const Finished finished = run_json(recorded_disc(), {"optimiser.plugin=" + GetParam()});
  ASSERT_EQ(finished.exit_code, 0) << finished.error << finished.out;
  const Json json = summary();
  EXPECT_EQ(json.at("success"), true);
  EXPECT_EQ(json.at("problems"), 6);
  EXPECT_EQ(json.at("optimiser"), GetParam());
  EXPECT_EQ(json.at("costs_comparable"), true);
  ASSERT_EQ(json.at("runs").size(), 2u);
  const Json& study = json.at("runs")[0];
  EXPECT_EQ(study.at("label"), "study");
  EXPECT_EQ(study.at("field"), "sdf");
  EXPECT_EQ(study.at("problems"), 6);
  const Json& cost = study.at("cost");
  EXPECT_NEAR(cost.at("mean"), (4 * 0.192 + 2 * 0.048) / 6, 2e-5);
  EXPECT_NEAR(cost.at("median"), 0.192, 2e-5);
  EXPECT_NEAR(cost.at("peer_mean"), (4 * 0.192 + 0.048 + 0.0432) / 6, 1e-12);
  EXPECT_NEAR(cost.at("peer_median"), 0.192, 1e-12);
  EXPECT_NEAR(cost.at("share_within_1pct"), 5.0 / 6, 1e-12) << "the last one's is 10 % too high";
  EXPECT_NEAR(study.at("/collision_free/share"_json_pointer), 5.0 / 6, 1e-12);
  EXPECT_NEAR(study.at("/collision_free/peer_share"_json_pointer), 4.0 / 6, 1e-12);
  EXPECT_EQ(study.at("/free_ends/problems"_json_pointer), 6);
  EXPECT_NEAR(study.at("/free_at_checks/share"_json_pointer), 5.0 / 6, 1e-12);
  EXPECT_EQ(study.at("/peer/iterations"_json_pointer), (Json{{"mean", 3.0}, {"sd", 0.0}}));
  EXPECT_DOUBLE_EQ(study.at("/peer/solve_ms/p50"_json_pointer), 2.0);
  EXPECT_DOUBLE_EQ(study.at("/peer/lm_iteration_us/p50"_json_pointer), 500.0);
}

TEST_P(KnownProblemsTest, GivesEachRunItsOwnStoppingRules) {
  ASSERT_EQ(run_json(recorded_disc(), {"optimiser.plugin=" + GetParam()}).exit_code, 0);
  const Json runs = summary().at("runs");
  EXPECT_GT(runs[0].at("/iterations/mean"_json_pointer), 1.0);
  EXPECT_EQ(runs[1].at("max_iterations"), 1);
  EXPECT_EQ(runs[1].at("/iterations/mean"_json_pointer), 1.0) << "stopped after one";
  EXPECT_EQ(runs[1].at("/iterations/sd"_json_pointer), 0.0);
}

TEST_P(KnownProblemsTest, TimesAddUp) {
  ASSERT_EQ(run_json(recorded_disc(), {"optimiser.plugin=" + GetParam()}).exit_code, 0);
  const Json study = summary().at("runs")[0];
  auto solve_ms = column("solve/0", "solve_ms");
  const auto accepted = column("solve/0", "accepted_iterations");
  ASSERT_EQ(solve_ms.size(), 6u);
  std::vector<double> iteration_us;
  double sum_ms = 0.0;
  for (std::size_t i = 0; i < 6; ++i) {
    EXPECT_GT(solve_ms[i], 0.0);
    iteration_us.push_back(1e3 * solve_ms[i] / accepted.at(i));
    sum_ms += solve_ms[i];
  }
  std::ranges::sort(iteration_us);
  std::ranges::sort(solve_ms);
  EXPECT_NEAR(study.at("/lm_iteration_us/p50"_json_pointer),
              0.5 * (iteration_us[2] + iteration_us[3]), 1e-9);
  EXPECT_NEAR(study.at("/solve_ms/p50"_json_pointer), 0.5 * (solve_ms[2] + solve_ms[3]), 1e-12);
  EXPECT_NEAR(study.at("/solve_ms/mean"_json_pointer), sum_ms / 6, 1e-12);
  EXPECT_NEAR(study.at("/solve_ms/p95"_json_pointer),
              solve_ms[4] + 0.75 * (solve_ms[5] - solve_ms[4]), 1e-12);
}

INSTANTIATE_TEST_SUITE_P(Optimisers, KnownProblemsTest, ::testing::Values("gp_chain", "gp_ceres"),
                         [](const auto& of) { return of.param; });

TEST_F(RecordedBenchmarkTest, WritesTableReportAndAConfigurationThatRunsAgain) {
  const Finished finished = run_json(recorded_disc());
  ASSERT_EQ(finished.exit_code, 0) << finished.error;
  EXPECT_THAT(finished.out, HasSubstr("collision-free"));
  EXPECT_EQ(std::ranges::count(read_file(out_ / "table.csv"), '\n'), 3);
  const std::string report = read_file(out_ / "report.html");
  for (const char* part :
       {"Costs and collisions", "Final cost of each problem", "data:image/png"}) {
    EXPECT_THAT(report, HasSubstr(part));
  }
  EXPECT_TRUE(fs::exists(out_ / "planner_costs.png"));
  const std::string effective = read_file(out_ / "effective_config.yaml");
  EXPECT_THAT(effective, HasSubstr("absolute_tolerance"));
  EXPECT_THAT(effective, Not(HasSubstr("relative_tolerance"))) << "each run has its own";
  const Finished again = run({"run", (out_ / "effective_config.yaml").string(), "--out",
                              (folder_.path() / "again").string()});
  EXPECT_EQ(again.exit_code, 0) << again.error;
  const Finished compared = run({"report", out_.string(), (folder_.path() / "again").string()});
  EXPECT_EQ(compared.exit_code, 0) << compared.error;
  EXPECT_THAT(compared.out, HasSubstr("within 1 %"));
}

TEST_F(RecordedBenchmarkTest, TakesASubset) {
  ASSERT_EQ(run_json(recorded_disc(),
                     {"experiment.every=2", "experiment.limit=2", "experiment.runs=[replan]"})
                .exit_code,
            0);
  ASSERT_EQ(summary().at("runs").size(), 1u);
  EXPECT_EQ(summary().at("runs")[0].at("label"), "replan");
  EXPECT_EQ(column("solve/0", "pair"), (std::vector<double>{0, 2}));
  EXPECT_EQ(column("solve/0", "scene"), (std::vector<double>{0, 0}));
}

/// On a mobile base.
Json recorded_mobile() {
  Json json = recorded_disc();
  json["robot"] = {{"name", "mobile"},
                   {"dh", "modified"},
                   {"a", {0.0}},
                   {"alpha", {0.0}},
                   {"d", {0.0}},
                   {"base_T_torso", {0.0, 0.0, 0.0}},
                   {"torso_T_arm", {0.0, 0.0, 0.0}},
                   {"spheres", {{0, 0.0, 0.0, 0.0, 0.1}}}};
  for (Json& q : json["configurations"]) q.insert(q.end(), {0.0, 0.0, 0.0});
  return json;
}

TEST_F(RecordedBenchmarkTest, HoldsNoCostsAgainstALieGroup) {
  ASSERT_EQ(run_json(recorded_mobile()).exit_code, 0);
  EXPECT_EQ(summary().at("costs_comparable"), false);
  const Json run = summary().at("runs")[0];
  for (const char* key : {"share_within_1pct", "peer_mean", "peer_median"}) {
    EXPECT_TRUE(run.at("cost").at(key).is_null()) << key;
  }
  EXPECT_NEAR(run.at("/cost/median"_json_pointer), 0.192, 2e-5);
  EXPECT_NEAR(run.at("/collision_free/share"_json_pointer), 5.0 / 6, 1e-12);
  EXPECT_THAT(read_file(out_ / "report.html"), HasSubstr("Lie group"));
}

TEST_F(RecordedBenchmarkTest, HoldsCostsAgainstALieGroupWhereThePriorIsThatToo) {
  ASSERT_EQ(run_json(recorded_mobile(), {"optimiser.base_prior=body"}).exit_code, 0);
  EXPECT_EQ(summary().at("costs_comparable"), true);
  const Json cost = summary().at("runs")[0].at("cost");
  EXPECT_TRUE(cost.at("share_within_1pct").is_number());
  EXPECT_NEAR(cost.at("median"), 0.192, 2e-5) << "nothing turns: both priors are the same";
  EXPECT_THAT(read_file(out_ / "report.html"), Not(HasSubstr("Lie group")));
}

TEST_F(RecordedBenchmarkTest, FailsWhereAProblemHasNoSolution) {
  Json json = recorded_disc();
  json["configurations"][3] = {1e300, 1e300};  // costs overflow
  const Finished finished = run_json(json);
  EXPECT_EQ(finished.exit_code, 1) << finished.error;
  EXPECT_EQ(summary().at("success"), false);
  EXPECT_EQ(summary().at("runs")[0].at("problems"), 6);
  EXPECT_EQ(summary().at("runs")[0].at("solved"), 4) << "two go to the last configuration";
  EXPECT_THAT(finished.out, HasSubstr("Failed: 4 of 12 solves"));
}

TEST_F(RecordedBenchmarkTest, KeepsWhatWasMeasuredWhenInterrupted) {
  Json json = recorded_disc();
  const Json few = json["runs"][0]["results"];
  for (int i = 0; i < 400; ++i) {
    for (const Json& row : few) json["runs"][0]["results"].push_back(row);
  }
  const fs::path problems = folder_.write("problems.json", json.dump());
  CommandLine command({"run", kConfig, "--out", out_.string(), "--set",
                       "experiment.problems=" + problems.string(), "--set",
                       "experiment.repeats=1000"});
  ASSERT_TRUE(command.wait_for("study, signed"));
  command.send(SIGINT);
  const Finished finished = command.wait();
  EXPECT_EQ(finished.exit_code, 1) << finished.error;
  EXPECT_THAT(finished.out, HasSubstr("Interrupted"));
  const Json part = summary();
  EXPECT_EQ(part.at("interrupted"), true);
  ASSERT_EQ(part.at("runs").size(), 2u);
  EXPECT_EQ(part.at("runs")[1].at("problems"), 0);
  const std::size_t solved = part.at("runs")[0].at("problems");
  EXPECT_GE(solved, 25u) << "progress was told";
  EXPECT_EQ(column("solve/0", "solve_ms").size(), solved);
  EXPECT_TRUE(fs::exists(out_ / "report.html"));
}

/// Runs in folders of their own, on one file of problems.
class DividedRecordedTest : public RecordedBenchmarkTest {
 protected:
  [[nodiscard]] std::string at(const std::string& out) const {
    return (folder_.path() / out).string();
  }
  [[nodiscard]] std::vector<std::string> arguments(const std::string& out,
                                                   const std::vector<std::string>& options) const {
    std::vector<std::string> all = {"run", kConfig, "--set",
                                    "experiment.problems=" + problems_.string()};
    all.insert(all.end(), options.begin(), options.end());
    if (!out.empty()) all.insert(all.end(), {"--out", at(out)});
    return all;
  }
  [[nodiscard]] int run_to(const std::string& out,
                           const std::vector<std::string>& options = {}) const {
    return run(arguments(out, options)).exit_code;
  }
  [[nodiscard]] testing_support::StoredNumbers numbers(const std::string& out) const {
    return testing_support::stored_numbers(folder_.path() / out, {"series", "solve/0", "solve/1"},
                                           {"solve_ms"});
  }
  /// All of a summary that no clock has a say in: of the peer's times, all.
  [[nodiscard]] Json timeless(const std::string& out) const {
    Json json = Json::parse(read_file(folder_.path() / out / "summary.json"), nullptr, false);
    json.erase("time");
    for (Json& one : json.at("runs")) {
      one.erase("solve_ms");
      one.erase("lm_iteration_us");
    }
    return json;
  }

  fs::path problems_ = folder_.write("divided.json", recorded_disc().dump());
};

TEST_F(DividedRecordedTest, ShardsTogetherAreTheWholeRun) {
  ASSERT_EQ(run_to("whole"), 0);
  for (const std::string i : {"1", "2"}) {
    const Finished shard = run(arguments("shard" + i, {"--shard", i + "/2"}));
    ASSERT_EQ(shard.exit_code, 0) << shard.error;
    EXPECT_THAT(shard.out, HasSubstr("Shard " + i + "/2: Success: 6 solves"));
  }
  // Every other problem of each run: scenes 0 0 0 1 1 1, pairs 0 1 2 0 1 2.
  const auto of_shard = [&](const char* shard, const std::string& series, const char* key) {
    const auto results = ResultsReader::open(folder_.path() / shard / "results.sqlite");
    return (*results)->column(series, key).value();
  };
  for (const std::string series : {"solve/0", "solve/1"}) {
    EXPECT_EQ(of_shard("shard1", series, "pair"), (std::vector<double>{0, 2, 1}));
    EXPECT_EQ(of_shard("shard1", series, "scene"), (std::vector<double>{0, 0, 1}));
    EXPECT_EQ(of_shard("shard2", series, "pair"), (std::vector<double>{1, 0, 2}));
  }
  const auto costs = of_shard("shard1", "solve/0", "cost");
  ASSERT_EQ(costs.size(), 3u);
  for (const std::size_t i : {0u, 1u, 2u}) EXPECT_NEAR(costs[i], i == 1 ? 0.048 : 0.192, 2e-5);

  const Finished merged = run({"report", at("shard2"), at("shard1"), "--merged", at("merged")});
  ASSERT_EQ(merged.exit_code, 0) << merged.error;
  EXPECT_EQ(numbers("merged"), numbers("whole"));
  EXPECT_EQ(timeless("merged"), timeless("whole"));
  for (const char* file : {"report.html", "effective_config.yaml", "planner_costs.png"}) {
    EXPECT_TRUE(fs::exists(folder_.path() / "merged" / file)) << file;
  }
  ASSERT_EQ(run_to("jobs", {"--jobs", "2"}), 0);
  EXPECT_EQ(numbers("jobs"), numbers("whole"));
  for (const std::string i : {"1", "3"}) ASSERT_EQ(run_to("third" + i, {"--shard", i + "/3"}), 0);
  const Finished lacking = run({"report", at("third3"), at("third1"), "--merged", at("lacking")});
  EXPECT_EQ(lacking.exit_code, 1);
  EXPECT_THAT(lacking.out, HasSubstr("Incomplete: 8 of 12 solves"));
}

TEST_F(DividedRecordedTest, RunsThatDoNotFitAreRefused) {
  ASSERT_EQ(run_to("a", {"--shard", "1/2"}), 0);
  ASSERT_EQ(run_to("b", {"--shard", "2/2", "--set", "experiment.seed=8"}), 0);
  ASSERT_EQ(run_to("c", {"--shard", "2/3"}), 0);
  const fs::path elsewhere = folder_.write("elsewhere.json", recorded_disc().dump());
  ASSERT_EQ(run_to("d", {"--shard", "2/2", "--threads", "2", "--set",
                         "experiment.problems=" + elsewhere.string()}),
            0);
  Json other = recorded_disc();
  other["pairs"][0] = {1, 0};
  const fs::path others = folder_.write("others.json", other.dump());
  ASSERT_EQ(run_to("e", {"--shard", "2/2", "--set", "experiment.problems=" + others.string()}), 0);
  const auto merge = [&](const std::string& with) {
    return run({"report", at("a"), at(with), "--merged", at("merged")});
  };
  EXPECT_EQ(merge("d").exit_code, 0) << "the same problems, in another place, on more threads";
  const auto refused = [&](const Finished& finished, const std::string& message) {
    EXPECT_EQ(finished.exit_code, 2) << message;
    EXPECT_THAT(finished.error, HasSubstr(message));
  };
  refused(merge("a"), "shard 1/2 is there twice");
  refused(merge("b"), "`seed: 7` there, `seed: 8` here");
  refused(merge("c"), "the shard is 2/3, the first one is 1/2");
  refused(merge("e"), "`contents of the problems: ");
  refused(run(arguments("", {"--resume", at("a")})), "the run to resume is shard 1/2");
  refused(run(arguments("", {"--resume", at("b"), "--shard", "2/2"})),
          "the run to resume is another one: `seed: 8` there");
  refused(run(arguments("f", {"--shard", "1/7"})), "there are 6 problems, too few for 7 shards");
}

TEST_F(DividedRecordedTest, AnInterruptedRunGoesOn) {
  const std::vector<std::string> long_one = {"--set", "experiment.repeats=1000"};
  CommandLine command(arguments("run", long_one));
  ASSERT_TRUE(command.wait_for("study, signed"));
  command.send(SIGINT);
  const Finished interrupted = command.wait();
  ASSERT_EQ(interrupted.exit_code, 1) << interrupted.error;
  EXPECT_THAT(interrupted.out, HasSubstr("--resume goes on"));
  const auto before = column("solve/0", "repeats");
  const auto times = column("solve/0", "solve_ms");
  ASSERT_FALSE(before.empty());
  EXPECT_LT(*std::ranges::min_element(before), 1000.0);

  std::vector<std::string> resume = long_one;
  resume.insert(resume.end(), {"--resume", at("run")});
  const Finished resumed = run(arguments("", resume));
  ASSERT_EQ(resumed.exit_code, 0) << resumed.error;
  const auto after = column("solve/0", "solve_ms");
  ASSERT_EQ(after.size(), 6u);
  for (std::size_t i = 0; i < times.size(); ++i)
    EXPECT_LE(after[i], times[i]) << "the least counts";
  EXPECT_EQ(column("solve/0", "repeats"), std::vector<double>(6, 1000.0));
  EXPECT_EQ(column("solve/1", "repeats"), std::vector<double>(6, 1000.0));
  EXPECT_EQ(summary().at("/time/sessions"_json_pointer), 2);
  ASSERT_EQ(run_to("whole", long_one), 0);
  EXPECT_EQ(numbers("run"), numbers("whole"));
  EXPECT_EQ(timeless("run"), timeless("whole"));
}

TEST_F(RecordedBenchmarkTest, RefusesWhatItCannotUse) {
  const auto refused = [&](const Finished& finished, const std::string& message) {
    EXPECT_EQ(finished.exit_code, 2) << message;
    EXPECT_THAT(finished.error, HasSubstr(message));
  };
  Json json = recorded_disc();
  refused(run({"run", kConfig, "--out", out_.string()}), "--set experiment.problems=FILE");
  refused(run_it(folder_.path() / "absent.json"), "absent.json: there is no such file");
  refused(run_it(folder_.write("broken.json", "{\"robot\": }")), "broken.json:1:11: ");
  refused(run_json(json, {"experiment.runs=[studi]"}), "did you mean 'study'?");
  refused(run_json(json, {"optimiser.max_iterations=7"}),
          "'max_iterations' is set by the experiment, to that of each run");
  refused(run_json(json, {"optimiser.plugin=ompl"}),
          "the optimiser 'ompl' has no parameter 'relative_tolerance'");
  json["runs"][1]["results"][2][4] = "low";
  refused(run_json(json), "problems.json: runs[1].results[2][4]: expected a number, found \"low\"");
  json["runs"] = Json::array();
  refused(run_json(json, {"experiment.runs=[]"}), "there is no problem to solve");
}

TEST_F(RecordedBenchmarkTest, MatchesGpmp2WhereItsRecordingsAre) {
  const fs::path file = fs::path(SIDESTEP_SHARED_DATA) / "gpmp2" / "problems_panda_single.json";
  if (!fs::exists(file)) GTEST_SKIP() << "no recorded problems in " << file;
  const Finished finished = run_it(file, {"experiment.every=9", "experiment.repeats=1"});
  ASSERT_EQ(finished.exit_code, 0) << finished.error;
  const Json json = summary();
  ASSERT_EQ(json.at("runs").size(), 4u) << "study and replan, signed and unsigned";
  for (const Json& one : json.at("runs")) {
    SCOPED_TRACE(one.at("label").get<std::string>() + " " + one.at("field").get<std::string>());
    EXPECT_EQ(one.at("problems"), 85);
    EXPECT_GE(one.at("/cost/share_within_1pct"_json_pointer), 0.98);
    EXPECT_LE(one.at("/cost/median"_json_pointer),
              1.0001 * one.at("/cost/peer_median"_json_pointer).get<double>());
    EXPECT_GE(one.at("/collision_free/share"_json_pointer),
              one.at("/collision_free/peer_share"_json_pointer).get<double>());
  }
}

}  // namespace
}  // namespace sidestep::testing
