#include "planner_rows.hpp"

#include <algorithm>
#include <array>

#include <sidestep/results/recorder.hpp>

namespace sidestep {
namespace {

constexpr const char* kHead = "benchmark";
constexpr int kAnswerColumns = 3;

std::string series_of(const std::string& planner) { return "solve/" + planner; }

StoredRow<PlannerBenchmarkRecord> stored_benchmark() {
  using Record = PlannerBenchmarkRecord;
  return StoredRow<Record>()
      .add("problems", &Record::problems)
      .add("robot", &Record::robot)
      .add("deadline_s", &Record::deadline_s)
      .add("seeds", &Record::seeds)
      .add(
          "planners", [](const Record& record) { return record.planners.size(); },
          [](Record& record, std::size_t count) { record.planners.resize(count); })
      .add(
          "size", [](const Record& record) { return record.names.size(); },
          [](Record& record, std::size_t count) { record.names.resize(count); });
}

StoredRow<PlannerRecord> stored_planner() {
  return StoredRow<PlannerRecord>()
      .add("name", &PlannerRecord::name)
      .add("checker", &PlannerRecord::checker)
      .add("settings", &PlannerRecord::settings);
}

StoredRow<ProblemName> stored_name() {
  return StoredRow<ProblemName>()
      .add("family", &ProblemName::family)
      .add("index", &ProblemName::index);
}

/// One row an answer.
StoredArray answers_of(const SetSolve& solve) {
  StoredArray array;
  for (const TimedAnswer& answer : solve.answers) {
    const float is_smooth = answer.is_smooth ? 1.0f : 0.0f;
    array.add_row(std::array{answer.time_ms, answer.path_length, is_smooth});
  }
  return array;
}
void set_answers(SetSolve& solve, const StoredArray& array) {
  for (std::size_t i = 0; i + kAnswerColumns <= array.values.size(); i += kAnswerColumns) {
    solve.answers.push_back({array.values[i], array.values[i + 1], array.values[i + 2] != 0.0f});
  }
}

const StoredRow<SetSolve>& stored_solve() {
  using Solve = SetSolve;
  static const auto kSolve = StoredRow<Solve>()
                                 .add_derived("family", &Solve::family)
                                 .add_derived("index", &Solve::index)
                                 .add_derived("seed", &Solve::seed)
                                 .add_derived("solved", &Solve::is_solved)
                                 .add_derived("smooth", &Solve::is_smooth)
                                 .add_derived("first_ms", &Solve::first_ms)
                                 .add_derived("time_ms", &Solve::time_ms)
                                 .add_derived("path_length", &Solve::path_length)
                                 .add("spent_ms", &Solve::spent_ms)
                                 .add("duration_s", &Solve::duration_s)
                                 .add("acceleration_ratio", &Solve::acceleration_ratio)
                                 .add("clearance_m", &Solve::clearance_m)
                                 .add("refusal", &Solve::refusal)
                                 .add("reason", &Solve::reason)
                                 .add("guess", &Solve::guess)
                                 .add("certified", &Solve::certified)
                                 .add("answers", &answers_of, &set_answers);
  return kSolve;
}

/// What a planner has solved, problem by problem.
Result<std::vector<SetSolve>> read_solves(ResultsReader& reader, const std::string& planner,
                                          const std::vector<ProblemName>& names,
                                          const std::string& file) {
  auto rows = SIDESTEP_TRY(stored_solve().read_all(reader, series_of(planner), file));
  std::vector<SetSolve> solves;
  for (auto& [item, solve] : rows) {
    solve.problem = item % std::ssize(names);
    solve.seed = static_cast<int>(item / std::ssize(names));
    static_cast<ProblemName&>(solve) = names[static_cast<std::size_t>(solve.problem)];
    solves.push_back(std::move(solve));
  }
  return solves;
}

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
  stored_benchmark().record(record, kHead, 0, recorder);
  stored_planner().record_all(record.planners, "planner", recorder);
  stored_name().record_all(record.names, "problem", recorder);
}

void record_set_solve(const SetSolve& solve, const std::string& planner, std::size_t problems,
                      Recorder& recorder) {
  const std::int64_t item = solve.seed * static_cast<std::int64_t>(problems) + solve.problem;
  stored_solve().record(solve, series_of(planner), item, recorder);
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
  auto reader = SIDESTEP_TRY(ResultsReader::open(path));
  const std::string file = path.string();
  auto head = SIDESTEP_TRY(read_run_head(*reader, kHead, file));
  auto record = SIDESTEP_TRY(stored_benchmark().read(*reader, kHead, 0, file));
  static_cast<DividedRun&>(record) = std::move(head);
  for (std::size_t i = 0; i < record.names.size(); ++i) {
    record.names[i] =
        SIDESTEP_TRY(stored_name().read(*reader, "problem", static_cast<std::int64_t>(i), file));
  }
  for (std::size_t p = 0; p < record.planners.size(); ++p) {
    auto planner =
        SIDESTEP_TRY(stored_planner().read(*reader, "planner", static_cast<std::int64_t>(p), file));
    planner.solves = SIDESTEP_TRY(read_solves(*reader, planner.name, record.names, file));
    record.planners[p] = std::move(planner);
  }
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
