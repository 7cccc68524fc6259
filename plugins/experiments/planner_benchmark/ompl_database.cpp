#include <unistd.h>

#include <algorithm>
#include <array>
#include <ctime>
#include <map>
#include <memory>
#include <optional>
#include <string>
#include <variant>

#include <sqlite3.h>

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

using Value = std::variant<std::monostate, std::int64_t, double, std::string>;

/// A database being written; the first failure is kept.
class Writer {
 public:
  explicit Writer(const std::filesystem::path& file) : file_(file.string()) {
    sqlite3* raw = nullptr;
    keep(sqlite3_open(file_.c_str(), &raw));
    database_.reset(raw);
    execute(kTables);
  }

  void execute(const char* sql) {
    if (!error_) keep(sqlite3_exec(database_.get(), sql, nullptr, nullptr, nullptr));
  }
  /// Adds a row with a value for each column; its id.
  std::int64_t insert(const std::string& table, const std::vector<Value>& row) {
    auto& statement = statements_[table];
    if (!statement && !error_) {
      std::string sql = "INSERT INTO " + table + " VALUES (?";
      for (std::size_t i = 1; i < row.size(); ++i) sql += ", ?";
      sqlite3_stmt* raw = nullptr;
      keep(sqlite3_prepare_v2(database_.get(), (sql + ")").c_str(), -1, &raw, nullptr));
      statement.reset(raw);
    }
    if (error_) return 0;
    int column = 0;
    for (const Value& value : row) bind(statement.get(), ++column, value);
    if (const int status = sqlite3_step(statement.get()); status != SQLITE_DONE) keep(status);
    sqlite3_reset(statement.get());
    return sqlite3_last_insert_rowid(database_.get());
  }
  [[nodiscard]] Result<void> finish() {
    execute("COMMIT;");
    if (error_) return tl::make_unexpected(*error_);
    return {};
  }

 private:
  struct Close {
    void operator()(sqlite3* database) const { sqlite3_close(database); }
  };
  struct Finalize {
    void operator()(sqlite3_stmt* statement) const { sqlite3_finalize(statement); }
  };

  void keep(int status) {
    if (status == SQLITE_OK || error_) return;
    error_ = Error{ErrorCode::kIo,
                   std::string("cannot write the database: ") + sqlite3_errmsg(database_.get()),
                   file_,
                   {},
                   nullptr};
  }
  static void bind(sqlite3_stmt* statement, int at, const Value& value) {
    if (const auto* integer = std::get_if<std::int64_t>(&value)) {
      sqlite3_bind_int64(statement, at, *integer);
    } else if (const auto* number = std::get_if<double>(&value)) {
      sqlite3_bind_double(statement, at, *number);
    } else if (const auto* text = std::get_if<std::string>(&value)) {
      sqlite3_bind_text(statement, at, text->data(), static_cast<int>(text->size()),
                        SQLITE_TRANSIENT);
    } else {
      sqlite3_bind_null(statement, at);
    }
  }

  std::string file_;
  std::unique_ptr<sqlite3, Close> database_;
  std::map<std::string, std::unique_ptr<sqlite3_stmt, Finalize>> statements_;
  std::optional<Error> error_;
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
void insert_progress(const SetSolve& solve, std::int64_t run, double deadline_s, Writer& writer) {
  for (int i = 1; i <= kProgressTimes; ++i) {
    const double time_s = deadline_s * i / kProgressTimes;
    Value best;
    for (const TimedAnswer& answer : solve.answers) {
      if (solve.is_solved() && 1e-3 * answer.time_ms <= time_s) best = double{answer.path_length};
    }
    writer.insert("progress", {run, time_s, best});
  }
}

}  // namespace

Result<void> write_ompl_database(const PlannerBenchmarkRecord& record,
                                 const std::filesystem::path& file) {
  std::error_code ignored;
  std::filesystem::remove(file, ignored);
  Writer writer(file);
  for (std::size_t i = 0; i < kStatuses.size(); ++i) {
    writer.insert("enums",
                  {std::string("status"), static_cast<std::int64_t>(i), std::string(kStatuses[i])});
  }
  std::map<std::string, std::int64_t> experiments;
  for (const ProblemName& name : record.names) {
    auto& id = experiments[name.family];
    if (id == 0) id = writer.insert("experiments", experiment_row(record, name.family));
  }
  for (const PlannerRecord& planner : record.planners) {
    const std::int64_t id =
        writer.insert("plannerConfigs", {Value(), planner.name, planner.settings});
    for (const SetSolve& solve : planner.solves) {
      const std::int64_t run = writer.insert(
          "runs", run_row(solve, experiments[solve.family], id, record.provenance.seed));
      insert_progress(solve, run, record.deadline_s, writer);
    }
  }
  return writer.finish();
}

}  // namespace sidestep
