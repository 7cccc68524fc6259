#include "planner_rows.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <sqlite3.h>

#include "support/temporary_folder.hpp"

namespace sidestep {
namespace {

/// The first column of a query's only row, or -1.
double value_of(const std::filesystem::path& file, const std::string& query) {
  sqlite3* database = nullptr;
  sqlite3_stmt* statement = nullptr;
  double value = -1.0;
  if (sqlite3_open_v2(file.c_str(), &database, SQLITE_OPEN_READONLY, nullptr) == SQLITE_OK &&
      sqlite3_prepare_v2(database, query.c_str(), -1, &statement, nullptr) == SQLITE_OK &&
      sqlite3_step(statement) == SQLITE_ROW) {
    value = sqlite3_column_double(statement, 0);
  }
  sqlite3_finalize(statement);
  sqlite3_close(database);
  return value;
}

/// Two families and a planner: a problem solved twice over, one refused, one without an answer.
PlannerBenchmarkRecord small_benchmark() {
  PlannerBenchmarkRecord record;
  record.provenance.seed = 40;
  record.deadline_s = 5.0;
  record.names = {{"shelf", 1}, {"shelf", 2}, {"cage", 1}};
  PlannerRecord planner{"it's \"quoted\"", "primitives", "settings", {}};
  for (std::int64_t problem = 0; problem < 3; ++problem) {
    SetSolve solve;
    solve.problem = problem;
    solve.family = record.names[static_cast<std::size_t>(problem)].family;
    solve.index = record.names[static_cast<std::size_t>(problem)].index;
    solve.spent_ms = 5000.0;
    planner.solves.push_back(solve);
  }
  planner.solves[0].answers = {{250.0f, 8.0f, false}, {1250.0f, 6.0f, true}};
  planner.solves[1].answers = {{10.0f, 4.0f, true}};
  planner.solves[1].refusal = "in collision";
  record.planners = {planner};
  return record;
}

TEST(OmplDatabase, HasARunForEachAnswerSolvedWhereTheCheckAccepts) {
  const testing_support::TemporaryFolder folder;
  const auto file = folder.write("ompl_benchmark.db", "what was there before");
  const auto written = write_ompl_database(small_benchmark(), file);
  ASSERT_TRUE(written) << written.error().describe();
  EXPECT_EQ(value_of(file, "SELECT count(*) FROM experiments"), 2);
  EXPECT_EQ(value_of(file, "SELECT runcount FROM experiments WHERE name = 'shelf'"), 2);
  EXPECT_EQ(value_of(file, "SELECT timelimit FROM experiments WHERE name = 'cage'"), 5.0);
  EXPECT_EQ(value_of(file, "SELECT count(*) FROM plannerConfigs WHERE settings = 'settings'"), 1);
  EXPECT_EQ(value_of(file, "SELECT count(*) FROM runs"), 3);
  EXPECT_EQ(value_of(file, "SELECT sum(solved) FROM runs"), 1);
  EXPECT_EQ(value_of(file, "SELECT time FROM runs WHERE solved"), 1.25);
  EXPECT_EQ(value_of(file, "SELECT first_solution_time FROM runs WHERE solved"), 0.25);
  EXPECT_EQ(value_of(file, "SELECT solution_length FROM runs WHERE solved"), 6.0);
  EXPECT_EQ(value_of(file, "SELECT count(*) FROM runs WHERE correct_solution = 0"), 1);
  EXPECT_EQ(value_of(file,
                     "SELECT count(*) FROM runs JOIN enums ON enums.name = 'status' AND "
                     "enums.value = runs.status WHERE description = 'Exact solution'"),
            1);
  EXPECT_EQ(value_of(file, "SELECT count(*) FROM runs WHERE seed = '40'"), 3);
}

TEST(OmplDatabase, ProgressIsThePathThatWasBestSoFar) {
  const testing_support::TemporaryFolder folder;
  const auto file = folder.path() / "ompl_benchmark.db";
  ASSERT_TRUE(write_ompl_database(small_benchmark(), file));
  const std::string of_solved =
      " FROM progress JOIN runs ON runs.id = runid AND solved WHERE abs(progress.time - ";
  EXPECT_EQ(value_of(file, "SELECT best_cost IS NULL" + of_solved + "0.2) < 1e-9"), 1);
  EXPECT_EQ(value_of(file, "SELECT best_cost" + of_solved + "0.3) < 1e-9"), 8.0);
  EXPECT_EQ(value_of(file, "SELECT best_cost" + of_solved + "5.0) < 1e-9"), 6.0);
  EXPECT_EQ(value_of(file, "SELECT count(best_cost) FROM progress"), 48);  // 0.3 s, 0.4 s, ... 5 s
  EXPECT_EQ(value_of(file, "SELECT count(*) FROM progress"), 3 * 50);
}

TEST(OmplDatabase, TellsWhereItCannotBeWritten) {
  const testing_support::TemporaryFolder folder;
  const auto written =
      write_ompl_database(small_benchmark(), folder.path() / "none" / "ompl_benchmark.db");
  ASSERT_FALSE(written);
  EXPECT_EQ(written.error().code, ErrorCode::kIo);
}

}  // namespace
}  // namespace sidestep
