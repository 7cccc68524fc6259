#include <unistd.h>

#include <algorithm>
#include <array>
#include <ctime>
#include <map>
#include <variant>

#include <sidestep/runtime/sqlite.hpp>

#include "planner_rows.hpp"

namespace sidestep {
namespace {

/// The tables that OMPL's own tool makes, with what our runs have to tell. Columns of `runs` that
/// are text are not plotted.
constexpr const char* kTables = R"(
  PRAGMA foreign_keys = ON;
  CREATE TABLE experiments (
    id INTEGER PRIMARY KEY AUTOINCREMENT, name VARCHAR(512), totaltime REAL, timelimit REAL,
    memorylimit REAL, runcount INTEGER, version VARCHAR(128), hostname VARCHAR(1024), cpuinfo TEXT,
    date DATETIME, seed VARCHAR(24), setup TEXT);
  CREATE TABLE plannerConfigs (
    id INTEGER PRIMARY KEY AUTOINCREMENT, name VARCHAR(512) NOT NULL, settings TEXT);
  CREATE TABLE enums (
    name VARCHAR(512), value INTEGER, description TEXT, PRIMARY KEY (name, value));
  CREATE TABLE runs (
    id INTEGER PRIMARY KEY AUTOINCREMENT, experimentid INTEGER, plannerid INTEGER,
    time REAL, solved BOOLEAN, correct_solution BOOLEAN, status ENUM, first_solution_time REAL,
    solution_length REAL, solution_smoothness REAL, solution_clearance REAL, solution_duration REAL,
    stops_at_corners BOOLEAN, problem VARCHAR(24), seed VARCHAR(24),
    FOREIGN KEY (experimentid) REFERENCES experiments(id) ON DELETE CASCADE,
    FOREIGN KEY (plannerid) REFERENCES plannerConfigs(id) ON DELETE CASCADE);
  CREATE TABLE progress (
    runid INTEGER, time REAL, best_cost REAL, PRIMARY KEY (runid, time),
    FOREIGN KEY (runid) REFERENCES runs(id) ON DELETE CASCADE);
  BEGIN;
)";

/// OMPL's own statuses by number, and one more.
constexpr std::array kStatuses = {"Unknown status",         "Invalid start", "Invalid goal",
                                  "Unrecognized goal type", "Timeout",       "Approximate solution",
                                  "Exact solution",         "Crash",         "Abort",
                                  "Refused by the check"};
enum Status : std::int64_t { kTimeout = 4, kExactSolution = 6, kRefused = 9 };

/// Times at which progress is told of, evenly up to the deadline.
constexpr int kProgressTimes = 50;

using Value = std::variant<std::nullptr_t, std::int64_t, double, std::string>;

/// A database being written.
class Writer {
 public:
  [[nodiscard]] Result<void> open(const std::filesystem::path& file) {
    SIDESTEP_TRY(database_.open(file, SqliteDatabase::Mode::kCreate));
    return database_.execute(kTables);
  }
  /// Adds a row with a value for each column; its id.
  [[nodiscard]] Result<std::int64_t> insert(const std::string& table,
                                            const std::vector<Value>& row) {
    SqliteStatement& statement = statements_[table];
    if (!statement) {
      std::string sql = "INSERT INTO " + table + " VALUES (?";
      for (std::size_t i = 1; i < row.size(); ++i) sql += ", ?";
      statement = SIDESTEP_TRY(database_.prepare(sql + ")", "cannot write the database"));
    }
    SqliteQuery query(statement);
    for (const Value& value : row) {
      std::visit([&](const auto& its) { query.bind(its); }, value);
    }
    SIDESTEP_TRY(database_.run(query));
    return database_.last_id();
  }
  [[nodiscard]] Result<void> finish() const { return database_.execute("COMMIT;"); }

 private:
  SqliteDatabase database_{"the database"};
  std::map<std::string, SqliteStatement> statements_;
};

std::string host_name() {
  std::array<char, 256> name{};
  return gethostname(name.data(), name.size() - 1) == 0 ? name.data() : "";
}

std::string date_text() {
  const std::time_t now = std::time(nullptr);
  std::tm utc{};
  gmtime_r(&now, &utc);
  std::array<char, 32> text{};
  std::strftime(text.data(), text.size(), "%Y-%m-%d %H:%M:%S", &utc);
  return text.data();
}

/// Of one family: how long its runs took in all, and the most that a planner has of them.
std::vector<Value> experiment_row(const PlannerBenchmarkRecord& record, const std::string& family) {
  double total_s = 0.0;
  std::int64_t most = 0;
  for (const PlannerRecord& planner : record.planners) {
    std::int64_t runs = 0;
    for (const SetSolve& solve : planner.solves) {
      if (solve.family != family) continue;
      total_s += 1e-3 * solve.spent_ms;
      ++runs;
    }
    most = std::max(most, runs);
  }
  return {Value(),
          family,
          total_s,
          record.deadline_s,
          0.0,
          most,
          "Sidestep " + record.provenance.version,
          host_name(),
          record.provenance.cpu,
          date_text(),
          std::to_string(record.provenance.seed),
          record.identity};
}

std::vector<Value> run_row(const SetSolve& solve, std::int64_t experiment, std::int64_t planner,
                           std::uint64_t first_seed) {
  const bool is_solved = solve.is_solved();
  const auto if_solved = [&](double value) { return is_solved ? Value(value) : Value(); };
  const std::int64_t status = is_solved          ? kExactSolution
                              : solve.is_found() ? kRefused
                                                 : kTimeout;  // "failed to find a solution"
  return {Value(),
          experiment,
          planner,
          1e-3 * (is_solved ? solve.time_ms() : solve.spent_ms),
          std::int64_t{is_solved},
          solve.is_found() ? Value(std::int64_t{is_solved}) : Value(),
          status,
          if_solved(1e-3 * solve.first_ms()),
          if_solved(solve.path_length()),
          if_solved(solve.acceleration_ratio),
          if_solved(solve.clearance_m),
          if_solved(solve.duration_s),
          is_solved ? Value(std::int64_t{!solve.is_smooth()}) : Value(),
          std::to_string(solve.index),
          std::to_string(first_seed + static_cast<std::uint64_t>(solve.seed))};
}

/// The same times for every run: the tool averages over runs, time by time.
Result<void> insert_progress(const SetSolve& solve, std::int64_t run, double deadline_s,
                             Writer& writer) {
  for (int i = 1; i <= kProgressTimes; ++i) {
    const double time_s = deadline_s * i / kProgressTimes;
    Value best;
    for (const TimedAnswer& answer : solve.answers) {
      if (solve.is_solved() && 1e-3 * answer.time_ms <= time_s) best = double{answer.path_length};
    }
    SIDESTEP_TRY(writer.insert("progress", {run, time_s, best}));
  }
  return {};
}

}  // namespace

Result<void> write_ompl_database(const PlannerBenchmarkRecord& record,
                                 const std::filesystem::path& file) {
  std::error_code ignored;
  std::filesystem::remove(file, ignored);
  Writer writer;
  SIDESTEP_TRY(writer.open(file));
  for (std::size_t i = 0; i < kStatuses.size(); ++i) {
    SIDESTEP_TRY(writer.insert(
        "enums", {std::string("status"), static_cast<std::int64_t>(i), std::string(kStatuses[i])}));
  }
  std::map<std::string, std::int64_t> experiments;
  for (const ProblemName& name : record.names) {
    auto& id = experiments[name.family];
    if (id != 0) continue;
    id = SIDESTEP_TRY(writer.insert("experiments", experiment_row(record, name.family)));
  }
  for (const PlannerRecord& planner : record.planners) {
    const std::int64_t id =
        SIDESTEP_TRY(writer.insert("plannerConfigs", {Value(), planner.name, planner.settings}));
    for (const SetSolve& solve : planner.solves) {
      const std::int64_t run = SIDESTEP_TRY(writer.insert(
          "runs", run_row(solve, experiments[solve.family], id, record.provenance.seed)));
      SIDESTEP_TRY(insert_progress(solve, run, record.deadline_s, writer));
    }
  }
  return writer.finish();
}

}  // namespace sidestep
