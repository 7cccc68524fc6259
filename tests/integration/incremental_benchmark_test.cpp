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
using Json = nlohmann::json;
using testing_support::recorded_disc;

const std::string kConfig = std::string(SIDESTEP_SOURCE_DIR) + "/configs/peers/incremental.yaml";
const std::vector<std::string> kWays = {"afresh", "warm", "incremental"};
constexpr int kProblems = 6;  ///< Of recorded_disc().

/// The disc's motions are straight and cost 6 D^2 / T^3, T = 5 s; series 0 has another goal, series
/// 1 other obstacles, which cost next to nothing.
class IncrementalBenchmarkTest : public ::testing::Test {
 protected:
  [[nodiscard]] Finished run_it(const std::vector<std::string>& sets = {},
                                const std::string& out = "run",
                                const std::vector<std::string>& options = {}) const {
    return run(arguments(sets, out, options));
  }
  [[nodiscard]] std::vector<std::string> arguments(const std::vector<std::string>& sets,
                                                   const std::string& out,
                                                   const std::vector<std::string>& options) const {
    const fs::path problems = folder_.write("problems.json", recorded_disc().dump());
    std::vector<std::string> arguments = {"run",   kConfig,
                                          "--set", "experiment.problems=" + problems.string(),
                                          "--set", "experiment.runs=[study]"};
    for (const std::string& set : sets) {
      arguments.emplace_back("--set");
      arguments.push_back(set);
    }
    if (!out.empty()) arguments.insert(arguments.end(), {"--out", at(out)});
    arguments.insert(arguments.end(), options.begin(), options.end());
    return arguments;
  }
  [[nodiscard]] std::string at(const std::string& out) const {
    return (folder_.path() / out).string();
  }
  /// What was found, without times.
  [[nodiscard]] testing_support::StoredNumbers numbers(const std::string& out) const {
    std::vector<std::string> all = {"series"};
    for (const std::string& way : kWays) all.insert(all.end(), {way + "/0", way + "/1"});
    return testing_support::stored_numbers(folder_.path() / out, all, {"solve_ms"});
  }
  [[nodiscard]] Json summary() const {
    return Json::parse(read_file(folder_.path() / "run" / "summary.json"), nullptr, false);
  }
  [[nodiscard]] std::vector<double> column(const std::string& series, const char* key,
                                           const std::string& out = "run") const {
    auto results = ResultsReader::open(folder_.path() / out / "results.sqlite");
    return results ? (*results)->column(series, key).value() : std::vector<double>{};
  }

  testing_support::TemporaryFolder folder_;
};

TEST_F(IncrementalBenchmarkTest, FindsTheSameMotionsInEveryWay) {
  const Finished finished = run_it();
  ASSERT_EQ(finished.exit_code, 0) << finished.error << finished.out;
  for (const std::string series : {"/0", "/1"}) {
    const auto afresh = column("afresh" + series, "cost");
    ASSERT_EQ(afresh.size(), static_cast<std::size_t>(kProblems));
    for (const std::string& way : kWays) {
      const auto cost = column(way + series, "cost");
      for (std::size_t i = 0; i < cost.size(); ++i) EXPECT_NEAR(cost[i], afresh[i], 2e-5) << way;
    }
  }
  const auto moved = column("afresh/0", "cost");
  const auto kept = column("incremental/1", "cost");
  for (std::size_t i = 0; i < kept.size(); ++i) {
    const double known = i % 3 == 2 ? 0.048 : 0.192;
    EXPECT_NEAR(kept[i], known, 2e-5);
    EXPECT_GT(std::abs(moved[i] - known), 1e-4) << "the goal has not moved";
    EXPECT_NEAR(moved[i], known, 0.2) << "by tenths of a metre at most";
  }
}

TEST_F(IncrementalBenchmarkTest, ANewGoalTakesOneIncrementalStepWhereTheMotionIsStraight) {
  ASSERT_EQ(run_it().exit_code, 0);
  EXPECT_EQ(column("incremental/0", "accepted_iterations"), std::vector<double>(kProblems, 1.0));
  EXPECT_EQ(column("incremental/1", "accepted_iterations"), std::vector<double>(kProblems, 0.0));
}

TEST_F(IncrementalBenchmarkTest, LeavesAGoalThatMovesByNothingWhereItIs) {
  ASSERT_EQ(run_it({"experiment.goal_sd=0", "experiment.obstacle_sd_m=0"}).exit_code, 0);
  for (const char* series : {"incremental/0", "incremental/1"}) {
    const auto cost = column(series, "cost");
    ASSERT_EQ(cost.size(), static_cast<std::size_t>(kProblems));
    for (std::size_t i = 0; i < cost.size(); ++i) {
      EXPECT_NEAR(cost[i], i % 3 == 2 ? 0.048 : 0.192, 2e-5);
    }
    EXPECT_EQ(column(series, "iterations"), std::vector<double>(kProblems, 0.0));
  }
}

TEST_F(IncrementalBenchmarkTest, MovesGoalsAndBoxesAsTheSeedSays) {
  ASSERT_EQ(run_it().exit_code, 0);
  ASSERT_EQ(run_it({}, "again").exit_code, 0);
  ASSERT_EQ(run_it({"experiment.seed=8"}, "other").exit_code, 0);
  EXPECT_EQ(column("warm/0", "cost"), column("warm/0", "cost", "again"));
  EXPECT_NE(column("warm/0", "cost"), column("warm/0", "cost", "other"));
  const auto clearance = column("warm/1", "exact_clearance_m");
  EXPECT_EQ(clearance, column("warm/1", "exact_clearance_m", "again"));
  EXPECT_NE(clearance, column("warm/1", "exact_clearance_m", "other"));
}

/// A box of 0.2 m to either side, in the way of the first motion, a metre beside the second.
TEST_F(IncrementalBenchmarkTest, JudgesInTheScenesAsTheyAreThen) {
  ASSERT_EQ(run_it({"experiment.obstacle_sd_m=0.05"}).exit_code, 0);
  const auto clearance = column("incremental/1", "exact_clearance_m");
  ASSERT_EQ(clearance.size(), static_cast<std::size_t>(kProblems));
  EXPECT_LT(clearance[3], 0.0);
  EXPECT_GT(clearance[4], 0.4);
  EXPECT_NEAR(clearance[4], 1.0 - 0.2 - 0.1, 0.25);
  EXPECT_GT(std::abs(clearance[4] - 0.7), 1e-6) << "the box has not moved";
}

TEST_F(IncrementalBenchmarkTest, WritesSummaryTableAndReport) {
  const Finished finished = run_it({"experiment.repeats=2"});
  ASSERT_EQ(finished.exit_code, 0) << finished.error;
  const Json json = summary();
  EXPECT_EQ(json.at("success"), true);
  EXPECT_EQ(json.at("problems"), 2 * kProblems);
  ASSERT_EQ(json.at("rows").size(), 6u) << "two changes, three ways";
  for (const Json& row : json.at("rows")) {
    EXPECT_EQ(row.at("problems"), kProblems);
    EXPECT_EQ(row.at("solved"), kProblems);
    EXPECT_NEAR(row.at("/cost_ratio/p50"_json_pointer), 1.0, 1e-3);
    EXPECT_EQ(row.at("/cost_ratio/share_within_1pct"_json_pointer), 1.0);
    EXPECT_NEAR(row.at("/collision_free/share"_json_pointer), 5.0 / 6, 1e-12);
  }
  const Json incremental = json.at("rows")[2];
  EXPECT_EQ(incremental.at("way"), "incremental");
  auto ours = column("incremental/0", "solve_ms");
  const auto theirs = column("afresh/0", "solve_ms");
  std::vector<double> ratios;
  for (std::size_t i = 0; i < ours.size(); ++i) ratios.push_back(ours[i] / theirs[i]);
  std::ranges::sort(ratios);
  EXPECT_NEAR(incremental.at("/time_ratio/p50"_json_pointer), 0.5 * (ratios[2] + ratios[3]), 1e-9);
  std::ranges::sort(ours);
  EXPECT_NEAR(incremental.at("/solve_ms/p50"_json_pointer), 0.5 * (ours[2] + ours[3]), 1e-12);

  const fs::path out = folder_.path() / "run";
  EXPECT_EQ(std::ranges::count(read_file(out / "table.csv"), '\n'), 7);
  EXPECT_THAT(read_file(out / "report.html"), HasSubstr("<h2>Costs and collisions</h2>"));
  EXPECT_THAT(finished.out, HasSubstr("of the time of solving afresh"));
  const Finished compared = run({"report", out.string(), out.string()});
  EXPECT_EQ(compared.exit_code, 0) << compared.error;
  EXPECT_THAT(compared.out, HasSubstr("incremental"));
}

TEST_F(IncrementalBenchmarkTest, ShardsTogetherAreTheWholeRun) {
  ASSERT_EQ(run_it({}, "whole").exit_code, 0);
  ASSERT_EQ(run_it({}, "a", {"--shard", "1/3"}).exit_code, 0);
  ASSERT_EQ(run_it({}, "b", {"--shard", "2/3"}).exit_code, 0);
  ASSERT_EQ(run_it({}, "c", {"--shard", "3/3"}).exit_code, 0);
  // A shard has one pair, in both scenes: 6 D^2 / T^3.
  for (const auto& [shard, known] : {std::pair("a", 0.192), {"b", 0.192}, {"c", 0.048}}) {
    for (const std::string& way : kWays) {
      const auto cost = column(way + "/1", "cost", shard);
      ASSERT_EQ(cost.size(), 2u) << shard;
      for (const double one : cost) EXPECT_NEAR(one, known, 2e-5) << shard << " " << way;
    }
  }
  const Finished merged = run({"report", at("c"), at("a"), at("b"), "--merged", at("merged")});
  ASSERT_EQ(merged.exit_code, 0) << merged.error;
  EXPECT_THAT(merged.out, HasSubstr("Success: 12 changed problems"));
  EXPECT_EQ(numbers("merged"), numbers("whole"));
  EXPECT_EQ(numbers("whole").size(), 4u * 2 + 10u * 2 * 3 * kProblems);
  ASSERT_EQ(run_it({}, "jobs", {"--jobs", "2"}).exit_code, 0);
  EXPECT_EQ(numbers("jobs"), numbers("whole"));
  const Finished lacking = run({"report", at("a"), at("b"), "--merged", at("lacking")});
  EXPECT_EQ(lacking.exit_code, 1);
  EXPECT_THAT(lacking.out, HasSubstr("Incomplete: 8 of 12 changed problems"));
}

TEST_F(IncrementalBenchmarkTest, ShardsThatDoNotFitAreRefused) {
  ASSERT_EQ(run_it({}, "a", {"--shard", "1/2"}).exit_code, 0);
  ASSERT_EQ(run_it({"experiment.goal_sd=0.2"}, "b", {"--shard", "2/2"}).exit_code, 0);
  const auto refused = [&](const std::string& other, const std::string& message) {
    const Finished merged = run({"report", at("a"), at(other), "--merged", at("merged")});
    EXPECT_EQ(merged.exit_code, 2) << message;
    EXPECT_THAT(merged.error, HasSubstr(message));
  };
  refused("a", "shard 1/2 is there twice");
  refused("b", "`goal_sd: 0.1` there, `goal_sd: 0.2` here");
}

TEST_F(IncrementalBenchmarkTest, AnInterruptedRunGoesOn) {
  const std::vector<std::string> long_one = {"experiment.repeats=1000"};
  CommandLine command(arguments(long_one, "run", {}));
  ASSERT_TRUE(command.wait_for("study, signed, other goal"));
  command.send(SIGINT);
  const Finished interrupted = command.wait();
  ASSERT_EQ(interrupted.exit_code, 1) << interrupted.error;
  EXPECT_EQ(summary().at("complete"), false);
  const auto before = column("warm/0", "repeats");
  ASSERT_FALSE(before.empty());
  EXPECT_LT(*std::ranges::min_element(before), 1000.0);
  const Finished resumed = run(arguments(long_one, "", {"--resume", at("run")}));
  ASSERT_EQ(resumed.exit_code, 0) << resumed.error;
  EXPECT_EQ(column("warm/1", "repeats"), std::vector<double>(kProblems, 1000.0));
  EXPECT_EQ(summary().at("/time/sessions"_json_pointer), 2);
  ASSERT_EQ(run_it(long_one, "whole").exit_code, 0);
  EXPECT_EQ(numbers("run"), numbers("whole"));
}

TEST_F(IncrementalBenchmarkTest, RefusesWhatItSetsItself) {
  const auto refused = [&](const std::string& set, const std::string& message) {
    const Finished finished = run_it({set});
    EXPECT_EQ(finished.exit_code, 2) << message;
    EXPECT_THAT(finished.error, HasSubstr(message));
  };
  refused("optimiser.incremental=true", "'incremental' is set by the experiment");
  refused("optimiser.max_iterations=7", "'max_iterations' is set by the experiment");
  refused("optimiser.plugin=gp_ceres", "the optimiser 'gp_ceres' has no parameter 'incremental'");
  refused("experiment.runs=[studi]", "did you mean 'study'?");
}

}  // namespace
}  // namespace sidestep::testing
