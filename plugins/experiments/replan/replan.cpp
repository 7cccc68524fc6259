#include <set>

#include <sidestep/results/divided_run.hpp>
#include <sidestep/runtime/checked_robot.hpp>
#include <sidestep/runtime/configuration.hpp>
#include <sidestep/runtime/results_store.hpp>
#include <sidestep/runtime/standing_floor.hpp>
#include "closed_loop.hpp"

namespace sidestep {
namespace {

constexpr const char* kResultsFile = "results.sqlite";
constexpr std::int64_t kAlwaysPictured = 2;  ///< Episodes; later ones where they failed.

/// Episodes that an earlier session finished: it must be of the same experiment.
Result<std::set<std::int64_t>> finished_episodes(const ExperimentContext& context,
                                                 const ReplanHead& head) {
  std::set<std::int64_t> finished;
  if (!context.resume) return finished;
  const auto file = context.out / kResultsFile;
  const auto rows = SIDESTEP_TRY(read_replan_rows(file));
  SIDESTEP_TRY(check_same_run(rows.head, head, file.string(), true));
  for (const EpisodeRow& row : rows.episodes) finished.insert(row.episode);
  return finished;
}

/// Runs the same episode without people, and notes when it reached its goal.
Result<void> add_free_run(ExperimentContext& context, const ReplanConfiguration& settings,
                          const ReplanWorld& world, EpisodeRecord& episode) {
  ReplanWorld alone =
      SIDESTEP_TRY(make_replan_world(context, settings, world.robot, episode.episode, &world));
  EpisodeMapping mapping(alone, settings, context.log, nullptr);
  SIDESTEP_TRY(mapping.attach());
  const auto done = SIDESTEP_TRY(
      run_episode(context, {settings, alone, mapping, {}, {}, false}, episode.episode));
  if (done.reached) episode.free_run_s = done.duration_s;
  return {};
}

/// Runs and records those of the shard's episodes that are not finished yet, each all or not at
/// all.
Result<void> run_episodes(ExperimentContext& context, const ReplanConfiguration& settings,
                          const std::shared_ptr<const RobotModel>& robot, const ReplanHead& head,
                          const std::set<std::int64_t>& finished, Recorder& recorder) {
  const std::int64_t total = settings.experiment.episodes;
  for (std::int64_t i = 0; i < total; ++i) {
    const std::int64_t episode = settings.experiment.first_episode + i;
    if (context.stop.stop_requested()) break;
    if (finished.contains(episode) || !head.is_its(episode)) continue;
    const std::string name = "episode " + std::to_string(episode);
    const auto show = [&](const std::string& what) {
      if (context.progress) context.progress(i, total, what);
    };
    show(name);
    auto world = SIDESTEP_TRY(make_replan_world(context, settings, robot, episode));
    EpisodeMapping mapping(world, settings, context.log, context.observer);
    SIDESTEP_TRY(mapping.attach());
    const auto tell = [&](const std::string& how_far) { show(name + " (" + how_far + ")"); };
    auto done = SIDESTEP_TRY(run_episode(context, {settings, world, mapping, {}, tell}, episode));
    if (done.interrupted) break;
    if (settings.experiment.free_run) {
      show(name + " without people");
      SIDESTEP_TRY(add_free_run(context, settings, world, done));
    }
    const bool pictured = i < kAlwaysPictured || !done.success();
    record_episode(done, *robot, pictured ? settings.experiment.pictures : 0, recorder);
    SIDESTEP_TRY(recorder.commit());
    context.log.info(name + ": " + (done.success() ? "success" : done.reason));
  }
  if (context.progress) context.progress(total, total, "episodes");
  return {};
}

Result<ReplanHead> read_head(const std::filesystem::path& file) {
  auto rows = SIDESTEP_TRY(read_replan_rows(file));
  return std::move(rows.head);
}

class ReplanExperiment final : public LoopExperiment {
 public:
  [[nodiscard]] ExperimentFacts facts() const override {
    ExperimentFacts facts = LoopExperiment::facts();
    facts.is_resumable = facts.is_divisible = true;
    return facts;
  }
  void check(const Configuration& configuration, Host& host,
             std::vector<Error>& errors) const override {
    const auto robot = checked_robot(configuration, host, errors);
    if (robot == nullptr) return;
    (void)read_replan_configuration(configuration, robot, errors);
    check_loop_names(configuration, robot->description(), errors);
  }
  [[nodiscard]] Result<ExperimentOutcome> run(ExperimentContext& context) const override {
    const std::shared_ptr<const RobotModel> robot =
        SIDESTEP_TRY(context.host.create<RobotModel>(block_of(context.configuration, "robot")));
    std::vector<Error> errors;
    ReplanConfiguration settings = read_replan_configuration(context.configuration, robot, errors);
    if (!errors.empty()) return tl::make_unexpected(std::move(errors.front()));
    stand_on_floor(settings.planning, *robot);

    // More episodes than before are the same experiment, gone on with.
    ReplanHead head = replan_head(context, settings, robot->description(),
                                  identity_of(context, {"threads", "episodes", "first_episode"}));
    head.first_episode = settings.experiment.first_episode;
    head.episodes = settings.experiment.episodes;
    if (context.shard.count > head.episodes) {
      return fail(ErrorCode::kConfig,
                  "there are " + std::to_string(head.episodes) + " episodes, too few for " +
                      std::to_string(context.shard.count) + " shards",
                  context.configuration.file.string());
    }
    const auto finished = SIDESTEP_TRY(finished_episodes(context, head));
    return run_loop(context, "replan", head, [&](Recorder& recorder) {
      return run_episodes(context, settings, robot, head, finished, recorder);
    });
  }
  [[nodiscard]] Result<ExperimentOutcome> merge(const std::vector<std::filesystem::path>& shards,
                                                const std::filesystem::path& out) const override {
    const auto whole = SIDESTEP_TRY(merged_record(
        shards, &read_head, +[](ReplanHead&, ReplanHead) {}));
    for (const auto& shard : shards) {
      const auto head = SIDESTEP_TRY(read_head(shard / kResultsFile));
      if (head.first_episode == whole.first_episode && head.episodes == whole.episodes) continue;
      return fail(ErrorCode::kConfig, "this shard is of other episodes than the first",
                  shard.string(), "resume the shards with the same episodes first");
    }
    SIDESTEP_TRY(absorb_shards(whole, shards, out, kRunSeries,
                               [&](Recorder& recorder) { record_replan_head(whole, recorder); }));
    return summarise_replan("replan", SIDESTEP_TRY(read_replan_rows(out / kResultsFile)));
  }
};

}  // namespace
}  // namespace sidestep

SIDESTEP_EXPERIMENT(sidestep::ReplanExperiment, sidestep::ReplanSettings, "replan", "0.1.0",
                    "The closed loop: mapping, checking and replanning while the robot moves")
