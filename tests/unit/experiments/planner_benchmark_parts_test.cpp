#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <nlohmann/json.hpp>

#include "planner_rows.hpp"
#include "support/temporary_folder.hpp"

namespace sidestep {
namespace {

using ::testing::HasSubstr;

/// Cubics through the given positions, at rest at each of them.
Trajectory motion(const std::vector<double>& times_s, const std::vector<Eigen::Vector2d>& q) {
  Trajectory motion;
  motion.dof = 2;
  motion.times_s = times_s;
  for (const Eigen::Vector2d& at : q) {
    motion.positions.insert(motion.positions.end(), {at.x(), at.y()});
    motion.velocities.insert(motion.velocities.end(), {0.0, 0.0});
  }
  return motion;
}

TEST(PathQuality, AStraightCubicFromRestToRestIsTheSmoothest) {
  const Trajectory cubic = motion({0.0, 2.5}, {{1.0, -1.0}, {4.0, 3.0}});
  EXPECT_NEAR(path_length(cubic), 5.0, 1e-12);
  EXPECT_NEAR(acceleration_ratio(cubic), 1.0, 1e-5);
}

TEST(PathQuality, AStopHalfWayTakesFourTimesTheAcceleration) {
  const Trajectory halting = motion({0.0, 1.0, 2.0}, {{0.0, 0.0}, {1.5, 2.0}, {3.0, 4.0}});
  EXPECT_NEAR(acceleration_ratio(halting), 4.0, 1e-4);
  const Trajectory corner = motion({0.0, 1.0, 2.0}, {{0.0, 0.0}, {2.5, 0.0}, {2.5, 2.5}});
  EXPECT_NEAR(acceleration_ratio(corner), 4.0, 1e-4);
}

TEST(PathQuality, ConstantAccelerationThereAndBackIsAThirdAboveTheLeast) {
  // a = 1 up to t = 1 and -1 from there on: q(1) = 0.5, qdot(1) = 1; L = 1, T = 2.
  Trajectory bang = motion({0.0, 1.0, 2.0}, {{0.0, 0.0}, {0.5, 0.0}, {1.0, 0.0}});
  bang.qdot(1)[0] = 1.0;
  EXPECT_NEAR(acceleration_ratio(bang), 4.0 / 3.0, 1e-5);
}

TEST(PathQuality, DoesNotDependOnUnitsOfTimeOrLength) {
  Trajectory wavy = motion({0.0, 0.7, 2.0}, {{0.0, 0.0}, {0.4, 0.9}, {1.0, 0.0}});
  wavy.qdot(1)[0] = 0.6;
  const double ratio = acceleration_ratio(wavy);
  EXPECT_GT(ratio, 1.0);
  for (double& time_s : wavy.times_s) time_s *= 3.0;
  for (double& q : wavy.positions) q *= 5.0;
  wavy.qdot(1)[0] *= 5.0 / 3.0;
  EXPECT_NEAR(acceleration_ratio(wavy), ratio, 1e-12 * ratio);
}

TEST(PathQuality, AVelocityThatJumpsALittleCountsLittle) {
  Trajectory cubic = motion({0.0, 1.0, 2.0}, {{0.0, 0.0}, {0.5, 0.0}, {1.0, 0.0}});
  cubic.qdot(1)[0] = 0.75;
  ASSERT_NEAR(acceleration_ratio(cubic), 1.0, 1e-5);
  Trajectory jumping = motion({0.0, 1.0, 1.0 + 1e-12, 2.0},
                              {{0.0, 0.0}, {0.5, 0.0}, {0.5 + 0.75e-12, 0.0}, {1.0, 0.0}});
  jumping.qdot(1)[0] = 0.75;
  jumping.qdot(2)[0] = 0.75 + 1e-4;
  EXPECT_NEAR(acceleration_ratio(jumping), 1.0, 1e-3);
}

SetSolve answered(std::int64_t problem, int seed, std::vector<TimedAnswer> answers) {
  SetSolve solve;
  solve.problem = problem;
  solve.seed = seed;
  solve.answers = std::move(answers);
  solve.spent_ms = 3000.0;
  solve.duration_s = 2.5;
  solve.acceleration_ratio = 1.25;
  solve.clearance_m = 0.0625;
  solve.guess = "sampled";
  return solve;
}

PlannerBenchmarkRecord three_problems() {
  PlannerBenchmarkRecord record;
  record.identity = "experiment:\n  type: planner_benchmark\n";
  record.provenance.seed = 7;
  record.problems = "set";
  record.robot = "arm";
  record.deadline_s = 4.0;
  record.seeds = 2;
  record.names = {{"shelf", 1}, {"shelf", 2}, {"cage", 1}};
  PlannerRecord planner{"both", "primitives", "name: both\n", {}};
  for (int seed = 0; seed < 2; ++seed) {
    planner.solves.push_back(
        answered(0, seed, {{2.0f, 6.5f, false}, {8.0f, 7.0f, true}, {64.0f, 5.0f, true}}));
    planner.solves.push_back(answered(1, seed, {{2048.0f, 9.0f, false}}));
    planner.solves.push_back(answered(2, seed, {}));
    planner.solves.back().reason = "no way out";
  }
  for (SetSolve& solve : planner.solves) {
    solve.family = record.names[static_cast<std::size_t>(solve.problem)].family;
    solve.index = record.names[static_cast<std::size_t>(solve.problem)].index;
  }
  record.planners = {planner};
  return record;
}

nlohmann::json summary_of(const PlannerBenchmarkRecord& record) {
  return nlohmann::json::parse(summarise_planners(record, false, std::nullopt).summary_json);
}

TEST(PlannerRows, TimeCountsUntilAnAnswerOfTheKindThatWasGivenLast) {
  const PlannerBenchmarkRecord record = three_problems();
  const std::vector<SetSolve>& solves = record.planners[0].solves;
  EXPECT_EQ(solves[0].first_ms(), 2.0);
  EXPECT_EQ(solves[0].time_ms(), 8.0);
  EXPECT_EQ(solves[0].path_length(), 5.0);
  EXPECT_EQ(solves[1].time_ms(), 2048.0);
  EXPECT_FALSE(solves[1].is_smooth());
  EXPECT_FALSE(solves[2].is_found());
  EXPECT_EQ(solves[2].time_ms(), 0.0);
}

TEST(PlannerRows, AStoreGivesBackWhatWasRecorded) {
  const testing_support::TemporaryFolder folder;
  const auto file = folder.path() / "results.sqlite";
  const PlannerBenchmarkRecord record = three_problems();
  {
    auto store = ResultsStore::open(file, {});
    ASSERT_TRUE(store);
    Recorder recorder(**store);
    record_planners(record, recorder);
    record_session({1.5, 2.5, 2, 6}, 0, recorder);
    ASSERT_TRUE(recorder.commit());
  }
  const auto read = read_planner_record(file);
  ASSERT_TRUE(read) << read.error().describe();
  EXPECT_EQ(read->identity, record.identity);
  EXPECT_EQ(read->deadline_s, 4.0);
  EXPECT_EQ(read->sessions.size(), 1u);
  EXPECT_EQ(read->solved(), 6);
  EXPECT_EQ(read->planned(), 6);
  const SetSolve& second = read->planners[0].solves[3];
  EXPECT_EQ(second.seed, 1);
  EXPECT_EQ(second.problem, 0);
  EXPECT_EQ(second.answers.size(), 3u);
  EXPECT_EQ(second.spent_ms, 3000.0);
  EXPECT_EQ(read->planners[0].solves[5].reason, "no way out");
  auto summary = summary_of(record), again = summary_of(*read);
  for (auto* json : {&summary, &again}) json->erase("time");
  EXPECT_EQ(summary, again);
}

TEST(PlannerRows, WhatIsNotABenchmarksStoreIsRefused) {
  const testing_support::TemporaryFolder folder;
  const auto file = folder.path() / "results.sqlite";
  ASSERT_TRUE(ResultsStore::open(file, {}));
  EXPECT_THAT(read_planner_record(file).error().describe(),
              HasSubstr("no 'identity' of 'benchmark'"));
}

TEST(PlannerSummary, SharesAreOfAllAnswersAndTimesOfThoseThatTheCheckAccepts) {
  PlannerBenchmarkRecord record = three_problems();
  auto planner = summary_of(record)["planners"][0];
  EXPECT_EQ(planner["problems"], 3);
  EXPECT_EQ(planner["answers"], 6);
  EXPECT_DOUBLE_EQ(planner["solved_share"]["s1"], 1.0 / 3.0);
  EXPECT_DOUBLE_EQ(planner["solved_share"]["s5"], 2.0 / 3.0);
  EXPECT_DOUBLE_EQ(planner["smooth_share"], 1.0 / 3.0);
  EXPECT_EQ(planner["first_valid_ms"]["p50"], 0.5 * (2.0 + 2048.0));
  EXPECT_EQ(planner["time_ms"]["p50"], 0.5 * (8.0 + 2048.0));
  EXPECT_EQ(planner["path_length_rad"]["p50"], 7.0);
  EXPECT_EQ(planner["refused_by_check"], 0);
  EXPECT_EQ(summary_of(record)["success"], true);

  record.planners[0].solves[1].refusal = "in collision";
  planner = summary_of(record)["planners"][0];
  EXPECT_DOUBLE_EQ(planner["solved_share"]["s5"], 0.5);
  EXPECT_EQ(planner["refused_by_check"], 1);
  EXPECT_EQ(summary_of(record)["success"], false);
}

TEST(PlannerSummary, WhatIsMissingIsTold) {
  PlannerBenchmarkRecord record = three_problems();
  record.planners[0].solves.pop_back();
  EXPECT_EQ(summary_of(record)["complete"], false);
  EXPECT_THAT(summarise_planners(record, false, std::nullopt).verdict,
              HasSubstr("Incomplete: 5 of 6 answers"));
  EXPECT_TRUE(summarise_planners(record, true, std::nullopt).interrupted);
  record.shard = {1, 2};  // of three problems, the second
  EXPECT_EQ(record.planned(), 2);
}

TEST(PlannerSummary, ShardsInAnyOrderMakeTheWhole) {
  const PlannerBenchmarkRecord whole = three_problems();
  PlannerBenchmarkRecord even = whole, odd = whole;
  std::erase_if(even.planners[0].solves, [](const SetSolve& s) { return s.problem == 1; });
  std::erase_if(odd.planners[0].solves, [](const SetSolve& s) { return s.problem != 1; });
  absorb_planners(odd, even);
  EXPECT_EQ(summary_of(odd), summary_of(whole));
  EXPECT_EQ(odd.planners[0].solves[1].problem, 1);
}

TEST(PlannerFigures, ShowNothingWhereNothingWasSolved) {
  PlannerBenchmarkRecord record = three_problems();
  EXPECT_EQ(planner_figures(record).size(), 2u);
  record.planners[0].solves.clear();
  EXPECT_TRUE(planner_figures(record).empty());
}

}  // namespace
}  // namespace sidestep
