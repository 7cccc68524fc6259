// MotionBenchMaker's problems for the Panda, solved as a user of OMPL would who writes the state
// check himself: what Sidestep's planners are compared with (docs/studies/planners.md).

#include <CLI/CLI.hpp>
#include <cstdio>

#include <sidestep/core/seed.hpp>
#include <sidestep/problems/problem_set.hpp>
#include <sidestep/results/summary.hpp>
#include <sidestep/runtime/configuration.hpp>
#include <sidestep/runtime/host.hpp>
#include <sidestep/runtime/results_store.hpp>
#include <sidestep/runtime/yaml_document.hpp>
#include "driver_table.hpp"
#include "planners.hpp"

namespace {

using namespace sidestep;
using namespace sidestep::plain_driver;

/// Whose robot, spheres and checks are used.
constexpr const char* kConfiguration = "peers/mbm_panda.yaml";

struct Arguments {
  std::filesystem::path problems;
  int every = 1;
  double limit_s = 5.0;
  std::uint64_t seed = 7;
  bool with_shapes = false;
  bool as_json = false;
};

class ErrorLog final : public Log {
 public:
  void write(LogLevel level, std::string_view message) override {
    if (level < LogLevel::kError) return;
    std::fprintf(stderr, "%.*s\n", static_cast<int>(message.size()), message.data());
  }
};

class NoClock final : public Clock {
 public:
  [[nodiscard]] Stamp now() const noexcept override { return {}; }
};

/// A host of plugins, and what it needs to live.
struct Workshop {
  ErrorLog log;
  NoClock clock;
  WorkerPool workers{1};
  YamlDocumentReader documents;
  InstallLayout layout = install_layout();
  Host host{
      {host_plugin_paths({}, layout), {layout.robots}, {}, 0}, log, clock, workers, documents};
};

/// What the configuration says that a driver of OMPL has to know.
struct Bench {
  std::shared_ptr<const RobotModel> robot;
  PlanningSettings planning;
  CheckSettings check;
};

Result<Bench> load_bench(Workshop& shop) {
  auto reading = read_configuration(shop.layout.configs / kConfiguration, {}, shop.documents);
  Bench bench;
  if (reading.errors.empty()) {
    const Configuration& configuration = reading.configuration;
    PlanningSettings::parameters().read(block_of(configuration, "planning"), bench.planning,
                                        reading.errors);
    CheckSettings::parameters().read(block_of(configuration, "check"), bench.check, reading.errors);
  }
  if (!reading.errors.empty()) return tl::make_unexpected(std::move(reading.errors.front()));
  auto robot = SIDESTEP_TRY(shop.host.create<RobotModel>(block_of(reading.configuration, "robot")));
  bench.robot = std::move(robot);
  return bench;
}

/// Every n-th problem of each family, from its first.
Result<std::vector<SetProblem>> read_problems(const Arguments& arguments,
                                              const RobotDescription& robot) {
  std::error_code ignored;
  if (!std::filesystem::exists(arguments.problems, ignored)) {
    return fail(ErrorCode::kNotFound, "there is no such folder or file",
                arguments.problems.string(),
                "give a folder of problem sets (docs/reference/problem_sets.md), or one");
  }
  auto all = SIDESTEP_TRY(read_problem_set(arguments.problems, robot));
  std::vector<SetProblem> kept;
  std::string family;
  int seen = 0;
  for (SetProblem& problem : all) {
    if (problem.family != family) seen = 0;
    family = problem.family;
    if (seen++ % arguments.every == 0) kept.push_back(std::move(problem));
  }
  if (kept.empty()) {
    return fail(ErrorCode::kConfig, "there is no problem to solve", arguments.problems.string());
  }
  return kept;
}

Result<Solve> solve_one(const SetProblem& problem, const Bench& bench, const PathJudge& judge,
                        const Arguments& arguments, Log& log) {
  const std::string name = problem.family + "/" + std::to_string(problem.index);
  Solve solve{problem.family, problem.index, {}, {}};
  try {
    const ompl_optimiser::Session session(derive_seed(arguments.seed, name), log);
    solve.answer = plan_plainly(bench.robot, *problem.scene, problem.q_start, problem.q_goal,
                                bench.planning.collision_margin_m, arguments.limit_s);
  } catch (const std::exception& error) {
    return fail(ErrorCode::kInternal, std::string("OMPL threw: ") + error.what(), name);
  }
  if (!solve.answer.is_solved) return solve;
  auto verdict = judge.judge(problem.scene, solve.answer.path);
  if (!verdict) {
    return tl::make_unexpected(
        verdict.error().wrapped(verdict.error().code, "the path cannot be judged", name));
  }
  solve.verdict = *verdict;
  return solve;
}

void print(const std::vector<Solve>& solves, const Arguments& arguments) {
  nlohmann::ordered_json summary = summary_of(solves, arguments.with_shapes);
  if (!arguments.as_json) {
    std::fputs(table_text(summary).c_str(), stdout);
    return;
  }
  RunProvenance provenance = current_provenance();
  provenance.configuration = kConfiguration;
  provenance.threads = 1;
  provenance.seed = arguments.seed;
  summary["every"] = arguments.every;
  summary["limit_s"] = arguments.limit_s;
  summary["provenance"] = provenance_json(provenance);
  std::fputs(json_text(summary).c_str(), stdout);
}

Result<void> run(const Arguments& arguments) {
  Workshop shop;
  const auto bench = SIDESTEP_TRY(load_bench(shop));
  const auto problems = SIDESTEP_TRY(read_problems(arguments, bench.robot->description()));
  const PathJudge judge(bench.robot, bench.planning.space(), bench.check, arguments.with_shapes);
  (void)solve_one(problems.front(), bench, judge, arguments, shop.log);  // does not count
  std::vector<Solve> solves;
  for (const SetProblem& problem : problems) {
    solves.push_back(SIDESTEP_TRY(solve_one(problem, bench, judge, arguments, shop.log)));
  }
  print(solves, arguments);
  return {};
}

void add_options(CLI::App& app, Arguments& arguments) {
  app.add_option("PROBLEMS", arguments.problems,
                 "Folder of problem sets (docs/reference/problem_sets.md), or one")
      ->required();
  app.add_option("--every", arguments.every, "Every n-th problem of a family is used")
      ->check(CLI::Range(1, 1'000'000))
      ->capture_default_str();
  app.add_option("--seconds", arguments.limit_s, "For the search of one problem")
      ->check(CLI::Range(1e-3, 3600.0))
      ->capture_default_str();
  app.add_option("--seed", arguments.seed, "Of OMPL's random numbers")->capture_default_str();
  app.add_flag("--shapes", arguments.with_shapes,
               "Hold paths against the shapes of the URDF, too: a quarter of a second each");
  app.add_flag("--json", arguments.as_json, "Print JSON instead of a table");
}

}  // namespace

int main(int argc, char** argv) {
  Arguments arguments;
  CLI::App app("Solves MotionBenchMaker's problems for the Panda with OMPL alone");
  add_options(app, arguments);
  try {
    app.parse(argc, argv);
  } catch (const CLI::ParseError& error) {
    return app.exit(error) == 0 ? 0 : 2;
  }
  const auto done = run(arguments);
  if (done) return 0;
  std::fprintf(stderr, "%s\n", done.error().describe().c_str());
  switch (done.error().code) {
    case ErrorCode::kConfig:
    case ErrorCode::kNotFound: return 2;
    case ErrorCode::kPlugin: return 3;
    default: return 4;
  }
}
