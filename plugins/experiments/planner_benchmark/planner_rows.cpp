#include "planner_rows.hpp"

#include <algorithm>
#include <array>
#include <cmath>

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
  std::int64_t item = 0;
  for (ProblemName& name : record.names) {
    name = SIDESTEP_TRY(stored_name().read(*reader, "problem", item++, file));
  }
  item = 0;
  for (PlannerRecord& planner : record.planners) {
    planner = SIDESTEP_TRY(stored_planner().read(*reader, "planner", item++, file));
    auto solves = SIDESTEP_TRY(stored_solve().read_all(*reader, series_of(planner.name), file));
    for (auto& [number, solve] : solves) {
      solve.problem = number % std::ssize(record.names);
      solve.seed = static_cast<int>(number / std::ssize(record.names));
      static_cast<ProblemName&>(solve) = record.names[static_cast<std::size_t>(solve.problem)];
      planner.solves.push_back(std::move(solve));
    }
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

double path_length(const Trajectory& trajectory) {
  double length = 0.0;
  for (int i = 1; i < trajectory.size(); ++i) {
    double squares = 0.0;
    for (std::size_t j = 0; j < trajectory.q(i).size(); ++j) {
      const double step = trajectory.q(i)[j] - trajectory.q(i - 1)[j];
      squares += step * step;
    }
    length += std::sqrt(squares);
  }
  return length;
}

double acceleration_ratio(const Trajectory& trajectory) {
  constexpr int kSteps = 1000;
  const double length = path_length(trajectory);
  if (!(length > 0.0)) return 0.0;
  const auto dof = static_cast<std::size_t>(trajectory.dof);
  const double duration_s = trajectory.duration_s();
  const double step_s = duration_s / kSteps;
  std::vector<double> q(dof), before(dof), now(dof);
  trajectory.sample(0.0, q, before);
  double integral = 0.0;
  for (int step = 1; step <= kSteps; ++step) {
    trajectory.sample(step_s * step, q, now);
    for (std::size_t j = 0; j < dof; ++j) {
      integral += (now[j] - before[j]) * (now[j] - before[j]) / step_s;
    }
    before.swap(now);
  }
  return integral * duration_s * duration_s * duration_s / (12.0 * length * length);
}

}  // namespace sidestep
