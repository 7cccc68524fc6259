#include <algorithm>
#include <cmath>
#include <set>

#include <sidestep/certificates/leave_certificate.hpp>
#include <sidestep/core/seed.hpp>
#include <sidestep/field/scene_field.hpp>
#include <sidestep/planning/goal.hpp>
#include <sidestep/problems/problem_set.hpp>
#include <sidestep/runtime/checked_robot.hpp>
#include <sidestep/runtime/entry_reading.hpp>
#include <sidestep/runtime/motion_planner.hpp>
#include <sidestep/runtime/planning_settings.hpp>
#include <sidestep/runtime/shape_check.hpp>
#include <sidestep/runtime/yaml_document.hpp>
#include "planner_rows.hpp"

namespace sidestep {
namespace {

/// An item of `experiment.planners`.
struct PlannerEntry : PlannerSettings {
  std::string name;
  PlannerExpectation expect;  ///< Read again from PlannerRecord::settings, where it is judged.

  static Parameters<PlannerEntry> parameters() {
    using E = PlannerEntry;
    return declare_planner(Parameters<E>().add("name", &E::name, "Name of the planner in results.",
                                               {.required = true}))
        .add("expect", &E::expect, "What it must reach for the run to be a success.");
  }
};

struct PlannerBenchmarkSettings : ExperimentSettings {
  int seeds = 1;
  std::filesystem::path problems;
  std::vector<std::string> families;
  int every = 1;
  std::int64_t limit = 0;
  double deadline_s = 5.0;
  double reach_m = 2.0;
  std::vector<PlannerEntry> planners;

  static Parameters<PlannerBenchmarkSettings> parameters() {
    using S = PlannerBenchmarkSettings;
    return experiment_parameters<S>(
               "Seed of everything random in the run.",
               "Threads that a planner may use; 0 for one per core. Problems are solved one after "
               "the other, so that nothing else is timed; `--jobs` solves several at once.")
        .add("seeds", &S::seeds,
             "How often each planner is given each problem: with `seed`, the next one, and so on.",
             {.min = 1, .max = 1000})
        .add("problems", &S::problems,
             "Folder of problem sets (docs/reference/problem_sets.md), or one; needed to run.")
        .add("families", &S::families, "Families of problems that are used; none: all.")
        .add("every", &S::every, "Every n-th problem of a family is used.", {.min = 1})
        .add("limit", &S::limit, "Most problems of a family; 0 for no limit.", {.min = 0})
        .add("deadline_s", &S::deadline_s, "Of one problem.",
             {.unit = "s", .min = 1e-3, .max = 3600.0})
        .add("reach_m", &S::reach_m,
             "How far the known world reaches from the robot's foot along each axis.",
             {.unit = "m", .min = 0.1, .max = 100.0})
        .add("planners", &S::planners, "Who solves all of them.", {.required = true});
  }
};

/// What every problem of a set is solved with.
struct SetBench {
  PlannerBenchmarkSettings settings;
  std::shared_ptr<const RobotModel> robot;
  PlanningSettings planning;
  CheckSettings check;
  std::stop_token stop;
  /// For the certificates of answers that are accepted, FAMILY-INDEX.json; empty: none.
  std::filesystem::path certificates = {};
};

/// The independent check: the robot's shapes against the true scene.
Result<std::unique_ptr<ValidityCheck>> true_check(const SetProblem& posed, const SetBench& bench) {
  ShapeObstacles truth;
  truth.scene = posed.scene;
  return make_shape_check(bench.robot, truth, bench.check.of_shapes());
}

/// Where a trajectory does not begin or end as it should; empty where it does.
std::string miss_of(const Trajectory& trajectory, const SetProblem& posed,
                    const RobotDescription& robot) {
  for (std::size_t j = 0; j < trajectory.q(0).size(); ++j) {
    const double off = trajectory.q(0)[j] - posed.q_start[static_cast<Eigen::Index>(j)];
    if (!(std::abs(off) <= kGoalTolerance)) return "it starts where the robot is not";
  }
  const std::string by =
      configuration_miss(robot, trajectory.q(trajectory.size() - 1), posed.q_goal);
  return by.empty() ? "" : "it ends with " + by;
}

/// Holds answers against the true shapes; the last one is what the solve is about.
Result<void> judge(const SetProblem& posed, const RaceResult& answer, const SetBench& bench,
                   SetSolve& solve) {
  const auto check = SIDESTEP_TRY(true_check(posed, bench));
  const auto hear = [&](const Trajectory& trajectory, bool is_smooth,
                        double time_ms) -> Result<void> {
    solve.answers.push_back(
        {static_cast<float>(time_ms), static_cast<float>(path_length(trajectory)), is_smooth});
    solve.duration_s = trajectory.duration_s();
    solve.acceleration_ratio = acceleration_ratio(trajectory);
    const auto verdict = SIDESTEP_TRY(check->check(trajectory, 0.0, Deadline(bench.stop)));
    solve.clearance_m = verdict.min_clearance_m;
    if (!solve.refusal.empty()) return {};
    solve.refusal = miss_of(trajectory, posed, bench.robot->description());
    if (solve.refusal.empty() && !verdict.valid()) solve.refusal = verdict.describe();
    return {};
  };
  for (const EarlierAnswer& earlier : answer.earlier) {
    SIDESTEP_TRY(hear(earlier.trajectory, earlier.is_smooth, earlier.took_ms));
  }
  return hear(answer.trajectory, answer.is_smooth, answer.took_ms);
}

/// Plans for a problem, and holds every answer against the shapes, independently. SetSolve::problem
/// and seed are the caller's. Fails where a planner or a check does. [planning]
Result<SetSolve> solve_set_problem(MotionPlanner& planner, const SetProblem& posed,
                                   std::uint64_t seed, const SetBench& bench) {
  SetSolve solve;
  solve.family = posed.family;
  solve.index = posed.index;
  const Eigen::Vector3d reach_m = Eigen::Vector3d::Constant(bench.settings.reach_m);
  const MotionQuery query{std::make_shared<const SceneField>(
                              *posed.scene, Stamp(), Eigen::AlignedBox3d(-reach_m, reach_m)),
                          posed.q_start,
                          posed.q_goal,
                          {},
                          derive_seed(seed, posed.family + "/" + std::to_string(posed.index))};
  auto answer = SIDESTEP_TRY(
      planner.plan(query, Deadline::after_s(bench.settings.deadline_s, bench.stop), bench.stop));
  solve.spent_ms = answer.spent_ms;
  solve.reason = answer.reason;
  solve.guess = answer.seed;
  if (answer.trajectory.size() == 0) return solve;
  SIDESTEP_TRY(judge(posed, answer, bench, solve));
  if (!bench.certificates.empty() && solve.is_solved()) {
    ShapeObstacles truth;
    truth.scene = posed.scene;
    const std::string name = posed.family + "-" + std::to_string(posed.index) + ".json";
    solve.certified = name_of(SIDESTEP_TRY(
        leave_certificate(*bench.robot, truth, {}, answer.trajectory, bench.certificates / name)));
  }
  return solve;
}

/// A run of a benchmark: the problems of its shard that have no answer yet.
struct BenchmarkRun {
  SetBench bench;
  const std::vector<SetProblem>& problems;
  const PlannerBenchmarkRecord& record;  ///< Of earlier sessions.
  ExperimentContext& context;
  Recorder& recorder;
  SessionClock clock{context.threads};
  std::int64_t session = std::ssize(record.sessions);
  std::int64_t done = record.solved();

  [[nodiscard]] Result<void> solve() {
    for (std::size_t p = 0; p < record.planners.size(); ++p) {
      for (int seed = 0; seed < bench.settings.seeds; ++seed) {
        SIDESTEP_TRY(solve_with(bench.settings.planners[p], record.planners[p], seed));
      }
    }
    record_session(clock.after(0), session, recorder);
    return recorder.commit();
  }

  std::vector<std::int64_t> left_for(const PlannerRecord& earlier, int seed) const {
    std::set<std::int64_t> solved;
    for (const SetSolve& solve : earlier.solves) {
      if (solve.seed == seed) solved.insert(solve.problem);
    }
    std::vector<std::int64_t> left;
    for (std::int64_t problem = 0; problem < std::ssize(problems); ++problem) {
      if (record.is_ours(problem) && !solved.contains(problem)) left.push_back(problem);
    }
    return left;
  }

  Result<void> solve_with(const PlannerEntry& entry, const PlannerRecord& earlier, int seed) {
    const std::vector<std::int64_t> left = left_for(earlier, seed);
    if (left.empty() || context.stop.stop_requested()) return {};
    const std::uint64_t run_seed = context.seed + static_cast<std::uint64_t>(seed);
    auto planner = SIDESTEP_TRY(MotionPlanner::create(context.host, bench.robot, entry,
                                                      bench.planning, bench.check, run_seed));
    if (bench.check.wants_certificate()) {
      bench.certificates = context.out / "certificates" /
                           (entry.name + (seed == 0 ? "" : "-" + std::to_string(seed)));
    }
    const auto solve_one = [&](std::int64_t problem) {
      return catch_all("planning", [&] {
        return solve_set_problem(planner, problems[static_cast<std::size_t>(problem)], run_seed,
                                 bench);
      });
    };
    (void)solve_one(left.front());  // does not count
    for (const std::int64_t problem : left) {
      if (context.progress) context.progress(done, record.planned(), entry.name);
      auto solve = solve_one(problem);
      if (context.stop.stop_requested()) return {};  // it may have been cut short
      if (!solve) return error_of(solve);
      solve->problem = problem;
      solve->seed = seed;
      record_set_solve(*solve, entry.name, problems.size(), recorder);
      record_session(clock.after(1), session, recorder);
      SIDESTEP_TRY(recorder.commit());
      ++done;
    }
    return {};
  }
};

/// The benchmark before anything is solved, or with what an earlier session has left, where this
/// run goes on with it.
Result<PlannerBenchmarkRecord> begun_record(const SetBench& bench,
                                            const std::vector<SetProblem>& problems,
                                            const ExperimentContext& context) {
  const PlannerBenchmarkSettings& settings = bench.settings;
  PlannerBenchmarkRecord record;
  static_cast<DividedRun&>(record) = divided_run_of(context);
  record.problems = settings.problems.filename().string();
  record.robot = bench.robot->description().name;
  record.deadline_s = settings.deadline_s;
  record.seeds = settings.seeds;
  for (const SetProblem& problem : problems)
    record.names.push_back({problem.family, problem.index});
  const Node& root = context.effective;
  const auto& entries = root.find("experiment")->find("planners")->items();
  for (std::size_t p = 0; p < settings.planners.size(); ++p) {
    const PlannerEntry& entry = settings.planners[p];
    record.planners.push_back({entry.name, checker_of(entry), to_yaml(entries[p], false), {}});
  }
  if (!context.resume) return record;
  const auto file = context.out / "results.sqlite";
  auto earlier = SIDESTEP_TRY(read_planner_record(file));
  SIDESTEP_TRY(check_same_run(earlier, record, file.string()));
  if (earlier.names != record.names) {
    return fail(ErrorCode::kConfig, "the problems have changed since the run to resume began",
                file.string(), "begin anew");
  }
  return earlier;
}

Result<SetBench> read_bench(const ExperimentContext& context) {
  const Configuration& configuration = context.configuration;
  SetBench bench{SIDESTEP_TRY(read_block<PlannerBenchmarkSettings>(configuration, "experiment")),
                 nullptr, SIDESTEP_TRY(read_block<PlanningSettings>(configuration, "planning")),
                 SIDESTEP_TRY(read_block<CheckSettings>(configuration, "check")), context.stop};
  if (bench.settings.problems.empty()) {
    return fail(ErrorCode::kConfig, "experiment.problems does not say where the problems are", {},
                "give it with --set experiment.problems=FOLDER");
  }
  bench.robot = SIDESTEP_TRY(context.host.create<RobotModel>(block_of(configuration, "robot")));
  return bench;
}

/// Every problem of the set that the settings leave.
Result<std::vector<SetProblem>> read_chosen(const SetBench& bench,
                                            const ExperimentContext& context) {
  const PlannerBenchmarkSettings& settings = bench.settings;
  auto all = SIDESTEP_TRY(read_problem_set(settings.problems, bench.robot->description()));
  std::vector<SetProblem> problems;
  std::string family;
  std::vector<std::string> families;
  std::int64_t seen = 0, taken = 0, objects = 0;
  for (SetProblem& problem : all) {
    objects += std::ssize(problem.scene->objects());
    if (problem.family != family) {
      family = problem.family;
      families.push_back(family);
      seen = taken = 0;
    }
    const bool is_wanted =
        settings.families.empty() || std::ranges::count(settings.families, family) > 0;
    if (!is_wanted || seen++ % settings.every != 0) continue;
    if (settings.limit > 0 && taken >= settings.limit) continue;
    ++taken;
    problems.push_back(std::move(problem));
  }
  for (const std::string& wanted : settings.families) {
    if (std::ranges::count(families, wanted) > 0) continue;
    return fail(ErrorCode::kConfig, "there is no family '" + wanted + "' in the problem set",
                settings.problems.string(),
                did_you_mean(wanted, families, "there are: " + joined(families)));
  }
  context.log.debug("read " + settings.problems.string() + ": " + std::to_string(all.size()) +
                    " problems of " + std::to_string(families.size()) + " families among " +
                    std::to_string(objects) + " objects; " + std::to_string(problems.size()) +
                    " are taken");
  if (std::ssize(problems) < context.shard.count) {
    return fail(ErrorCode::kConfig,
                problems.empty()
                    ? std::string("there is no problem to solve")
                    : "there are " + std::to_string(problems.size()) + " problems, too few for " +
                          std::to_string(context.shard.count) + " shards",
                settings.problems.string());
  }
  return problems;
}

/// What the store in `run` comes to, and OMPL's benchmark database beside it.
Result<ExperimentOutcome> conclude_planners(const std::filesystem::path& run, bool interrupted,
                                            const std::optional<Error>& fault) {
  const auto record = SIDESTEP_TRY(read_planner_record(run / "results.sqlite"));
  SIDESTEP_TRY(write_ompl_database(record, run / kOmplDatabase));
  return summarise_planners(record, interrupted, fault);
}

class PlannerBenchmark final : public Experiment {
 public:
  // The race times what it finds anew always, guesses by `seeds`, and has `deadline_s`.
  [[nodiscard]] ExperimentFacts facts() const override {
    return {.blocks = {"robot"},
            .optional_blocks = {"planning", "check"},
            .unused_of_planning = {"max_unknown_share", "retime", "time_limit_s", "attempts",
                                   "epsilon_moving_m"},
            .is_divisible = true};
  }
  [[nodiscard]] const report::RunReport& report() const override { return planner_report(); }
  void check(const Configuration& configuration, Host& host,
             std::vector<Error>& errors) const override {
    (void)checked_robot(configuration, host, errors);
    const Node* planners = block_of(configuration, "experiment").find("planners");
    if (planners == nullptr || !planners->is_list()) return;
    std::set<std::string> names;
    for (const Node& entry : planners->items()) {
      if (!entry.is_map()) continue;
      check_planner(entry, errors);
      if (const Node* name = entry.find("name")) take_name(*name, "a planner", names, errors);
    }
    if (planners->items().empty()) errors.push_back(planners->error("there is no planner"));
  }
  [[nodiscard]] Result<ExperimentOutcome> run(ExperimentContext& context) const override {
    auto bench = SIDESTEP_TRY(read_bench(context));
    const auto problems = SIDESTEP_TRY(read_chosen(bench, context));
    const auto record = SIDESTEP_TRY(begun_record(bench, problems, context));
    auto store = SIDESTEP_TRY(open_store(context, record.provenance));
    Recorder recorder(*store);
    if (!context.resume) record_planner_head(record, recorder);
    SIDESTEP_TRY(recorder.commit());

    BenchmarkRun run{std::move(bench), problems, record, context, recorder};
    auto solved = run.solve();
    store.reset();
    if (context.progress) context.progress(0, 0, "summing up");
    return conclude_planners(
        context.out, context.stop.stop_requested(),
        solved ? std::nullopt : std::optional<Error>(std::move(solved.error())));
  }
  [[nodiscard]] Result<ExperimentOutcome> merge(const std::vector<std::filesystem::path>& shards,
                                                const std::filesystem::path& out) const override {
    auto whole = SIDESTEP_TRY(merged_record(shards, &read_planner_record, &absorb_planners));
    for (const std::filesystem::path& run : shards) {
      const auto part = read_planner_record(run / "results.sqlite");
      if (part && part->names == whole.names) continue;
      return fail(ErrorCode::kConfig, "this shard is of other problems than the first",
                  run.string());
    }
    return conclude_whole(whole, out, &record_planners, &conclude_planners);
  }
};

}  // namespace
}  // namespace sidestep

SIDESTEP_EXPERIMENT(
    sidestep::PlannerBenchmark, sidestep::PlannerBenchmarkSettings, "planner_benchmark", "0.1.0",
    "Planners on problem sets: time, success, path quality, each answer checked independently")
