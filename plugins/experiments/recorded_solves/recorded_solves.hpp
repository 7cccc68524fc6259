#pragma once

#include <cstdint>
#include <memory>
#include <string>
#include <string_view>
#include <vector>

#include <sidestep/planning/optimiser.hpp>
#include <sidestep/problems/recorded_problems.hpp>
#include <sidestep/results/recorder.hpp>
#include <sidestep/results/run_provenance.hpp>
#include <sidestep/runtime/experiment.hpp>
#include <sidestep/runtime/guarded.hpp>
#include "recorded_settings.hpp"

namespace sidestep {

/// What an experiment on recorded problems is about.
struct RecordedFacts {
  std::string problems_file;
  std::string robot;
  std::string optimiser;  ///< Name of the plugin.
};
[[nodiscard]] RecordedFacts facts_of(const RecordedProblems& problems,
                                     const Configuration& configuration);

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
template <class Settings>
struct RecordedStart {
  Settings settings;
  RecordedProblems problems;
  RunProvenance provenance;
  std::unique_ptr<ResultsStore> store;
};

/// Reads settings and problems, and opens a new store.
template <class Settings>
[[nodiscard]] Result<RecordedStart<Settings>> start_recorded(const ExperimentContext& context) {
  const Node& experiment = *context.configuration.root.find("experiment");
  std::vector<Error> errors;
  RecordedStart<Settings> start;
  Settings::parameters().read(experiment, start.settings, errors);
  if (!errors.empty()) return tl::make_unexpected(std::move(errors.front()));
  auto problems = SIDESTEP_TRY(read_problems(experiment, start.settings));
  start.problems = std::move(problems);
  start.provenance = provenance_of(context);
  auto store = SIDESTEP_TRY(ResultsStore::open(context.out / "results.sqlite", start.provenance));
  start.store = std::move(store);
  return start;
}

/// Whether a problem's start and goal touch nothing in a scene.
[[nodiscard]] bool are_ends_free(const RecordedProblems& problems, int scene,
                                 const Problem& problem);

/// Tells of every so many of the solves of an experiment.
class SolveProgress {
 public:
  SolveProgress(const ExperimentContext& context, std::int64_t total);
  void advance(const std::string& what);

 private:
  const ExperimentContext& context_;
  std::int64_t total_;
  std::int64_t done_ = 0;
};

/// Appends to `parts` what `solve` returns, and saves what `record` adds of it to the store.
template <class Part, class Solve>
[[nodiscard]] Result<void> solve_part(std::vector<Part>& parts, Solve solve,
                                      void (*record)(const Part&, std::int64_t, Recorder&),
                                      Recorder& recorder) {
  auto part = SIDESTEP_TRY(contained("solving recorded problems", std::move(solve)));
  record(part, std::ssize(parts), recorder);
  parts.push_back(std::move(part));
  return recorder.commit();
}

}  // namespace sidestep
