#pragma once

#include <algorithm>
#include <cstdint>
#include <filesystem>
#include <map>
#include <memory>
#include <optional>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include <sidestep/core/index.hpp>
#include <sidestep/planning/optimiser.hpp>
#include <sidestep/plugin/parameters.hpp>
#include <sidestep/problems/recorded_problems.hpp>
#include <sidestep/report/result_columns.hpp>
#include <sidestep/results/divided_run.hpp>
#include <sidestep/results/recorder.hpp>
#include <sidestep/results/summary.hpp>
#include <sidestep/runtime/call_plugin.hpp>
#include <sidestep/runtime/entry_reading.hpp>
#include <sidestep/runtime/experiment.hpp>

namespace sidestep {

/// Of an `experiment` block: which recorded problems are solved, and how often.
struct ProblemChoice {
  std::filesystem::path problems;
  std::vector<std::string> runs;
  int repeats = 1;
  int every = 1;
  std::int64_t limit = 0;
};

/// Settings that derive from ProblemChoice declare it so.
template <class Settings>
Parameters<Settings> declare_choice(Parameters<Settings> parameters) {
  return std::move(parameters)
      .add("problems", &Settings::problems, "File of recorded problems (JSON); needed to run.")
      .add("runs", &Settings::runs, "Labels of the recorded runs whose stopping rules are used.")
      .add("repeats", &Settings::repeats,
           "How often all problems of a run are solved; the least time of each counts.",
           {.min = 1, .max = 1000})
      .add("every", &Settings::every, "Every n-th problem of a run is used.", {.min = 1})
      .add("limit", &Settings::limit, "Most problems of a run; 0 for no limit.", {.min = 0});
}

/// What the experiment sets of every optimiser: the stopping rules of each recorded run.
inline const std::vector<std::string> kSetOfOptimiser = {"relative_tolerance", "max_iterations"};

/// The optimiser's block with a recorded run's stopping rules in it.
[[nodiscard]] Node block_for(const Node& optimiser, const RecordedRun& run);

/// Appends a mistake for each parameter that the experiment sets (`names`) and the block
/// `optimiser` has, too, and for each that the plugin does not have.
void check_optimiser(const Configuration& configuration, const std::vector<std::string>& names,
                     Host& host, std::vector<Error>& errors);

/// The recorded problems that an `experiment` block names, and of their runs those to be solved,
/// each with the outcomes that `every` and `limit` leave. Appends every mistake at its position.
[[nodiscard]] RecordedProblems read_chosen_problems(const Node& experiment,
                                                    const ProblemChoice& choice,
                                                    std::vector<Error>& errors);

/// Appends every mistake in the configuration of an experiment on recorded problems that sets
/// parameters (`names`) of the optimiser.
template <class Settings>
void check_recorded(const Configuration& configuration, const std::vector<std::string>& names,
                    Host& host, std::vector<Error>& errors) {
  check_optimiser(configuration, names, host, errors);
  const Node& experiment = block_of(configuration, "experiment");
  Settings settings;
  if (!read_entry(experiment, settings, errors) || settings.problems.empty()) return;
  (void)read_chosen_problems(experiment, settings, errors);
}

/// The fields of a file of recorded problems, each made when it is first asked for. The problems
/// must outlive them.
class RecordedFields {
 public:
  explicit RecordedFields(const RecordedProblems& problems) : problems_(problems) {}

  const std::shared_ptr<const DistanceField>& of(int scene, bool is_signed) {
    auto& field = fields_[{scene, is_signed}];
    if (field == nullptr) field = recorded_field(problems_, scene, is_signed);
    return field;
  }

 private:
  const RecordedProblems& problems_;
  std::map<std::pair<int, bool>, std::shared_ptr<const DistanceField>> fields_;
};

/// What an optimiser made of a recorded problem.
struct RecordedSolve {
  std::int64_t problem = 0;  ///< Its place among the outcomes of the recorded run.
  int scene = 0;
  int pair = 0;
  bool ends_free = false;  ///< Start and goal touch nothing.
  int repeats = 0;         ///< How often it was solved.
  bool solved = false;     ///< There is a trajectory.
  std::string status{to_string(SolveStatus::kFailed)};
  std::string reason;  ///< Why it is not solved, or not better.
  int iterations = 0;
  int accepted_iterations = 0;
  double initial_cost = 0.0;
  double cost = 0.0;
  double solve_ms = 0.0;           ///< The least of all repeats.
  double exact_clearance_m = 0.0;  ///< Where solved.

  [[nodiscard]] bool is_free() const noexcept { return solved && exact_clearance_m > 0.0; }
};

/// How a solve, or what derives from it, is stored: one item a problem.
template <class Solve>
[[nodiscard]] StoredRow<Solve> stored_solve() {
  return StoredRow<Solve>()
      .add("scene", &Solve::scene)
      .add("pair", &Solve::pair)
      .add("ends_free", &Solve::ends_free)
      .add("repeats", &Solve::repeats)
      .add("solved", &Solve::solved)
      .add("status", &Solve::status)
      .add("reason", &Solve::reason)
      .add("solve_ms", &Solve::solve_ms)
      .add("iterations", &Solve::iterations)
      .add("accepted_iterations", &Solve::accepted_iterations)
      .add("initial_cost", &Solve::initial_cost)
      .add("cost", &Solve::cost)
      .add("exact_clearance_m", &Solve::exact_clearance_m);
}

/// The solves of a series of the store, by problem.
template <class Solve>
[[nodiscard]] Result<std::vector<Solve>> read_solves(const StoredRow<Solve>& stored,
                                                     ResultsReader& reader,
                                                     const std::string& series,
                                                     const std::string& file) {
  auto rows = SIDESTEP_TRY(stored.read_all(reader, series, file));
  std::vector<Solve> solves;
  for (auto& [problem, solve] : rows) {
    solve.problem = problem;
    solves.push_back(std::move(solve));
  }
  return solves;
}

struct TimedSolve {
  Result<Solution> solution;
  double elapsed_ms = 0.0;
};

/// Solves once, by a plugin; ends on request. [planning]
[[nodiscard]] TimedSolve solve_timed(PluginPtr<Optimiser>& optimiser, const Problem& problem,
                                     const Trajectory& initial, const ExperimentContext& context);

/// Counts a solve. Its time counts if it is the least, everything else if it is the first.
void note(const TimedSolve& timed, RecordedSolve& record);

/// All problems of a recorded run, solved under its rules.
struct RecordedSeries {
  std::string label;
  bool is_signed = false;
  double relative_tolerance = 0.0;
  int max_iterations = 0;
  std::string change;         ///< Of every problem before it is solved; empty for none.
  std::int64_t problems = 0;  ///< Of all shards.

  /// For people.
  [[nodiscard]] std::string name() const {
    return label + (is_signed ? ", signed" : ", unsigned") +
           (change.empty() ? "" : ", other " + change);
  }
};

/// What a results store holds of a run on recorded problems, beside what is solved.
struct RecordedHead : DividedRun {
  std::string problems_file;
  std::string robot;
  std::string optimiser;  ///< Name of the plugin.
  int repeats = 1;
  std::string about = "{}";  ///< What else its summary says of all of it, as JSON.
  std::vector<RecordedSeries> series;
};

/// Series "benchmark" (one item) and "series" (one item a series).
void record_recorded_head(const RecordedHead& head, Recorder& recorder);
/// Reads both back. Fails with kIo where the store is of no run on recorded problems.
[[nodiscard]] Result<RecordedHead> read_recorded_head(ResultsReader& reader,
                                                      const std::string& file);

/// Puts the stores of shards together in the folder `out`.
[[nodiscard]] Result<void> merge_recorded(const std::vector<std::filesystem::path>& shards,
                                          const std::filesystem::path& out);

/// What an experiment on recorded problems begins with.
struct RecordedStart {
  RecordedProblems problems;
  RecordedHead head;
};

/// Reads the problems. Each run makes a series for each of `changes`, in this order.
[[nodiscard]] Result<RecordedStart> start_recorded(const ExperimentContext& context,
                                                   const ProblemChoice& choice,
                                                   const std::vector<std::string>& changes);

/// All that a results store holds of a run on recorded problems. A Solve is or has RecordedSolves,
/// of which `first()` is one, is made of a problem's place and outcome, and has `record(series,
/// recorder)`, `read(reader, series, file)` of all of a series, and `unsolved_reason()`: why it
/// came to nothing, or nothing.
template <class Solve>
struct RecordedRecord : RecordedHead {
  std::vector<std::vector<Solve>> solves;  ///< By series, then problem.
};

template <class Solve>
[[nodiscard]] Result<RecordedRecord<Solve>> read_recorded(const std::filesystem::path& file) {
  auto reader = SIDESTEP_TRY(ResultsReader::open(file));
  RecordedRecord<Solve> record{SIDESTEP_TRY(read_recorded_head(*reader, file.string())), {}};
  for (std::size_t s = 0; s < record.series.size(); ++s) {
    record.solves.push_back(SIDESTEP_TRY(Solve::read(*reader, s, file.string())));
  }
  return record;
}

/// Whether a problem's start and goal touch nothing in a scene.
[[nodiscard]] bool are_ends_free(const RecordedProblems& problems, int scene,
                                 const Problem& problem);

/// How a run ended, and how many problems came to nothing.
struct SolveCount {
  bool interrupted = false;
  std::optional<Error> fault = {};
  std::int64_t planned = 0;   ///< By the shard.
  std::int64_t finished = 0;  ///< Solved as often as they should be.
  std::int64_t problems = 0, unsolved = 0;
  std::string first_reason = {};  ///< Why the first one came to nothing.

  [[nodiscard]] bool complete() const noexcept { return finished == planned; }
  [[nodiscard]] bool success() const noexcept {
    return complete() && !fault && problems > 0 && unsolved == 0;
  }
  /// What a verdict says of a run that is no success; empty where it is one. `what`: the problems
  /// and their optimiser, named.
  [[nodiscard]] std::string failure(const std::string& what,
                                    const char* came_to = "came to nothing") const;
};

/// How many problems of each series belong to a shard.
[[nodiscard]] inline std::int64_t share_of_shard(std::int64_t problems, const Shard& shard) {
  return (problems + shard.count - 1 - shard.index) / shard.count;
}

template <class Solve>
[[nodiscard]] SolveCount count_solves(const RecordedRecord<Solve>& record, bool stopped,
                                      const std::optional<Error>& fault) {
  SolveCount count{.fault = fault};
  for (std::size_t s = 0; s < record.series.size(); ++s) {
    count.planned += share_of_shard(record.series[s].problems, record.shard);
    for (const Solve& solve : record.solves[s]) {
      ++count.problems;
      count.finished += solve.first().repeats == record.repeats ? 1 : 0;
      const auto reason = solve.unsolved_reason();
      if (reason && count.unsolved++ == 0) count.first_reason = *reason;
    }
  }
  count.interrupted = stopped && !count.complete();
  return count;
}

/// Outcome and summary.json of a run; `particulars` end with its rows, of which `columns` are.
[[nodiscard]] ExperimentOutcome summarise_solves(const RecordedHead& head,
                                                 const std::string& experiment,
                                                 const SolveCount& count,
                                                 const std::string& verdict,
                                                 const report::ResultColumns& columns,
                                                 const nlohmann::ordered_json& particulars);

/// HTML: which optimiser solved which problems of which robot, without an end.
[[nodiscard]] std::string sentence_of(const nlohmann::ordered_json& summary);

/// Solves, at most, between two commits: what a run that is killed loses.
inline constexpr std::size_t kSolvesInBatch = 512;

/// The problems of a shard that are not solved as often as they should be.
template <class Solve>
class RecordedWork {
 public:
  RecordedWork(const ExperimentContext& context, const RecordedProblems& problems,
               const RecordedRecord<Solve>& earlier, Recorder& recorder)
      : context_(context), problems_(problems), earlier_(earlier), recorder_(recorder) {
    for (std::size_t s = 0; s < earlier.series.size(); ++s) {
      total_ += earlier.repeats * share_of_shard(earlier.series[s].problems, earlier.shard);
      for (const Solve& solve : earlier.solves[s]) done_ += solve.first().repeats;
    }
    if (context.progress) context.progress(done_, total_, "building fields");
  }

  /// `make(series, run, solves)` makes a solver of the problems that are left of a series. That has
  /// `solve(i, solve)`, which solves one of them once more, and `judge(i, solve)` for after the
  /// first time. Ends on request. Fails where no solver can be made.
  template <class Make>
  [[nodiscard]] Result<void> solve(Make make) {
    const std::size_t changes = earlier_.series.size() / problems_.runs.size();
    for (std::size_t s = 0; s < earlier_.series.size(); ++s) {
      const RecordedRun& run = problems_.runs[s / changes];
      std::vector<Solve> left = left_of(s, run);
      if (left.empty() || context_.stop.stop_requested()) continue;
      auto solver = SIDESTEP_TRY(make(earlier_.series[s], run, left));
      for (int pass = 0; pass < earlier_.repeats && !context_.stop.stop_requested(); ++pass) {
        SIDESTEP_TRY(solve_pass(s, pass, solver, left));
      }
    }
    return save_session(0);
  }

 private:
  [[nodiscard]] std::vector<Solve> left_of(std::size_t series, const RecordedRun& run) const {
    const std::vector<Solve>& known = earlier_.solves[series];
    const auto place = [](const Solve& solve) { return solve.first().problem; };
    std::vector<Solve> left;
    for (std::int64_t problem = earlier_.shard.index; problem < std::ssize(run.outcomes);
         problem += earlier_.shard.count) {
      const auto its = std::ranges::lower_bound(known, problem, {}, place);
      const bool is_known = its != known.end() && place(*its) == problem;
      Solve solve = is_known ? *its : Solve(problem, run.outcomes[idx(problem)]);
      if (solve.first().repeats < earlier_.repeats) left.push_back(std::move(solve));
    }
    return left;
  }

  /// Those that were solved `pass` times, once more: nothing but solves falls between two of them.
  template <class Solver>
  [[nodiscard]] Result<void> solve_pass(std::size_t series, int pass, Solver& solver,
                                        std::vector<Solve>& left) {
    std::vector<std::size_t> batch;
    for (std::size_t i = 0; i < left.size(); ++i) {
      if (left[i].first().repeats != pass) continue;
      Solve solve = left[i];
      solver.solve(i, solve);
      if (context_.stop.stop_requested()) break;  // it may have been cut short
      left[i] = std::move(solve);
      batch.push_back(i);
      advance(series);
      if (batch.size() < kSolvesInBatch) continue;
      SIDESTEP_TRY(save(series, batch, solver, left));
      batch.clear();
    }
    return save(series, batch, solver, left);
  }

  template <class Solver>
  [[nodiscard]] Result<void> save(std::size_t series, const std::vector<std::size_t>& batch,
                                  Solver& solver, std::vector<Solve>& left) {
    std::int64_t problems = 0;
    for (const std::size_t i : batch) {
      if (left[i].first().repeats == 1) {
        solver.judge(i, left[i]);
        ++problems;
      }
      left[i].record(series, recorder_);
    }
    return save_session(problems);
  }
  [[nodiscard]] Result<void> save_session(std::int64_t problems) {
    record_session(clock_.after(problems), std::ssize(earlier_.sessions), recorder_);
    return recorder_.commit();
  }

  void advance(std::size_t series) {
    constexpr std::int64_t kEvery = 25;
    ++done_;
    if (!context_.progress || (done_ % kEvery != 0 && done_ != total_)) return;
    context_.progress(done_, total_, earlier_.series[series].name());
  }

  const ExperimentContext& context_;
  const RecordedProblems& problems_;
  const RecordedRecord<Solve>& earlier_;
  Recorder& recorder_;
  SessionClock clock_{context_.threads};
  std::int64_t total_ = 0;
  std::int64_t done_ = 0;
};

/// Solves what is left of a run, which may have begun earlier, and sums up what its store holds
/// then. `make`: see RecordedWork.
template <class Solve, class Make>
[[nodiscard]] Result<ExperimentOutcome> run_recorded(
    const ExperimentContext& context, const RecordedStart& start, Make make,
    Result<ExperimentOutcome> (*conclude)(const std::filesystem::path&, bool,
                                          const std::optional<Error>&)) {
  const auto file = context.out / "results.sqlite";
  RecordedRecord<Solve> record{start.head, {}};
  record.solves.resize(start.head.series.size());
  if (context.resume) {
    auto earlier = SIDESTEP_TRY(read_recorded<Solve>(file));
    SIDESTEP_TRY(check_same_run(earlier, record, file.string()));
    record = std::move(earlier);
  }
  auto store = SIDESTEP_TRY(open_store(context, record.provenance));
  Recorder recorder(*store);
  if (!context.resume) record_recorded_head(record, recorder);
  SIDESTEP_TRY(recorder.commit());
  RecordedWork<Solve> work(context, start.problems, record, recorder);
  const auto solved = catch_all("solving recorded problems", [&] { return work.solve(make); });
  store.reset();
  return conclude(context.out, context.stop.stop_requested(),
                  solved ? std::nullopt : std::optional<Error>(solved.error()));
}

}  // namespace sidestep
