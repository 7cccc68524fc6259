#include <algorithm>
#include <atomic>
#include <mutex>

#include <sidestep/core/index.hpp>
#include <sidestep/core/worker_pool.hpp>
#include <sidestep/mapping/field_builder.hpp>
#include <sidestep/runtime/call_plugin.hpp>

#include "study_problems.hpp"
#include "study_rows.hpp"
#include "study_settings.hpp"
#include "study_summary.hpp"

namespace sidestep {
namespace {

/// Problems, at least, between two commits: what a run that is killed loses.
constexpr std::int64_t kProblemsInBatch = 512;

bool in_shard(const Shard& shard, std::size_t robot, int scene, int scenes) {
  const auto unit = static_cast<std::int64_t>(robot) * scenes + scene;
  return unit % shard.count == shard.index;
}

/// One robot at work: everything that its problems share.
class RobotStudy {
 public:
  static Result<std::unique_ptr<RobotStudy>> make(const FieldStudy& study, std::size_t index,
                                                  ExperimentContext& context);

  [[nodiscard]] const StudyRobot& settings() const { return settings_; }
  [[nodiscard]] const RobotDescription& description() const { return robot_->description(); }
  [[nodiscard]] const std::vector<Eigen::VectorXd>& states() const { return states_; }

  /// Optimisers for `threads` threads.
  Result<void> prepare(int threads, bool skips_collisions, ExperimentContext& context);

  struct Prepared {
    StudyScene scene;
    SceneRow row;
  };
  /// Draws a scene and makes both its fields.
  Result<Prepared> make_scene(int scene, int boxes, std::uint64_t seed);
  [[nodiscard]] StudySolver& solver(std::size_t thread) { return *solvers_[thread]; }

 private:
  RobotStudy(const StudyRobot& settings, const CheckSettings& check, const Node& optimiser_block,
             std::shared_ptr<const RobotModel> robot)
      : settings_(settings),
        check_(check),
        optimiser_block_(optimiser_block),
        robot_(std::move(robot)),
        map_(settings.grid) {}
  std::vector<char> free_states(const DistanceField& truth) const;

  const StudyRobot& settings_;
  const CheckSettings& check_;
  const Node& optimiser_block_;
  std::shared_ptr<const RobotModel> robot_;
  std::vector<Eigen::VectorXd> states_;
  BoxMap map_;
  std::vector<PluginPtr<FieldBuilder>> builders_;  ///< By kind of field.
  std::vector<std::unique_ptr<StudySolver>> solvers_;
};

Result<std::unique_ptr<RobotStudy>> RobotStudy::make(const FieldStudy& study, std::size_t index,
                                                     ExperimentContext& context) {
  const StudyRobot& settings = study.robots[index];
  auto model = SIDESTEP_TRY(context.host.create<RobotModel>(settings.entry.robot));
  std::unique_ptr<RobotStudy> robot(
      new RobotStudy(settings, study.check, study.optimiser_block, std::move(model)));
  robot->states_ =
      SIDESTEP_TRY(draw_states(settings, robot->robot_, study.settings.states, context.seed));
  for (const bool is_signed : {false, true}) {
    auto builder = SIDESTEP_TRY(context.host.create<FieldBuilder>(
        study_field_block(study.field_block, is_signed), robot->robot_));
    SIDESTEP_TRY(call_stage(plugin_of(builder), [&] { return builder->attach(robot->map_); }));
    robot->builders_.push_back(std::move(builder));
  }
  return robot;
}

Result<void> RobotStudy::prepare(int threads, bool skips_collisions, ExperimentContext& context) {
  for (int t = 0; t < threads; ++t) {
    auto optimiser = SIDESTEP_TRY(context.host.create<Optimiser>(optimiser_block_, robot_));
    solvers_.push_back(std::make_unique<StudySolver>(settings_, robot_, states_,
                                                     std::move(optimiser), skips_collisions));
  }
  return {};
}

Result<RobotStudy::Prepared> RobotStudy::make_scene(int scene, int boxes, std::uint64_t seed) {
  const std::vector<StudyBox> drawn = draw_boxes(settings_.entry, boxes, scene, seed);
  Prepared prepared;
  prepared.scene.scene = scene;
  prepared.row.scene = scene;
  prepared.row.mean_side_m = mean_side_m(settings_.entry, drawn);
  const MapUpdate update = map_.set_boxes(drawn);
  for (const std::size_t kind : {kUnsigned, kSigned}) {
    const Stopwatch watch;
    auto field = SIDESTEP_TRY(
        call_stage(plugin_of(builders_[kind]), [&] { return builders_[kind]->update(update); }));
    prepared.row.field_ms[kind] = watch.elapsed_ms();
    prepared.scene.fields[kind] = std::move(field);
  }
  const auto truth = true_field(drawn);
  prepared.scene.state_free = free_states(*truth);
  prepared.scene.check = make_field_check(
      robot_, truth, {Space::kFree, Space::kOccupied},
      {.margin_m = check_.margin_m, .max_step_m = check_.max_step_m, .obstacles_only = true});
  return prepared;
}

std::vector<char> RobotStudy::free_states(const DistanceField& truth) const {
  const std::vector<CollisionSphere>& spheres = description().spheres;
  std::vector<Eigen::Vector3d> centres(spheres.size());
  std::vector<double> distances(spheres.size());
  std::vector<char> free;
  Scratch scratch;
  for (const Eigen::VectorXd& q : states_) {
    robot_->sphere_centres(as_span(q), centres, scratch);
    truth.query(centres, distances, {}, {});
    bool clear = true;
    for (std::size_t s = 0; s < spheres.size(); ++s) {
      clear = clear && distances[s] - spheres[s].radius_m >= check_.margin_m;
    }
    free.push_back(clear ? 1 : 0);
  }
  return free;
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
    StudySolver& solver = robot.solver(static_cast<std::size_t>(thread));
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
      if (context.progress) context.progress(done, total, robot.settings().entry.name);
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
class StudyRun {
 public:
  StudyRun(const FieldStudy& study, ExperimentContext& context, Recorder& recorder,
           std::vector<DoneProblems> done)
      : study_(study),
        context_(context),
        recorder_(recorder),
        done_(std::move(done)),
        workers_(context.threads),
        clock_(workers_.thread_count()) {}

  /// What is known of the robots before any problem is solved.
  Result<std::vector<StudyRobotRows>> prepare();
  Result<void> solve(std::int64_t session);

 private:
  Result<void> solve_robot(std::size_t robot);
  Result<void> solve_batch(std::size_t robot, const std::vector<int>& scenes);

  const FieldStudy& study_;
  ExperimentContext& context_;
  Recorder& recorder_;
  std::vector<DoneProblems> done_;
  WorkerPool workers_;
  std::vector<std::unique_ptr<RobotStudy>> robots_;
  std::int64_t solved_ = 0;  ///< In all sessions.
  std::int64_t total_ = 0;
  std::int64_t session_ = 0;
  SessionClock clock_;
};

Result<std::vector<StudyRobotRows>> StudyRun::prepare() {
  std::vector<StudyRobotRows> rows;
  const FieldStudySettings& settings = study_.settings;
  for (std::size_t r = 0; r < study_.robots.size(); ++r) {
    auto robot = SIDESTEP_TRY(RobotStudy::make(study_, r, context_));
    StudyRobotRows row;
    row.name = study_.robots[r].entry.name;
    row.dof = robot->description().dof();
    row.spheres = static_cast<int>(robot->description().spheres.size());
    row.states = settings.states;
    row.scenes = settings.scenes;
    row.boxes_per_scene = settings.boxes_per_scene;
    row.resolution_m = study_.robots[r].grid.resolution_m;
    row.drawn_states = robot->states();
    row.published = study_.robots[r].entry.published;
    for (int scene = 0; scene < settings.scenes; ++scene) {
      if (in_shard(context_.shard, r, scene, settings.scenes)) row.planned += settings.pairs();
    }
    total_ += row.planned;
    solved_ += static_cast<std::int64_t>(done_[r].size());
    rows.push_back(std::move(row));
    robots_.push_back(std::move(robot));
  }
  return rows;
}

Result<void> StudyRun::solve(std::int64_t session) {
  session_ = session;
  for (std::size_t r = 0; r < robots_.size(); ++r) {
    if (context_.stop.stop_requested()) break;
    auto done = solve_robot(r);
    robots_[r].reset();  // its fields and optimisers
    if (!done) return done;
  }
  record_session(clock_.after(0), session_, recorder_);
  return recorder_.commit();
}

Result<void> StudyRun::solve_robot(std::size_t robot) {
  const FieldStudySettings& settings = study_.settings;
  const std::int64_t pairs = settings.pairs();
  std::vector<int> scenes;
  for (int scene = 0; scene < settings.scenes; ++scene) {
    if (!in_shard(context_.shard, robot, scene, settings.scenes)) continue;
    const auto first = done_[robot].lower_bound(scene * pairs);
    const auto last = done_[robot].lower_bound((scene + 1) * pairs);
    if (std::distance(first, last) < pairs) scenes.push_back(scene);
  }
  if (scenes.empty()) return {};
  SIDESTEP_TRY(
      robots_[robot]->prepare(workers_.thread_count(), settings.skips_collisions(), context_));
  const auto in_batch = static_cast<std::size_t>((kProblemsInBatch + pairs - 1) / pairs);
  for (std::size_t first = 0; first < scenes.size(); first += in_batch) {
    if (context_.stop.stop_requested()) return {};
    const auto begin = scenes.begin() + static_cast<std::ptrdiff_t>(first);
    const auto count = std::min(in_batch, scenes.size() - first);
    SIDESTEP_TRY(solve_batch(robot, {begin, begin + static_cast<std::ptrdiff_t>(count)}));
  }
  return {};
}

Result<void> StudyRun::solve_batch(std::size_t robot, const std::vector<int>& scenes) {
  const std::int64_t pairs = study_.settings.pairs();
  std::vector<RobotStudy::Prepared> prepared;
  for (const int scene : scenes) {
    auto made = SIDESTEP_TRY(
        robots_[robot]->make_scene(scene, study_.settings.boxes_per_scene, context_.seed));
    record_scene(made.row, robot, recorder_);
    prepared.push_back(std::move(made));
  }
  std::vector<WorkItem> items;
  for (const RobotStudy::Prepared& one : prepared) {
    for (std::int64_t pair = 0; pair < pairs; ++pair) {
      if (done_[robot].contains(one.scene.scene * pairs + pair)) continue;
      items.push_back({&one.scene, pair});
    }
  }
  const auto solved =
      SIDESTEP_TRY(solve_all(items, *robots_[robot], workers_, context_, solved_, total_));
  for (const ProblemOutcome& outcome : solved) record_problem(outcome, robot, recorder_);
  record_session(clock_.after(std::ssize(solved)), session_, recorder_);
  return recorder_.commit();
}

Result<ExperimentOutcome> run_field_study(ExperimentContext& context) {
  std::vector<Error> errors;
  const FieldStudy study = read_field_study(context.configuration, errors);
  if (!errors.empty()) return tl::make_unexpected(std::move(errors.front()));
  const std::int64_t units = static_cast<std::int64_t>(study.robots.size()) * study.settings.scenes;
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
  const auto file = context.out / "results.sqlite";
  if (context.resume) {
    const auto earlier = SIDESTEP_TRY(read_study(file));
    SIDESTEP_TRY(check_same_run(earlier, record, file.string()));
    session = static_cast<std::int64_t>(earlier.sessions.size());
    for (std::size_t r = 0; r < done.size(); ++r) {
      for (const ProblemOutcome& problem : earlier.robots[r].problems) {
        done[r].insert(done[r].end(), problem.problem);
      }
    }
  }
  auto store = SIDESTEP_TRY(context.resume ? ResultsStore::reopen(file)
                                           : ResultsStore::open(file, record.provenance));
  Recorder recorder(*store);
  StudyRun run(study, context, recorder, std::move(done));
  record.robots = SIDESTEP_TRY(run.prepare());
  if (!context.resume) record_study(record, recorder);
  SIDESTEP_TRY(recorder.commit());
  auto solved = run.solve(session);
  store.reset();
  if (context.progress) context.progress(0, 0, "summing up");
  return conclude_study(context.out, context.stop.stop_requested(),
                        solved ? std::nullopt : std::optional<Error>(std::move(solved.error())));
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
    return run_field_study(context);
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
