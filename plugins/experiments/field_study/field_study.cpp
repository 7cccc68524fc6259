#include <algorithm>
#include <atomic>
#include <mutex>

#include <sidestep/core/index.hpp>
#include <sidestep/core/worker_pool.hpp>
#include <sidestep/mapping/field_builder.hpp>
#include <sidestep/runtime/blocks.hpp>
#include <sidestep/runtime/call_plugin.hpp>
#include <sidestep/runtime/configuration.hpp>

#include "study_parts.hpp"

namespace sidestep {
namespace {

/// Problems, at least, between two commits: what a run that is killed loses.
constexpr std::int64_t kProblemsInBatch = 512;

bool in_shard(const Shard& shard, std::size_t robot, int scene, int scenes) {
  const auto unit = static_cast<std::int64_t>(robot) * scenes + scene;
  return unit % shard.count == shard.index;
}

/// One robot at work: everything that its problems share. Fields are attached to its map.
struct RobotStudy {
  const StudyRobot& settings;
  std::shared_ptr<const RobotModel> robot;
  std::vector<Eigen::VectorXd> states;
  FieldChecks checks{robot};
  BoxMap map{settings.grid};
  std::vector<PluginPtr<FieldBuilder>> builders = {};  ///< By kind of field.
  std::vector<StudySolver> solvers = {};               ///< By thread.
};

Result<std::unique_ptr<RobotStudy>> make_robot(const FieldStudy& study, std::size_t index,
                                               ExperimentContext& context) {
  const StudyRobot& settings = study.robots[index];
  std::shared_ptr<const RobotModel> model =
      SIDESTEP_TRY(context.host.create<RobotModel>(settings.entry.robot));
  auto states = SIDESTEP_TRY(draw_states(settings, model, study.settings.states, context.seed));
  std::unique_ptr<RobotStudy> robot(new RobotStudy{settings, model, std::move(states)});
  const Node& field = block_of(context.configuration, "field");
  for (const char* is_signed : {"false", "true"}) {
    const Node block = with_entry(field, "signed", plain_scalar(is_signed, field.mark()));
    auto builder = SIDESTEP_TRY(context.host.create<FieldBuilder>(block, model));
    SIDESTEP_TRY(call_stage(plugin_of(builder), [&] { return builder->attach(robot->map); }));
    robot->builders.push_back(std::move(builder));
  }
  return robot;
}

/// Which states keep the margin to the boxes.
std::vector<char> free_states(const RobotStudy& robot,
                              const std::shared_ptr<const DistanceField>& truth, double margin_m) {
  std::vector<char> free;
  for (const Eigen::VectorXd& q : robot.states) {
    const auto collision =
        robot.checks.state_violation(truth, {Space::kFree, Space::kOccupied}, margin_m, as_span(q));
    free.push_back(collision ? 0 : 1);
  }
  return free;
}

struct PreparedScene {
  StudyScene scene;
  SceneRow row;
};

/// Draws a scene and makes both its fields.
Result<PreparedScene> make_scene(RobotStudy& robot, const FieldStudy& study, int scene,
                                 std::uint64_t seed) {
  const StudyRobotEntry& entry = robot.settings.entry;
  const auto boxes = draw_boxes(entry, study.settings.boxes_per_scene, scene, seed);
  PreparedScene prepared;
  prepared.scene.scene = scene;
  prepared.row.scene = scene;
  prepared.row.mean_side_m = mean_side_m(entry, boxes);
  const MapUpdate update = robot.map.set_boxes(boxes);
  for (const std::size_t kind : {kUnsigned, kSigned}) {
    const Stopwatch watch;
    const auto& builder = robot.builders[kind];
    auto field =
        SIDESTEP_TRY(call_stage(plugin_of(builder), [&] { return builder->update(update); }));
    prepared.row.field_ms[kind] = watch.elapsed_ms();
    prepared.scene.fields[kind] = std::move(field);
  }
  const auto truth = true_field(boxes);
  prepared.scene.state_free = free_states(robot, truth, study.check.margin_m);
  prepared.scene.check = robot.checks.make(truth, {Space::kFree, Space::kOccupied},
                                           {.margin_m = study.check.margin_m,
                                            .max_step_m = study.check.max_step_m,
                                            .obstacles_only = true});
  return prepared;
}

/// A pair of one of the scenes that are being worked on.
struct WorkItem {
  const StudyScene* scene = nullptr;
  std::int64_t pair = 0;
};

/// The problems of a batch of scenes on all threads. What is not solved when the run is
/// interrupted is missing from the outcomes.
Result<std::vector<ProblemOutcome>> solve_all(const std::vector<WorkItem>& items, RobotStudy& robot,
                                              WorkerPool& workers, const ExperimentContext& context,
                                              std::int64_t& done, std::int64_t total) {
  std::vector<std::optional<ProblemOutcome>> outcomes(items.size());
  std::optional<Error> fault;
  std::atomic<std::size_t> next = 0;
  std::atomic<bool> stopped = false;
  std::mutex mutex;  // guards fault, done and the progress callback
  const Deadline deadline(context.stop);
  workers.run(workers.thread_count(), [&](int thread) {
    StudySolver& solver = robot.solvers[idx(thread)];
    while (!stopped) {
      const std::size_t i = next++;
      if (i >= items.size()) return;
      auto solved = solver.solve(*items[i].scene, items[i].pair, deadline);
      const std::lock_guard lock(mutex);
      if (!solved) {
        stopped = true;
        if (solved.error().code != ErrorCode::kCancelled) fault = std::move(solved.error());
        return;
      }
      outcomes[i] = std::move(*solved);
      ++done;
      if (context.progress) context.progress(done, total, robot.settings.entry.name);
    }
  });
  if (fault) return tl::make_unexpected(std::move(*fault));
  std::vector<ProblemOutcome> solved;
  for (std::optional<ProblemOutcome>& outcome : outcomes) {
    if (outcome) solved.push_back(std::move(*outcome));
  }
  return solved;
}

/// Problems of one robot that a store holds already.
using DoneProblems = std::set<std::int64_t>;

/// A run of a study: the scenes of its shard that are not done yet.
struct StudyRun {
  const FieldStudy& study;
  ExperimentContext& context;
  Recorder& recorder;
  std::vector<DoneProblems> done;  ///< By robot.
  WorkerPool workers{context.threads};
  SessionClock clock{workers.thread_count()};
  std::vector<std::unique_ptr<RobotStudy>> robots = {};
  std::int64_t solved = 0;  ///< In all sessions.
  std::int64_t total = 0;

  /// What is known of the robots before any problem is solved.
  Result<std::vector<StudyRobotRows>> prepare();
  Result<void> solve(std::int64_t session);
  Result<void> solve_robot(std::size_t robot, std::int64_t session);
  Result<void> solve_batch(std::size_t robot, const std::vector<int>& scenes, std::int64_t session);
};

Result<std::vector<StudyRobotRows>> StudyRun::prepare() {
  std::vector<StudyRobotRows> rows;
  const FieldStudySettings& settings = study.settings;
  for (std::size_t r = 0; r < study.robots.size(); ++r) {
    auto robot = SIDESTEP_TRY(make_robot(study, r, context));
    StudyRobotRows row;
    row.name = study.robots[r].entry.name;
    row.dof = robot->robot->description().dof();
    row.spheres = static_cast<int>(robot->robot->description().spheres.size());
    row.states = settings.states;
    row.scenes = settings.scenes;
    row.boxes_per_scene = settings.boxes_per_scene;
    row.resolution_m = study.robots[r].grid.resolution_m;
    row.drawn_states = robot->states;
    row.published = study.robots[r].entry.published;
    for (int scene = 0; scene < settings.scenes; ++scene) {
      if (in_shard(context.shard, r, scene, settings.scenes)) row.planned += settings.pairs();
    }
    total += row.planned;
    solved += static_cast<std::int64_t>(done[r].size());
    rows.push_back(std::move(row));
    robots.push_back(std::move(robot));
  }
  return rows;
}

Result<void> StudyRun::solve(std::int64_t session) {
  for (std::size_t r = 0; r < robots.size(); ++r) {
    if (context.stop.stop_requested()) break;
    auto ended = solve_robot(r, session);
    robots[r].reset();  // its fields and optimisers
    if (!ended) return ended;
  }
  record_session(clock.after(0), session, recorder);
  return recorder.commit();
}

Result<void> StudyRun::solve_robot(std::size_t robot, std::int64_t session) {
  const FieldStudySettings& settings = study.settings;
  const std::int64_t pairs = settings.pairs();
  std::vector<int> scenes;
  for (int scene = 0; scene < settings.scenes; ++scene) {
    if (!in_shard(context.shard, robot, scene, settings.scenes)) continue;
    const auto first = done[robot].lower_bound(scene * pairs);
    const auto last = done[robot].lower_bound((scene + 1) * pairs);
    if (std::distance(first, last) < pairs) scenes.push_back(scene);
  }
  if (scenes.empty()) return {};
  RobotStudy& at_work = *robots[robot];
  for (int t = 0; t < workers.thread_count(); ++t) {
    auto optimiser = SIDESTEP_TRY(context.host.create<Optimiser>(
        block_of(context.configuration, "optimiser"), at_work.robot));
    at_work.solvers.push_back({at_work.settings, at_work.robot, at_work.states,
                               std::move(optimiser), settings.skips_collisions()});
  }
  const auto in_batch = static_cast<std::size_t>((kProblemsInBatch + pairs - 1) / pairs);
  for (std::size_t first = 0; first < scenes.size(); first += in_batch) {
    if (context.stop.stop_requested()) return {};
    const auto begin = scenes.begin() + static_cast<std::ptrdiff_t>(first);
    const auto count = std::min(in_batch, scenes.size() - first);
    SIDESTEP_TRY(solve_batch(robot, {begin, begin + static_cast<std::ptrdiff_t>(count)}, session));
  }
  return {};
}

Result<void> StudyRun::solve_batch(std::size_t robot, const std::vector<int>& scenes,
                                   std::int64_t session) {
  const std::int64_t pairs = study.settings.pairs();
  std::vector<PreparedScene> prepared;
  for (const int scene : scenes) {
    auto made = SIDESTEP_TRY(make_scene(*robots[robot], study, scene, context.seed));
    record_scene(made.row, robot, recorder);
    prepared.push_back(std::move(made));
  }
  std::vector<WorkItem> items;
  for (const PreparedScene& one : prepared) {
    for (std::int64_t pair = 0; pair < pairs; ++pair) {
      if (done[robot].contains(one.scene.scene * pairs + pair)) continue;
      items.push_back({&one.scene, pair});
    }
  }
  const auto outcomes =
      SIDESTEP_TRY(solve_all(items, *robots[robot], workers, context, solved, total));
  for (const ProblemOutcome& outcome : outcomes) record_problem(outcome, robot, recorder);
  record_session(clock.after(std::ssize(outcomes)), session, recorder);
  return recorder.commit();
}

class FieldStudyExperiment final : public Experiment {
 public:
  [[nodiscard]] ExperimentFacts facts() const override {
    return {.blocks = {"field", "optimiser", "planning"},
            .optional_blocks = {"check"},
            .unused_of_planning = unused_of_study_planning(),
            .is_divisible = true};
  }
  [[nodiscard]] const report::RunReport& report() const override { return study_report(); }
  void check(const Configuration& configuration, Host& host,
             std::vector<Error>& errors) const override {
    check_field_study(configuration, host, errors);
  }
  [[nodiscard]] Result<ExperimentOutcome> run(ExperimentContext& context) const override {
    std::vector<Error> errors;
    const FieldStudy study = read_field_study(context.configuration, errors);
    if (!errors.empty()) return tl::make_unexpected(std::move(errors.front()));
    const std::int64_t units =
        static_cast<std::int64_t>(study.robots.size()) * study.settings.scenes;
    if (context.shard.count > units) {
      return fail(ErrorCode::kConfig,
                  "the study has " + std::to_string(units) + " scenes, too few for " +
                      std::to_string(context.shard.count) + " shards",
                  context.configuration.file.string());
    }
    StudyRecord record{divided_run_of(context)};
    record.confidence = study.settings.confidence;
    record.bootstrap_samples = study.settings.bootstrap_samples;
    record.published_as = study.settings.published_as;

    std::vector<DoneProblems> done(study.robots.size());
    std::int64_t session = 0;
    if (context.resume) {
      const auto file = context.out / "results.sqlite";
      const auto earlier = SIDESTEP_TRY(read_study(file));
      SIDESTEP_TRY(check_same_run(earlier, record, file.string()));
      session = static_cast<std::int64_t>(earlier.sessions.size());
      for (std::size_t r = 0; r < done.size(); ++r) {
        for (const ProblemOutcome& problem : earlier.robots[r].problems) {
          done[r].insert(done[r].end(), problem.problem);
        }
      }
    }
    auto store = SIDESTEP_TRY(open_store(context, record.provenance));
    Recorder recorder(*store);
    StudyRun run{study, context, recorder, std::move(done)};
    record.robots = SIDESTEP_TRY(run.prepare());
    if (!context.resume) record_study(record, recorder);
    SIDESTEP_TRY(recorder.commit());
    auto solved = run.solve(session);
    store.reset();
    if (context.progress) context.progress(0, 0, "summing up");
    return conclude_study(context.out, context.stop.stop_requested(),
                          solved ? std::nullopt : std::optional<Error>(std::move(solved.error())));
  }
  [[nodiscard]] Result<ExperimentOutcome> merge(const std::vector<std::filesystem::path>& shards,
                                                const std::filesystem::path& out) const override {
    return merge_study(shards, out);
  }
};

}  // namespace
}  // namespace sidestep

SIDESTEP_EXPERIMENT(
    sidestep::FieldStudyExperiment, sidestep::FieldStudySettings, "field_study", "0.1.0",
    "Trajectory optimisation in signed and unsigned fields of random boxes, compared")
