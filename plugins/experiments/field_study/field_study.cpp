#include <algorithm>
#include <atomic>
#include <mutex>
#include <set>

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

/// One robot at work: everything that its problems share. Fields are attached to its map.
struct RobotStudy {
  const StudyRobot& settings;
  std::shared_ptr<const RobotModel> robot;
  std::vector<Eigen::VectorXd> states;
  std::vector<int> scenes = {};  ///< Of the shard.
  FieldChecks checks{robot};
  BoxMap map{settings.grid};
  std::vector<PluginPtr<FieldBuilder>> builders = {};  ///< By kind of field.
  std::vector<StudySolver> solvers = {};               ///< By thread.
};

/// Draws a scene and makes both its fields.
Result<StudyScene> make_scene(RobotStudy& robot, const FieldStudy& study, int scene,
                              std::uint64_t seed) {
  const StudyRobotEntry& entry = robot.settings.entry;
  const auto boxes = draw_boxes(entry, study.settings.boxes_per_scene, scene, seed);
  StudyScene prepared;
  prepared.scene = scene;
  prepared.row.scene = scene;
  prepared.row.mean_side_m = mean_side_m(entry, boxes);
  const MapUpdate update = robot.map.set_boxes(boxes);
  for (const std::size_t kind : {kUnsigned, kSigned}) {
    const Stopwatch watch;
    const auto& builder = robot.builders[kind];
    auto field =
        SIDESTEP_TRY(call_stage(plugin_of(builder), [&] { return builder->update(update); }));
    prepared.row.field_ms[kind] = watch.elapsed_ms();
    prepared.fields[kind] = std::move(field);
  }
  const auto truth = true_field(boxes);
  for (const Eigen::VectorXd& q : robot.states) {
    const auto collision = robot.checks.state_violation(truth, {Space::kFree, Space::kOccupied},
                                                        study.check.margin_m, as_span(q));
    prepared.state_free.push_back(collision ? 0 : 1);
  }
  prepared.check = robot.checks.make(truth, {Space::kFree, Space::kOccupied},
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

/// A run of a study: the scenes of its shard that are not done yet.
struct StudyRun {
  const FieldStudy& study;
  ExperimentContext& context;
  Recorder& recorder;
  std::vector<std::set<std::int64_t>> done;  ///< By robot: problems that the store holds already.
  std::int64_t session;                      ///< Index of this one.
  WorkerPool workers{context.threads};
  SessionClock clock{workers.thread_count()};
  std::vector<std::unique_ptr<RobotStudy>> robots = {};
  std::int64_t solved = 0;  ///< In all sessions.
  std::int64_t total = 0;

  /// What is known of the robots before any problem is solved.
  Result<std::vector<StudyRobotRows>> prepare();
  Result<void> solve();
  Result<void> solve_robot(std::size_t robot);
  Result<void> solve_batch(std::size_t robot, std::span<const int> scenes);
  /// The problems of a batch of scenes on all threads. What is not solved when the run is
  /// interrupted has no outcome.
  Result<std::vector<std::optional<ProblemOutcome>>> solve_all(const std::vector<WorkItem>& items,
                                                               RobotStudy& robot);
};

Result<std::vector<StudyRobotRows>> StudyRun::prepare() {
  std::vector<StudyRobotRows> rows;
  const FieldStudySettings& settings = study.settings;
  const Node& field = block_of(context.configuration, "field");
  for (std::size_t r = 0; r < study.robots.size(); ++r) {
    const StudyRobot& one = study.robots[r];
    std::shared_ptr<const RobotModel> model =
        SIDESTEP_TRY(context.host.create<RobotModel>(one.entry.robot));
    auto states = SIDESTEP_TRY(draw_states(one, model, settings.states, context.seed));
    std::unique_ptr<RobotStudy> robot(new RobotStudy{one, model, std::move(states)});
    for (const char* is_signed : {"false", "true"}) {
      const Node block = with_entry(field, "signed", plain_scalar(is_signed, field.mark()));
      auto builder = SIDESTEP_TRY(context.host.create<FieldBuilder>(block, model));
      SIDESTEP_TRY(call_stage(plugin_of(builder), [&] { return builder->attach(robot->map); }));
      robot->builders.push_back(std::move(builder));
    }
    StudyRobotRows row;
    row.name = one.entry.name;
    row.dof = model->description().dof();
    row.spheres = static_cast<int>(model->description().spheres.size());
    row.states = settings.states;
    row.scenes = settings.scenes;
    row.boxes_per_scene = settings.boxes_per_scene;
    row.resolution_m = one.grid.resolution_m;
    row.drawn_states = robot->states;
    row.published = one.entry.published;
    for (int scene = 0; scene < settings.scenes; ++scene) {
      const auto unit = static_cast<std::int64_t>(r) * settings.scenes + scene;
      if (unit % context.shard.count == context.shard.index) robot->scenes.push_back(scene);
    }
    row.planned = std::ssize(robot->scenes) * settings.pairs();
    total += row.planned;
    solved += std::ssize(done[r]);
    rows.push_back(std::move(row));
    robots.push_back(std::move(robot));
  }
  return rows;
}

Result<void> StudyRun::solve() {
  for (std::size_t r = 0; r < robots.size(); ++r) {
    if (context.stop.stop_requested()) break;
    auto ended = solve_robot(r);
    robots[r].reset();  // its fields and optimisers
    if (!ended) return ended;
  }
  record_session(clock.after(0), session, recorder);
  return recorder.commit();
}

Result<void> StudyRun::solve_robot(std::size_t robot) {
  const std::int64_t pairs = study.settings.pairs();
  RobotStudy& at_work = *robots[robot];
  std::vector<int>& scenes = at_work.scenes;
  std::erase_if(scenes, [&](int scene) {
    const auto first = done[robot].lower_bound(scene * pairs);
    const auto last = done[robot].lower_bound((scene + 1) * pairs);
    return std::distance(first, last) == pairs;
  });
  if (scenes.empty()) return {};
  for (int t = 0; t < workers.thread_count(); ++t) {
    auto optimiser = SIDESTEP_TRY(context.host.create<Optimiser>(
        block_of(context.configuration, "optimiser"), at_work.robot));
    at_work.solvers.push_back({at_work.settings, at_work.robot, at_work.states,
                               std::move(optimiser), study.settings.skips_collisions()});
  }
  const std::size_t in_batch = idx((kProblemsInBatch + pairs - 1) / pairs);
  for (std::span<const int> left = scenes; !left.empty() && !context.stop.stop_requested();) {
    const std::size_t count = std::min(in_batch, left.size());
    SIDESTEP_TRY(solve_batch(robot, left.first(count)));
    left = left.subspan(count);
  }
  return {};
}

Result<void> StudyRun::solve_batch(std::size_t robot, std::span<const int> scenes) {
  const std::int64_t pairs = study.settings.pairs();
  std::vector<StudyScene> prepared;
  for (const int scene : scenes) {
    auto made = SIDESTEP_TRY(make_scene(*robots[robot], study, scene, context.seed));
    record_scene(made.row, robot, recorder);
    prepared.push_back(std::move(made));
  }
  std::vector<WorkItem> items;
  for (const StudyScene& one : prepared) {
    for (std::int64_t pair = 0; pair < pairs; ++pair) {
      if (done[robot].contains(one.scene * pairs + pair)) continue;
      items.push_back({&one, pair});
    }
  }
  const std::int64_t before = solved;
  const auto outcomes = SIDESTEP_TRY(solve_all(items, *robots[robot]));
  for (const auto& outcome : outcomes) {
    if (outcome) record_problem(*outcome, robot, recorder);
  }
  record_session(clock.after(solved - before), session, recorder);
  return recorder.commit();
}

Result<std::vector<std::optional<ProblemOutcome>>> StudyRun::solve_all(
    const std::vector<WorkItem>& items, RobotStudy& robot) {
  std::vector<std::optional<ProblemOutcome>> outcomes(items.size());
  std::optional<Error> fault;
  std::atomic<std::size_t> next = 0;
  std::atomic<bool> stopped = false;
  std::mutex mutex;  // guards fault, solved and the progress callback
  const Deadline deadline(context.stop);
  workers.run(workers.thread_count(), [&](int thread) {
    StudySolver& solver = robot.solvers[idx(thread)];
    while (!stopped) {
      const std::size_t i = next++;
      if (i >= items.size()) return;
      auto outcome = solver.solve(*items[i].scene, items[i].pair, deadline);
      const std::lock_guard lock(mutex);
      if (!outcome) {
        stopped = true;
        if (outcome.error().code != ErrorCode::kCancelled) fault = std::move(outcome.error());
        return;
      }
      outcomes[i] = std::move(*outcome);
      ++solved;
      if (context.progress) context.progress(solved, total, robot.settings.entry.name);
    }
  });
  if (fault) return tl::make_unexpected(std::move(*fault));
  return outcomes;
}

/// Moves what a part has found into the whole.
void absorb_study(StudyRecord& whole, StudyRecord part) {
  for (std::size_t r = 0; r < whole.robots.size(); ++r) {
    std::ranges::copy(part.robots[r].drawn, std::back_inserter(whole.robots[r].drawn));
    std::ranges::copy(part.robots[r].problems, std::back_inserter(whole.robots[r].problems));
  }
}

void record_whole_study(const StudyRecord& study, Recorder& recorder) {
  record_study(study, recorder);
  for (std::size_t r = 0; r < study.robots.size(); ++r) {
    for (const SceneRow& scene : study.robots[r].drawn) record_scene(scene, r, recorder);
    for (const ProblemOutcome& problem : study.robots[r].problems) {
      record_problem(problem, r, recorder);
    }
  }
}

class FieldStudyExperiment final : public Experiment {
 public:
  [[nodiscard]] ExperimentFacts facts() const override {
    return {.blocks = {"field", "optimiser", "planning"},
            .optional_blocks = {"check"},
            .unused_of_planning = kUnusedOfStudyPlanning,
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
    StudyRecord record{divided_run_of(context),
                       study.settings.confidence,
                       study.settings.bootstrap_samples,
                       study.settings.published_as,
                       {}};
    std::vector<std::set<std::int64_t>> done(study.robots.size());
    std::int64_t session = 0;
    if (context.resume) {
      const auto file = context.out / "results.sqlite";
      const auto earlier = SIDESTEP_TRY(read_study(file));
      SIDESTEP_TRY(check_same_run(earlier, record, file.string()));
      session = std::ssize(earlier.sessions);
      for (std::size_t r = 0; r < done.size(); ++r) {
        for (const ProblemOutcome& problem : earlier.robots[r].problems) {
          done[r].insert(done[r].end(), problem.problem);
        }
      }
    }
    auto store = SIDESTEP_TRY(open_store(context, record.provenance));
    Recorder recorder(*store);
    StudyRun run{study, context, recorder, std::move(done), session};
    record.robots = SIDESTEP_TRY(run.prepare());
    if (!context.resume) record_study(record, recorder);
    SIDESTEP_TRY(recorder.commit());
    auto solved = run.solve();
    store.reset();
    if (context.progress) context.progress(0, 0, "summing up");
    return conclude_study(context.out, context.stop.stop_requested(),
                          solved ? std::nullopt : std::optional<Error>(std::move(solved.error())));
  }
  [[nodiscard]] Result<ExperimentOutcome> merge(const std::vector<std::filesystem::path>& shards,
                                                const std::filesystem::path& out) const override {
    auto study = SIDESTEP_TRY(merged_record(shards, &read_study, &absorb_study));
    for (StudyRobotRows& robot : study.robots) robot.planned = robot.pairs() * robot.scenes;
    return conclude_whole(study, out, &record_whole_study, &conclude_study);
  }
};

}  // namespace
}  // namespace sidestep

SIDESTEP_EXPERIMENT(
    sidestep::FieldStudyExperiment, sidestep::FieldStudySettings, "field_study", "0.1.0",
    "Trajectory optimisation in signed and unsigned fields of random boxes, compared")
