#pragma once

#include <cstdint>
#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include <sidestep/plugin/parameters.hpp>
#include <sidestep/report/canvas.hpp>
#include <sidestep/results/divided_run.hpp>
#include <sidestep/runtime/experiment.hpp>
#include <sidestep/trajectory/trajectory.hpp>

namespace sidestep {

/// A trajectory that a planner held for valid, while it had time to find a better one. As precise
/// as it is stored.
struct TimedAnswer {
  float time_ms = 0.0f;      ///< From the posed problem on.
  float path_length = 0.0f;  ///< In the space of joints, rad and m alike.
  bool is_smooth = false;    ///< From an optimiser; a sampled path stops at its corners.
};

/// Which problem it is, for people.
struct ProblemName {
  std::string family;
  int index = 0;  ///< Within the family, as the set counts.

  bool operator==(const ProblemName&) const = default;
};

/// What a planner made of one problem with one seed.
struct SetSolve : ProblemName {
  std::int64_t problem = 0;          ///< Place in the list of problems.
  int seed = 0;                      ///< 0 for the run's own, 1 for the next, ...
  std::vector<TimedAnswer> answers;  ///< In order; the last one is what the rest is about.
  double spent_ms = 0.0;             ///< Until the planner ended, with an answer or without.
  double duration_s = 0.0;
  double acceleration_ratio = 0.0;  ///< See acceleration_ratio().
  double clearance_m = 0.0;         ///< By the independent check.
  std::string refusal;              ///< Why the independent check refuses an answer, if it does.
  std::string reason;               ///< Why there is none.
  std::string guess;                ///< The first guess that led there.
  std::string certified;            ///< By leave_certificate(), where that was asked for.

  [[nodiscard]] bool is_found() const noexcept { return !answers.empty(); }
  [[nodiscard]] bool is_solved() const noexcept { return is_found() && refusal.empty(); }
  [[nodiscard]] bool is_smooth() const noexcept { return is_found() && answers.back().is_smooth; }
  [[nodiscard]] double path_length() const noexcept {
    return is_found() ? answers.back().path_length : 0.0;
  }
  /// Until the first answer; 0 where there is none.
  [[nodiscard]] double first_ms() const noexcept;
  /// Until the first answer as smooth as the last one; what came after is polish.
  [[nodiscard]] double time_ms() const noexcept;
};

/// `expect` of a planner: what it must reach for the run to be a success. A planner that solves
/// nothing never does.
struct PlannerExpectation {
  std::optional<double> solved_share_1s;
  std::optional<double> solved_share_5s;
  std::optional<double> first_p50_ms;
  std::optional<double> first_p95_ms;

  static Parameters<PlannerExpectation> parameters();
};

struct PlannerRecord {
  std::string name;
  std::string checker;
  std::string settings;          ///< Its entry in the effective configuration, as YAML.
  std::vector<SetSolve> solves;  ///< By seed, then problem.
};

/// What a results store holds of a planner benchmark: everything that its summary is made from.
struct PlannerBenchmarkRecord : DividedRun {
  std::string problems;  ///< Name of the set.
  std::string robot;
  double deadline_s = 0.0;
  int seeds = 1;
  std::vector<ProblemName> names;  ///< Of all problems, other shards' too.
  std::vector<PlannerRecord> planners;

  /// Whether a problem, by its place in the list, is this shard's.
  [[nodiscard]] bool is_ours(std::int64_t problem) const noexcept {
    return problem % shard.count == shard.index;
  }
  /// Answers that the store should come to hold, and holds.
  [[nodiscard]] std::int64_t planned() const;
  [[nodiscard]] std::int64_t solved() const;
};

/// Everything but what is solved: series "benchmark", "planner", "problem".
void record_planner_head(const PlannerBenchmarkRecord& record, Recorder& recorder);
/// Series "solve/PLANNER", item = seed * problems + problem.
void record_set_solve(const SetSolve& solve, const std::string& planner, std::size_t problems,
                      Recorder& recorder);
/// Both, of everything.
void record_planners(const PlannerBenchmarkRecord& record, Recorder& recorder);

/// Reads back what was recorded. Fails with kIo where the store is of no planner benchmark.
[[nodiscard]] Result<PlannerBenchmarkRecord> read_planner_record(const std::filesystem::path& file);

/// Moves what a further shard has solved into the whole.
void absorb_planners(PlannerBenchmarkRecord& whole, PlannerBenchmarkRecord part);

/// Length of a trajectory's support states joined by straight lines, in the space of joints, rad
/// and m alike. [any]
[[nodiscard]] double path_length(const Trajectory& trajectory);

/// How far a trajectory is from the smoothest one of its length L and duration T: the integral of
/// its squared acceleration over all joints as a multiple of 12 L^2 / T^3, which a straight motion
/// from rest to rest needs at least. 1 at best where it begins and ends at rest, about 4/3 at
/// constant acceleration there and back, 4 with a stop half way; without unit. Accelerations are
/// means over a thousandth of T, so that what lasts shorter (a velocity that jumps by a rounding
/// error) counts by the change of velocity that it brings. 0 where nothing moves. [any]
[[nodiscard]] double acceleration_ratio(const Trajectory& trajectory);

/// Verdict, summary.json and tables of what a store holds.
[[nodiscard]] ExperimentOutcome summarise_planners(const PlannerBenchmarkRecord& record,
                                                   bool interrupted,
                                                   const std::optional<Error>& fault);

/// How such runs are shown.
[[nodiscard]] const report::RunReport& planner_report();

/// The pictures of a planner benchmark: success against time, and times family by family.
[[nodiscard]] std::vector<Figure> planner_figures(const PlannerBenchmarkRecord& record);

/// Name of the file in a run's folder.
inline constexpr const char* kOmplDatabase = "ompl_benchmark.db";

/// Writes a benchmark the way OMPL's own benchmarks are stored (OMPL 1.5, SQLite), for
/// ompl_benchmark_statistics and Planner Arena; replaces the file. A family is an experiment, an
/// answer to one of its problems with one seed is a run: solved where the independent check accepts
/// it. `progress` has the length of the path that was best so far at 50 times up to the deadline.
/// Fails with kIo.
[[nodiscard]] Result<void> write_ompl_database(const PlannerBenchmarkRecord& record,
                                               const std::filesystem::path& file);

}  // namespace sidestep
