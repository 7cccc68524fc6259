#pragma once

#include <cstdint>
#include <filesystem>
#include <map>
#include <memory>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include <sidestep/planning/optimiser.hpp>
#include <sidestep/plugin/parameters.hpp>
#include <sidestep/problems/recorded_problems.hpp>
#include <sidestep/report/result_columns.hpp>
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
  bool solved = false;  ///< There is a trajectory.
  SolveStatus status = SolveStatus::kFailed;
  std::string reason;  ///< Why it is not solved, or not better.
  int iterations = 0;
  int accepted_iterations = 0;
  double initial_cost = 0.0;
  double cost = 0.0;
  double solve_ms = 0.0;           ///< The least of all repeats.
  double exact_clearance_m = 0.0;  ///< Where solved.

  [[nodiscard]] bool is_free() const noexcept { return solved && exact_clearance_m > 0.0; }
};

struct TimedSolve {
  Result<Solution> solution;
  double elapsed_ms = 0.0;
};
[[nodiscard]] TimedSolve solve_timed(PluginPtr<Optimiser>& optimiser, const Problem& problem,
                                     const Trajectory& initial, const ExperimentContext& context);

/// Takes down the first solve of a problem whole, of those that repeat it the time.
void note(const TimedSolve& timed, bool is_first, RecordedSolve& record);

/// Adds all of a solve to the store.
void record_solve(const RecordedSolve& solve, std::string_view series, std::int64_t item,
                  Recorder& recorder);

/// What an experiment on recorded problems begins with.
struct RecordedStart {
  RecordedProblems problems;
  std::string optimiser;        ///< Name of the plugin.
  bool has_body_prior = false;  ///< Its prior of a planar base is on the body's velocities.
  RunProvenance provenance;
  std::unique_ptr<ResultsStore> store;
};

/// Reads the problems, and opens a new store.
[[nodiscard]] Result<RecordedStart> start_recorded(const ExperimentContext& context,
                                                   const ProblemChoice& choice);

/// Whether a problem's start and goal touch nothing in a scene.
[[nodiscard]] bool are_ends_free(const RecordedProblems& problems, int scene,
                                 const Problem& problem);

/// How many problems there are, how many of them came to nothing, and why the first did.
struct SolveCount {
  bool interrupted = false;  ///< There would have been more.
  std::size_t problems = 0, unsolved = 0;
  std::string first_reason = {};

  void add(bool solved, const std::string& reason) {
    ++problems;
    if (!solved && unsolved++ == 0) first_reason = reason;
  }
  /// What a verdict says of a run that is no success; empty where it is one. `what`: the problems
  /// and their optimiser, named.
  [[nodiscard]] std::string failure(const std::string& what,
                                    const char* came_to = "came to nothing") const;
};

/// Outcome and summary.json of a run; `particulars` end with its rows, of which `columns` are.
[[nodiscard]] ExperimentOutcome summarise_solves(const RecordedStart& start,
                                                 const std::string& experiment,
                                                 const SolveCount& count, std::string verdict,
                                                 const report::ResultColumns& columns,
                                                 const nlohmann::ordered_json& particulars);

/// HTML: which optimiser solved which problems of which robot, without an end.
[[nodiscard]] std::string sentence_of(const nlohmann::ordered_json& summary);

/// Tells of every so many of the solves of an experiment, which solves every problem `times` times.
class SolveProgress {
 public:
  SolveProgress(const ExperimentContext& context, const RecordedProblems& problems,
                std::int64_t times)
      : context_(context) {
    for (const RecordedRun& run : problems.runs) total_ += times * std::ssize(run.outcomes);
    if (context.progress) context.progress(0, total_, "building fields");
  }
  void advance(const std::string& what) {
    ++done_;
    if (!context_.progress || (done_ % kEvery != 0 && done_ != total_)) return;
    context_.progress(done_, total_, what);
  }

 private:
  static constexpr std::int64_t kEvery = 25;
  const ExperimentContext& context_;
  std::int64_t total_ = 0;
  std::int64_t done_ = 0;
};

/// Appends to `parts` what `solve` returns, and saves what `record` adds of it to the store.
template <class Part, class Solve>
[[nodiscard]] Result<void> solve_part(std::vector<Part>& parts, Solve solve,
                                      void (*record)(const Part&, std::int64_t, Recorder&),
                                      Recorder& recorder) {
  auto part = SIDESTEP_TRY(catch_all("solving recorded problems", std::move(solve)));
  record(part, std::ssize(parts), recorder);
  parts.push_back(std::move(part));
  return recorder.commit();
}

}  // namespace sidestep
