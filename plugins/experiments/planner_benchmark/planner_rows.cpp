#include "planner_rows.hpp"

#include <algorithm>

#include <sidestep/results/stored_values.hpp>

namespace sidestep {
namespace {

constexpr const char* kHead = "benchmark";
constexpr const char* kAnswers = "answers";
constexpr int kAnswerColumns = 3;

std::string series_of(const std::string& planner) { return "solve/" + planner; }

/// One row an answer.
StoredArray answers_array(const std::vector<TimedAnswer>& answers) {
  StoredArray array{static_cast<int>(answers.size()), kAnswerColumns, {}};
  for (const TimedAnswer& answer : answers) {
    array.values.push_back(answer.time_ms);
    array.values.push_back(answer.path_length);
    array.values.push_back(answer.is_smooth ? 1.0f : 0.0f);
  }
  return array;
}

std::vector<TimedAnswer> answers_of(const StoredArray& array) {
  std::vector<TimedAnswer> answers;
  for (std::size_t i = 0; i + kAnswerColumns <= array.values.size(); i += kAnswerColumns) {
    answers.push_back({array.values[i], array.values[i + 1], array.values[i + 2] != 0.0f});
  }
  return answers;
}

/// Reads what a planner has solved; the first failure is kept.
class SolveReader {
 public:
  SolveReader(ResultsReader& reader, const std::string& file, std::optional<Error>& error)
      : reader_(reader), file_(file), error_(error) {}

  std::vector<SetSolve> read(const std::string& planner, const std::vector<ProblemName>& names) {
    const std::string series = series_of(planner);
    ColumnReader columns(reader_, series, file_);
    const auto spent_ms = columns.column("spent_ms");
    const auto duration_s = columns.column("duration_s");
    const auto ratio = columns.column("acceleration_ratio");
    const auto clearance_m = columns.column("clearance_m");
    keep(columns.error());
    std::vector<SetSolve> solves;
    for (std::size_t i = 0; i < columns.items().size() && !error_; ++i) {
      const std::int64_t item = columns.items()[i];
      ItemReader texts(reader_, series, item, file_);
      SetSolve solve;
      solve.problem = item % std::ssize(names);
      solve.seed = static_cast<int>(item / std::ssize(names));
      solve.family = names[static_cast<std::size_t>(solve.problem)].family;
      solve.index = names[static_cast<std::size_t>(solve.problem)].index;
      solve.spent_ms = spent_ms[i];
      solve.duration_s = duration_s[i];
      solve.acceleration_ratio = ratio[i];
      solve.clearance_m = clearance_m[i];
      solve.refusal = texts.text("refusal");
      solve.reason = texts.text("reason");
      solve.guess = texts.text("guess");
      keep(texts.error());
      auto answers = reader_.array(series, item, kAnswers);
      if (answers && *answers) solve.answers = answers_of(**answers);
      if (!answers) keep(std::move(answers.error()));
      solves.push_back(std::move(solve));
    }
    return solves;
  }

 private:
  void keep(std::optional<Error> error) {
    if (!error_) error_ = std::move(error);
  }
  ResultsReader& reader_;
  const std::string& file_;
  std::optional<Error>& error_;
};

}  // namespace

double SetSolve::first_ms() const noexcept { return is_found() ? answers.front().time_ms : 0.0; }

double SetSolve::time_ms() const noexcept {
  const auto found = std::ranges::find(answers, is_smooth(), &TimedAnswer::is_smooth);
  return found != answers.end() ? found->time_ms : 0.0;
}

std::int64_t PlannerBenchmarkRecord::planned() const {
  std::int64_t ours = 0;
  for (std::int64_t problem = 0; problem < std::ssize(names); ++problem) ours += is_ours(problem);
  return ours * seeds * std::ssize(planners);
}

std::int64_t PlannerBenchmarkRecord::solved() const {
  std::int64_t sum = 0;
  for (const PlannerRecord& planner : planners) sum += std::ssize(planner.solves);
  return sum;
}

void record_planner_head(const PlannerBenchmarkRecord& record, Recorder& recorder) {
  record_run_head(record, kHead, recorder);
  const auto add = [&](std::string_view key, const auto& value) {
    recorder.add(kHead, 0, key, value);
  };
  add("problems", record.problems);
  add("robot", record.robot);
  add("deadline_s", record.deadline_s);
  add("seeds", record.seeds);
  add("planners", record.planners.size());
  add("size", record.names.size());
  std::int64_t item = 0;
  for (const PlannerRecord& planner : record.planners) {
    recorder.add("planner", item, "name", planner.name);
    recorder.add("planner", item, "checker", planner.checker);
    recorder.add("planner", item++, "settings", planner.settings);
  }
  item = 0;
  for (const ProblemName& name : record.names) {
    recorder.add("problem", item, "family", name.family);
    recorder.add("problem", item++, "index", name.index);
  }
}

void record_set_solve(const SetSolve& solve, const std::string& planner, std::size_t problems,
                      Recorder& recorder) {
  const std::string series = series_of(planner);
  const std::int64_t item = solve.seed * static_cast<std::int64_t>(problems) + solve.problem;
  const auto add = [&](std::string_view key, const auto& value) {
    recorder.add(series, item, key, value);
  };
  // What the answers below say in full, for whoever reads the file.
  add("family", solve.family);
  add("index", solve.index);
  add("seed", solve.seed);
  add("solved", solve.is_solved());
  add("smooth", solve.is_smooth());
  add("first_ms", solve.first_ms());
  add("time_ms", solve.time_ms());
  add("spent_ms", solve.spent_ms);
  add("path_length", solve.path_length());
  add("duration_s", solve.duration_s);
  add("acceleration_ratio", solve.acceleration_ratio);
  add("clearance_m", solve.clearance_m);
  add("refusal", solve.refusal);
  add("reason", solve.reason);
  add("guess", solve.guess);
  if (solve.is_found()) recorder.add(series, item, kAnswers, answers_array(solve.answers));
}

void record_planners(const PlannerBenchmarkRecord& record, Recorder& recorder) {
  record_planner_head(record, recorder);
  for (const PlannerRecord& planner : record.planners) {
    for (const SetSolve& solve : planner.solves) {
      record_set_solve(solve, planner.name, record.names.size(), recorder);
    }
  }
}

Result<PlannerBenchmarkRecord> read_planner_record(const std::filesystem::path& path) {
  auto reader = ResultsReader::open(path);
  if (!reader) return error_of(reader);
  const std::string file = path.string();
  PlannerBenchmarkRecord record;
  if (auto read = read_run_head(**reader, kHead, file, record); !read) return error_of(read);
  ItemReader head(**reader, kHead, 0, file);
  record.problems = head.text("problems");
  record.robot = head.text("robot");
  record.deadline_s = head.number("deadline_s");
  record.seeds = head.integer("seeds");
  const int planners = head.integer("planners"), size = head.integer("size");
  std::optional<Error> error = head.error();
  for (int i = 0; i < size && !error; ++i) {
    ItemReader item(**reader, "problem", i, file);
    record.names.push_back({item.text("family"), item.integer("index")});
    error = item.error();
  }
  SolveReader solves(**reader, file, error);
  for (int p = 0; p < planners && !error; ++p) {
    ItemReader item(**reader, "planner", p, file);
    PlannerRecord planner{item.text("name"), item.text("checker"), item.text("settings"), {}};
    error = item.error();
    if (!error) planner.solves = solves.read(planner.name, record.names);
    record.planners.push_back(std::move(planner));
  }
  if (error) return tl::make_unexpected(std::move(*error));
  return record;
}

void absorb_planners(PlannerBenchmarkRecord& whole, PlannerBenchmarkRecord part) {
  for (std::size_t p = 0; p < whole.planners.size(); ++p) {
    std::vector<SetSolve>& solves = whole.planners[p].solves;
    std::ranges::move(part.planners[p].solves, std::back_inserter(solves));
    std::ranges::sort(solves, [](const SetSolve& a, const SetSolve& b) {
      return std::tie(a.seed, a.problem) < std::tie(b.seed, b.problem);
    });
  }
}

}  // namespace sidestep
