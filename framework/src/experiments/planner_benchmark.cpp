#include "planner_benchmark.hpp"

#include <algorithm>
#include <cmath>
#include <set>

#include <sidestep/core/seed.hpp>
#include <sidestep/experiments/planning_settings.hpp>
#include <sidestep/field/scene_field.hpp>
#include <sidestep/planning/goal.hpp>
#include <sidestep/runtime/results_store.hpp>
#include <sidestep/runtime/shape_check.hpp>

#include "blocks.hpp"
#include "plan_recording.hpp"
#include "planner_summary.hpp"
#include "planning_race.hpp"
#include "problem_set.hpp"
#include "run_provenance.hpp"

namespace sidestep {
namespace {

/// An item of `experiment.planners`.
struct PlannerEntry {
  std::string name;
  std::string checker = "primitives";
  std::vector<std::string> seeds = {"straight"};
  Node optimiser;
  Node sampler;

  static Parameters<PlannerEntry> parameters() {
    using E = PlannerEntry;
    return Parameters<E>()
        .add("name", &E::name, "Name of the planner in results.", {.required = true})
        .add("checker", &E::checker,
             "What its own checks and costs see: `primitives`, the shapes themselves.",
             {.choices = {"primitives"}})
        .add("seeds", &E::seeds,
             "First guesses, raced over the cores: `straight`, a line (and, beside others, lines "
             "that are perturbed); `sampled`, the sampler's path, which the optimiser polishes if "
             "there is one.")
        .add("optimiser", &E::optimiser, "The block of the optimiser.")
        .add("sampler", &E::sampler, "The block of the sampling planner, for the seed `sampled`.");
  }
};

struct PlannerBenchmarkSettings {
  std::string type;
  std::int64_t seed = 0;
  int threads = 0;
  std::filesystem::path problems;
  std::vector<std::string> families;
  int every = 1;
  std::int64_t limit = 0;
  double deadline_s = 5.0;
  double reach_m = 2.0;
  std::vector<PlannerEntry> planners;

  static Parameters<PlannerBenchmarkSettings> parameters() {
    using S = PlannerBenchmarkSettings;
    return Parameters<S>()
        .add("type", &S::type, "Type of the experiment.", {.required = true})
        .add("seed", &S::seed, "Seed of everything random in the run.", {.min = 0})
        .add("threads", &S::threads, "Threads to work with; 0 for one per core.",
             {.min = 0, .max = 1024})
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

void check_planner(const Node& entry, Host& host, std::vector<Error>& errors) {
  const Node* seeds = entry.find("seeds");
  for (const char* name : {"optimiser", "sampler"}) {
    const Node* block = entry.find(name);
    if (block != nullptr && !block->is_null()) host.check(PluginKind::kOptimiser, *block, errors);
  }
  const auto is_given = [&](const char* name) {
    const Node* block = entry.find(name);
    return block != nullptr && block->is_map();
  };
  if (seeds == nullptr && !is_given("optimiser")) {
    errors.push_back(entry.error("the seed 'straight' needs a block `optimiser`"));
  }
  if (seeds == nullptr || !seeds->is_list()) return;
  if (seeds->items().empty()) errors.push_back(seeds->error("there is no seed to begin with"));
  for (const Node& seed : seeds->items()) {
    const bool is_sampled = seed.text() == "sampled";
    if (!is_sampled && seed.text() != "straight") {
      errors.push_back(
          seed.error("no seed is called '" + seed.text() + "'", "there are straight and sampled"));
    } else if (!is_given(is_sampled ? "sampler" : "optimiser")) {
      errors.push_back(seed.error("the seed '" + seed.text() + "' needs a block " +
                                  (is_sampled ? "`sampler`" : "`optimiser`")));
    }
  }
}

void check_planner_benchmark(const Configuration& configuration, Host& host,
                             std::vector<Error>& errors) {
  const Node* planners = block_of(configuration, "experiment").find("planners");
  if (planners == nullptr || !planners->is_list()) return;
  std::set<std::string> names;
  for (const Node& entry : planners->items()) {
    if (!entry.is_map()) continue;
    check_planner(entry, host, errors);
    const Node* name = entry.find("name");
    if (name != nullptr && !names.insert(name->text()).second) {
      errors.push_back(
          name->error("a planner before this one is named '" + name->text() + "', too"));
    }
  }
  if (planners->items().empty()) errors.push_back(planners->error("there is no planner"));
}

void fill_planners(Node& experiment, Host& host) {
  Node* planners = experiment.find("planners");
  if (planners == nullptr || !planners->is_list()) return;
  for (Node& entry : planners->items()) {
    if (!entry.is_map()) continue;
    entry = fill_defaults(entry, PlannerEntry::parameters().schema());
    for (const char* name : {"optimiser", "sampler"}) {
      if (Node* block = entry.find(name); block != nullptr && block->is_map()) {
        *block = host.with_defaults(PluginKind::kOptimiser, *block);
      }
    }
  }
}

/// Every problem that the settings leave.
std::vector<SetProblem> chosen(std::vector<SetProblem> all,
                               const PlannerBenchmarkSettings& settings) {
  std::vector<SetProblem> kept;
  std::string family;
  std::int64_t seen = 0, taken = 0;
  for (SetProblem& problem : all) {
    if (problem.family != family) {
      family = problem.family;
      seen = taken = 0;
    }
    const bool is_wanted = settings.families.empty() ||
                           std::ranges::find(settings.families, family) != settings.families.end();
    if (!is_wanted || seen++ % settings.every != 0) continue;
    if (settings.limit > 0 && taken >= settings.limit) continue;
    ++taken;
    kept.push_back(std::move(problem));
  }
  return kept;
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

/// What solving borrows.
struct Bench {
  std::shared_ptr<const RobotModel> robot;
  const PlannerBenchmarkSettings& settings;
  PlanningSettings planning;
  CheckSettings check;
  ExperimentContext& context;
};

Result<PlanningRace> make_race(const PlannerEntry& entry, const Bench& bench) {
  std::vector<PlanningRace::Lane> lanes;
  for (const std::string& seed : entry.seeds) {
    PlanningRace::Lane lane;
    lane.seed = seed;
    for (const auto& [block, into] :
         {std::pair(&entry.optimiser, &lane.optimiser), std::pair(&entry.sampler, &lane.sampler)}) {
      const bool is_sampler = into == &lane.sampler;
      if (block->is_null() || (is_sampler && seed != "sampled")) continue;
      auto made = bench.context.host.create<Optimiser>(*block, bench.robot);
      if (!made) return tl::make_unexpected(std::move(made.error()));
      *into = std::move(*made);
    }
    lanes.push_back(std::move(lane));
  }
  return PlanningRace(std::move(lanes), bench.planning.limits(bench.robot->description()));
}

/// Holds an answer against the shapes.
Result<void> judge(const SetProblem& posed, const RaceResult& answer, const Bench& bench,
                   SetSolve& solve) {
  solve.path_length = path_length(answer.trajectory);
  solve.duration_s = answer.trajectory.duration_s();
  const RobotDescription& robot = bench.robot->description();
  const Trajectory& trajectory = answer.trajectory;
  for (const auto& [state, wanted, which] :
       {std::tuple(0, &posed.q_start, "starts"),
        std::tuple(trajectory.size() - 1, &posed.q_goal, "ends")}) {
    const std::string miss = configuration_miss(robot, trajectory.q(state), *wanted);
    if (!miss.empty() && solve.refusal.empty())
      solve.refusal = std::string("it ") + which + " with " + miss;
  }
  ShapeObstacles truth;
  truth.scene = posed.scene;
  auto check = make_shape_check(bench.robot, truth,
                                {.max_step_m = bench.check.shape_max_step_m,
                                 .speed_fraction = bench.check.speed_fraction,
                                 .acceleration_fraction = bench.check.acceleration_fraction});
  if (!check) return tl::make_unexpected(std::move(check.error()));
  const auto verdict = (*check)->check(trajectory, 0.0, Deadline(bench.context.stop));
  if (!verdict) return tl::make_unexpected(verdict.error());
  solve.clearance_m = verdict->min_clearance_m;
  if (!verdict->valid() && solve.refusal.empty()) solve.refusal = verdict->describe();
  return {};
}

Result<SetSolve> solve_one(PlanningRace& race, const SetProblem& posed, const Bench& bench) {
  SetSolve solve;
  solve.family = posed.family;
  solve.index = posed.index;
  const Eigen::Vector3d reach_m = Eigen::Vector3d::Constant(bench.settings.reach_m);
  const auto field = std::make_shared<const SceneField>(*posed.scene, Stamp(),
                                                        Eigen::AlignedBox3d(-reach_m, reach_m));
  const Problem problem =
      make_problem(bench.robot, field, bench.planning, posed.q_start, posed.q_goal);
  if (auto sound = problem.validate(); !sound) {
    solve.reason = "the problem makes no sense: " + sound.error().describe();
    return solve;
  }
  const auto check = make_field_check(bench.robot, field, bench.planning.space(),
                                      {.margin_m = bench.check.margin_m,
                                       .max_step_m = bench.check.max_step_m,
                                       .speed_fraction = bench.check.speed_fraction,
                                       .acceleration_fraction = bench.check.acceleration_fraction,
                                       .first_violation_only = true});
  const std::uint64_t seed =
      derive_seed(bench.context.seed, posed.family + "/" + std::to_string(posed.index));
  auto answer = race.run(problem, *check, seed,
                         Deadline::after_s(bench.settings.deadline_s, bench.context.stop));
  if (!answer) return tl::make_unexpected(std::move(answer.error()));
  solve.is_found = answer->trajectory.size() > 0;
  solve.is_smooth = answer->is_smooth;
  solve.time_ms = answer->took_ms;
  solve.reason = answer->reason;
  solve.seed = answer->seed;
  if (!solve.is_found) return solve;
  if (auto judged = judge(posed, *answer, bench, solve); !judged) {
    return tl::make_unexpected(std::move(judged.error()));
  }
  return solve;
}

/// Series "solve/PLANNER", one item a problem.
void record(const SetSolve& solve, const std::string& series, std::int64_t item,
            Recorder& recorder) {
  recorder.add(series, item, "family", solve.family);
  recorder.add(series, item, "index", solve.index);
  recorder.add(series, item, "solved", solve.is_solved());
  recorder.add(series, item, "smooth", solve.is_smooth);
  recorder.add(series, item, "seed", solve.seed);
  recorder.add(series, item, "reason", solve.refusal.empty() ? solve.reason : solve.refusal);
  if (!solve.is_found) return;
  recorder.add(series, item, "time_ms", solve.time_ms);
  recorder.add(series, item, "path_length", solve.path_length);
  recorder.add(series, item, "duration_s", solve.duration_s);
  recorder.add(series, item, "clearance_m", solve.clearance_m);
}

Result<ExperimentOutcome> run_planner_benchmark(ExperimentContext& context) {
  const Configuration& configuration = context.configuration;
  std::vector<Error> errors;
  PlannerBenchmarkSettings settings;
  PlannerBenchmarkSettings::parameters().read(block_of(configuration, "experiment"), settings,
                                              errors);
  Bench bench{nullptr, settings, {}, {}, context};
  PlanningSettings::parameters().read(block_of(configuration, "planning"), bench.planning, errors);
  CheckSettings::parameters().read(block_of(configuration, "check"), bench.check, errors);
  if (!errors.empty()) return tl::make_unexpected(std::move(errors.front()));
  if (settings.problems.empty()) {
    return fail(ErrorCode::kConfig, "experiment.problems does not say where the problems are", {},
                "give it with --set experiment.problems=FOLDER");
  }
  auto robot = context.host.create<RobotModel>(block_of(configuration, "robot"));
  if (!robot) return tl::make_unexpected(std::move(robot.error()));
  bench.robot = std::move(*robot);
  auto all = read_problem_set(settings.problems, bench.robot->description());
  if (!all) return tl::make_unexpected(std::move(all.error()));
  const std::vector<SetProblem> problems = chosen(std::move(*all), settings);

  const RunProvenance provenance = provenance_of(context);
  auto store = ResultsStore::open(context.out / "results.sqlite", provenance);
  if (!store) return tl::make_unexpected(std::move(store.error()));
  Recorder recorder(**store);

  PlannerBenchmarkRecord outcome{settings.type,
                                 settings.problems.filename().string(),
                                 bench.robot->description().name,
                                 {},
                                 false};
  const auto total = static_cast<std::int64_t>(problems.size() * settings.planners.size());
  std::int64_t done = 0;
  for (const PlannerEntry& entry : settings.planners) {
    auto race = make_race(entry, bench);
    if (!race) return tl::make_unexpected(std::move(race.error()));
    PlannerRecord planner{entry.name, entry.checker, {}};
    if (!problems.empty()) (void)solve_one(*race, problems.front(), bench);  // does not count
    for (const SetProblem& problem : problems) {
      if (context.stop.stop_requested()) break;
      if (context.progress) context.progress(done, total, entry.name);
      auto solve = contained("planning", [&] { return solve_one(*race, problem, bench); });
      if (!solve) return tl::make_unexpected(std::move(solve.error()));
      record(*solve, "solve/" + entry.name, std::ssize(planner.solves), recorder);
      planner.solves.push_back(std::move(*solve));
      ++done;
    }
    outcome.planners.push_back(std::move(planner));
    if (auto saved = recorder.commit(); !saved) return tl::make_unexpected(saved.error());
  }
  outcome.interrupted = context.stop.stop_requested();
  return summarise_planners(provenance, outcome);
}

}  // namespace

ExperimentType planner_benchmark_experiment() {
  return {
      "planner_benchmark",
      "Planners on problem sets: time, success, path quality, each answer checked independently",
      [] { return PlannerBenchmarkSettings::parameters().schema(); },
      {"robot"},
      &check_planner_benchmark,
      &run_planner_benchmark,
      &fill_planners};
}

}  // namespace sidestep
